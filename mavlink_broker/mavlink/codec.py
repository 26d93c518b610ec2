"""Decodes datagrams to messages and encodes messages, with pymavlink's codec.

The decoder finds whole, correct frames in a datagram and keeps nothing for the next one, so a
broken or hostile datagram affects only itself.

Frames are handled as bytes too: length, checksum, copies with another sequence number or signature.
Layout and checksum: MAVLink's guide, "Packet Serialization" and "Message Signing". A frame of
version 2 is 0xFD, payload length, incompatibility and compatibility flags, sequence, system,
component, message id (3 bytes), payload, checksum (2), and 13 bytes of signature if the first flag
is set; one of version 1 is 0xFE, length, sequence, system, component, id, payload, checksum. The
checksum is CRC-16/MCRF4XX over all but the first byte, and over a byte (CRC_EXTRA) that stands for
the definition of the message.
"""

import hashlib
import re
import struct
from typing import Any, Final

from mavlink_broker.mavlink.dialect import Message, Source, mavlink

VERSION_1: Final = 0xFE
VERSION_2: Final = 0xFD
SIGNED_FLAG: Final = 0x01
SIGNATURE_LENGTH: Final = 13
DIGEST_LENGTH: Final = 6

SEQUENCES: Final = 256
"""Number of sequence numbers of a sender, from 0 on."""
_MAX_FAULTS_PER_DATAGRAM: Final = 16
"""Limit for a datagram full of start bytes, which would be slow to search."""
_OVERHEAD: Final = {VERSION_1: 8, VERSION_2: 12}
_MARKER: Final = re.compile(b"[\xfd\xfe]")
_SEQUENCE_AT: Final = {VERSION_1: 2, VERSION_2: 4}
_CHECKSUM: Final = struct.Struct("<H")
_LINK_AND_TIME: Final = struct.Struct("<BQ")
_LINK_AND_TIME_LENGTH: Final = 7


class Encoder:
    """Encodes messages for one peer, with its own sequence counter."""

    def __init__(self, system: int, component: int) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._unsigned = self._codec.signing

    def encode(self, message: Message, signing: Any = None) -> bytes:
        """Return the next frame on this link; `signing` is pymavlink's signing state, if any.

        Raises:
            struct.error: if a field does not fit its wire type.
        """
        self._codec.signing = self._unsigned if signing is None else signing
        frame: bytes = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % SEQUENCES
        return frame


def encoded_as(message: Message, source: Source, sequence: int) -> bytes:
    """Encode a message with another source."""
    codec = mavlink.MAVLink(None, source.system, source.component)
    codec.seq = sequence
    frame: bytes = message.pack(codec)
    return frame


class Decoder:
    """Decodes one peer's datagrams; counts what is no frame."""

    def __init__(self, *, keeps_unknown: bool = False) -> None:
        """Decode with the dialect; `keeps_unknown` returns unknown messages, without fields."""
        self._keeps_unknown = keeps_unknown
        self._codec = mavlink.MAVLink(None)
        self.faults = 0

    def decode(self, datagram: bytes) -> list[Message]:
        """Return every whole, correct frame whose message the dialect knows."""
        messages: list[Message] = []
        position = 0
        faults_allowed = self.faults + _MAX_FAULTS_PER_DATAGRAM
        while position < len(datagram) and self.faults < faults_allowed:
            end = _frame_end(datagram, position)
            message = self._frame(datagram[position:end])
            if message is None:
                self.faults += 1
                position = next_marker(datagram, position + 1)
                continue
            position = end
            if self._keeps_unknown or not isinstance(message, mavlink.MAVLink_unknown):
                messages.append(message)
        return messages

    def _frame(self, frame: bytes) -> Message | None:
        if not frame:
            return None
        try:
            message = self._codec.decode(bytearray(frame))
        except mavlink.MAVError:
            return None
        if isinstance(message, mavlink.MAVLink_unknown):
            flags = SIGNED_FLAG if is_signed(frame) else 0
            message._header = mavlink.MAVLink_header(  # noqa: SLF001  # left empty by pymavlink
                message_id(frame), flags, 0, frame[1], sequence(frame), *sender(frame)
            )
        return message


def _frame_end(datagram: bytes, position: int) -> int:
    """End of the frame that begins at `position`; `position` itself where none does."""
    size = frame_size(datagram, position) or 0
    return position + size if size <= len(datagram) - position else position


def next_marker(data: bytes, position: int) -> int:
    """Position of the next start byte of a frame; the end if there is none."""
    found = _MARKER.search(data, position)
    return found.start() if found else len(data)


def frame_size(data: bytes, position: int) -> int | None:
    """Length of the frame that starts at `position`; it may be longer than the data.

    0 if no frame can start there; None if the data is too short to decide.
    """
    overhead = _OVERHEAD.get(data[position], 0)
    if not overhead:
        return 0
    if len(data) - position < 3:
        return None
    size = data[position + 1] + overhead
    if data[position] == VERSION_2:
        flags = data[position + 2]
        if flags & ~SIGNED_FLAG:
            return 0  # An unknown incompatibility flag: the frame must be discarded
        size += SIGNATURE_LENGTH if flags & SIGNED_FLAG else 0
    return size


def is_signed(frame: bytes) -> bool:
    """Whether a whole frame carries a signature."""
    return frame[0] == VERSION_2 and bool(frame[2] & SIGNED_FLAG)


def message_id(frame: bytes) -> int:
    """Message id of a whole frame."""
    if frame[0] == VERSION_1:
        return frame[5]
    return int.from_bytes(frame[7:10], "little")


def sender(frame: bytes) -> tuple[int, int]:
    """System and component id of a whole frame."""
    at = _SEQUENCE_AT[frame[0]] + 1
    return frame[at], frame[at + 1]


def sequence(frame: bytes) -> int:
    """Sequence number of a whole frame."""
    return frame[_SEQUENCE_AT[frame[0]]]


def checksum_holds(frame: bytes) -> bool | None:
    """Whether the checksum is correct; None if the dialect does not know the message."""
    extra = _extra_of(message_id(frame))
    if extra is None:
        return None
    body, checksum = _parts(frame)
    return _checksum(body, extra) == checksum


def with_sequence(frame: bytes, number: int) -> bytes:
    """An unsigned frame with another sequence number."""
    if sequence(frame) == number:
        return frame
    body, extra = _body_and_extra(frame)
    changed = bytearray(body)
    changed[_SEQUENCE_AT[frame[0]] - 1] = number
    return _sealed(frame[0], bytes(changed), extra)


def unsigned(frame: bytes) -> bytes:
    """A frame without its signature; an unsigned frame unchanged."""
    if not is_signed(frame):
        return frame
    body, extra = _body_and_extra(frame)
    return _sealed(VERSION_2, _with_flags(body, body[1] & ~SIGNED_FLAG), extra)


def signed(frame: bytes, key: bytes, link_id: int, ticks: int) -> bytes:
    """A frame of version 2 with a new signature; `ticks` are 10 us since 2015."""
    body, extra = _body_and_extra(frame)
    if frame[0] == VERSION_1:
        body = _in_version_2(body)
    whole = _sealed(VERSION_2, _with_flags(body, body[1] | SIGNED_FLAG), extra)
    whole += _LINK_AND_TIME.pack(link_id, ticks)[:_LINK_AND_TIME_LENGTH]
    return whole + hashlib.sha256(key + whole).digest()[:DIGEST_LENGTH]


def _parts(frame: bytes) -> tuple[bytes, int]:
    """The bytes that the checksum covers, and the checksum."""
    end = len(frame) - (SIGNATURE_LENGTH if is_signed(frame) else 0)
    checksum: int = _CHECKSUM.unpack_from(frame, end - 2)[0]
    return bytes(frame[1 : end - 2]), checksum


def _body_and_extra(frame: bytes) -> tuple[bytes, int]:
    """The bytes that the checksum covers, and CRC_EXTRA.

    It is derived from the checksum if the dialect lacks the message.
    """
    body, checksum = _parts(frame)
    extra = _extra_of(message_id(frame))
    if extra is None:
        extra = next((one for one in range(256) if _checksum(body, one) == checksum), 0)
    return body, extra


def _sealed(marker: int, body: bytes, extra: int) -> bytes:
    return bytes((marker,)) + body + _CHECKSUM.pack(_checksum(body, extra))


def _with_flags(body: bytes, flags: int) -> bytes:
    return body[:1] + bytes((flags,)) + body[2:]


def _in_version_2(body: bytes) -> bytes:
    """Length, sequence, system, component, id and payload in the order of version 2."""
    return bytes((body[0], 0, 0, *body[1:4], body[4], 0, 0)) + body[5:]


def _checksum(body: bytes, extra: int) -> int:
    checksum: int = mavlink.x25crc(body + bytes((extra,))).crc
    return checksum


def _extra_of(number: int) -> int | None:
    kind = mavlink.mavlink_map.get(number)
    return None if kind is None else int(kind.crc_extra)
