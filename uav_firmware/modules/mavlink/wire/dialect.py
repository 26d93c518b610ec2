"""Codec of MAVLink: messages to payloads, payloads to frames, datagrams to messages.

The only file of the firmware that imports pymavlink, and of pymavlink only the generated
`development` dialect as a codec. Messages are pymavlink's generated classes; everywhere else
they are reached as `mavlink.MAVLink_<name>_message`.

A message is packed once into a `Payload` and framed per peer, because only the sequence
number differs between peers. Most messages are plain numbers; these are packed here, in half of
the time that pymavlink's own `pack` takes.

A datagram is searched for complete frames with a valid checksum. No state is carried over to the
next datagram, so a hostile or broken one cannot hide the frames that follow. Both protocol
versions are read, because a client may begin with version 1; version 2 is sent.
"""

import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any, Final, NamedTuple, TypeAlias

from pymavlink.dialects.v20 import development as mavlink

__all__ = [
    "Message",
    "Parsed",
    "Payload",
    "frame",
    "is_signed",
    "is_version_1",
    "mavlink",
    "pack",
    "parse",
    "register",
]

Message: TypeAlias = Any
"""An instance of one of pymavlink's generated message classes."""

_MARKER_V1: Final = 0xFE
_MARKER_V2: Final = 0xFD
_SIGNATURE_LENGTH: Final = 13
_OVERHEAD_V1: Final = 6 + 2
_OVERHEAD_V2: Final = 10 + 2
_SIGNED_FLAG: Final = 0x01
_HEADER_V2 = struct.Struct("<BBBBBBHB")
_MAX_FAULTS_PER_DATAGRAM: Final = 16


class Payload(NamedTuple):
    """A packed message without its frame, so that several peers can share it."""

    message_id: int
    crc_extra: int
    body: bytes  # Trailing zeros cut, at least one byte


class Parsed(NamedTuple):
    """Contents of a datagram."""

    messages: list[Message]
    faults: int  # Byte ranges that are not a valid frame


_parser = mavlink.MAVLink(None)


def _x25(covered: bytes, _start: int) -> int:
    """The checksum by pymavlink, where the library of checksums is not installed."""
    checksum: int = mavlink.x25crc(covered).crc
    return checksum


_crc: Final[Callable[[bytes, int], int]] = mavlink.mcrf4xx or _x25
"""CRC-16/MCRF4XX from a start value; pymavlink's own class costs three times as much."""
_CRC_START: Final = 0xFFFF


def register(message_class: type[Message]) -> type[Message]:
    """Add a message class that the shipped dialect lacks, or replace a shorter one."""
    mavlink.mavlink_map[message_class.id] = message_class
    return message_class


def pack(message: Message) -> Payload:
    """Pack a message's fields.

    Raises:
        struct.error: if a field does not fit its wire type.
    """
    kind: Any = type(message)
    numbers = _numbers_of(kind)
    if numbers is None:
        body = _packed_by_pymavlink(message)
    else:
        body = kind.unpacker.pack(*numbers(message))
    # The id of the class, because BATTERY_STATUS and others have a field `id`
    return Payload(kind.id, kind.crc_extra, body.rstrip(b"\x00") or body[:1])


@cache
def _numbers_of(kind: type[Message]) -> Callable[[Message], tuple[float, ...]] | None:
    """Return a function that reads the fields of a message class in wire order.

    None for a class that has arrays or texts, or a single field.
    """
    names = kind.ordered_fieldnames
    if any(kind.array_lengths) or "char" in kind.fieldtypes or len(names) < 2:
        return None
    numbers: Callable[[Message], tuple[float, ...]] = attrgetter(*names)
    return numbers


def _packed_by_pymavlink(message: Message) -> bytes:
    message._pack = _only_payload  # noqa: SLF001 - the only hook before header and checksum
    try:
        body: bytes = message.pack(None)
    finally:
        del message._pack  # noqa: SLF001 - as above
    return body


def _only_payload(
    _codec: None, _crc_extra: int, payload: bytes, *, force_mavlink1: bool = False
) -> bytes:
    """Replace pymavlink's framing, which is done per peer here."""
    del force_mavlink1
    return payload


def frame(
    payload: Payload, sequence: int, system: int, component: int, *, signed: bool = False
) -> bytes:
    """Frame a payload as MAVLink 2; the caller appends the signature of a signed frame."""
    identifier = payload.message_id
    covered = (
        _HEADER_V2.pack(
            len(payload.body),
            _SIGNED_FLAG if signed else 0,
            0,
            sequence,
            system,
            component,
            identifier & 0xFFFF,
            identifier >> 16,
        )
        + payload.body
    )
    checksum = _crc(covered + bytes((payload.crc_extra,)), _CRC_START)
    return b"\xfd" + covered + checksum.to_bytes(2, "little")


def is_signed(message: Message) -> bool:
    """Whether a received frame has a signature, valid or not."""
    flags: int = message.get_header().incompat_flags
    return bool(flags & _SIGNED_FLAG)


def is_version_1(message: Message) -> bool:
    """Whether a received frame is of version 1, which cannot be signed."""
    marker: int = message.get_msgbuf()[0]
    return marker == _MARKER_V1


def parse(datagram: bytes) -> Parsed:
    """Decode the messages in a datagram; skip bytes that are not a valid frame.

    Messages with an unknown id cannot be checked and are skipped.
    """
    messages: list[Message] = []
    faults = 0
    position = 0
    while position < len(datagram) and faults < _MAX_FAULTS_PER_DATAGRAM:
        length = _frame_length(datagram, position)
        message = _decode(datagram[position : position + length]) if length else None
        if message is None:
            faults += 1
            position = _next_marker(datagram, position + 1)
            continue
        position += length
        if not isinstance(message, mavlink.MAVLink_unknown):
            messages.append(message)
    return Parsed(messages, faults)


def _frame_length(datagram: bytes, position: int) -> int:
    """Length of the complete frame at `position`, or 0 if there is none."""
    remaining = len(datagram) - position
    marker = datagram[position]
    if marker == _MARKER_V1 and remaining >= _OVERHEAD_V1:
        length = datagram[position + 1] + _OVERHEAD_V1
    elif marker == _MARKER_V2 and remaining >= _OVERHEAD_V2:
        flags = datagram[position + 2]
        if flags & ~_SIGNED_FLAG:
            return 0  # Unknown incompatibility flag: the frame must be dropped
        signature = _SIGNATURE_LENGTH if flags & _SIGNED_FLAG else 0
        length = datagram[position + 1] + _OVERHEAD_V2 + signature
    else:
        return 0
    return length if length <= remaining else 0


def _next_marker(datagram: bytes, position: int) -> int:
    """Position of the next frame marker, or the end of the datagram."""
    while position < len(datagram) and datagram[position] not in {_MARKER_V1, _MARKER_V2}:
        position += 1
    return position


def _decode(frame_bytes: bytes) -> Message | None:
    """Decode one frame; None when its checksum is wrong."""
    try:
        return _parser.decode(bytearray(frame_bytes))
    except mavlink.MAVError:
        return None
