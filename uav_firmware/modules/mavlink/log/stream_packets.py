"""ULog messages cut into packets that tell where the first message in them begins."""

import struct
from collections.abc import Iterator
from typing import Final, NamedTuple

DATA_MAX: Final = 249
NO_BEGINNING: Final = 255
_MAGIC: Final = b"\x55\x4c\x6f\x67"
_FILE_HEADER_BYTES: Final = 16
_MESSAGE_HEADER_BYTES: Final = 3
_SIZE: Final = struct.Struct("<H")
_DROPOUT: Final = struct.Struct("<HcH")


class StreamPacket(NamedTuple):
    """What one LOGGING_DATA carries."""

    data: bytes
    first_message: int  # [bytes] Where the first message begins; 255 where none does


def cut(chunk: bytes) -> Iterator[StreamPacket]:
    """Cut whole messages, with or without the file's header before them."""
    beginnings = _beginnings(chunk)
    beginning = next(beginnings, None)
    for start in range(0, len(chunk), DATA_MAX):
        while beginning is not None and beginning < start:
            beginning = next(beginnings, None)
        data = chunk[start : start + DATA_MAX]
        if beginning is not None and beginning < start + len(data):
            yield StreamPacket(data, beginning - start)
        else:
            yield StreamPacket(data, NO_BEGINNING)


def dropout(duration_us: int) -> bytes:
    """A ULog message that tells of data that is missing."""
    return _DROPOUT.pack(2, b"O", min(duration_us // 1000, 0xFFFF))


def _beginnings(chunk: bytes) -> Iterator[int]:
    """Where messages begin; the file's header counts as one."""
    position = 0
    if chunk.startswith(_MAGIC):
        yield 0
        position = _FILE_HEADER_BYTES
    while position + _MESSAGE_HEADER_BYTES <= len(chunk):
        yield position
        (size,) = _SIZE.unpack_from(chunk, position)
        position += _MESSAGE_HEADER_BYTES + size
