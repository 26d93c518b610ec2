"""MAVLink as bytes: messages to payloads, payloads to frames, datagrams to messages.

The only file of the firmware that imports pymavlink, and of pymavlink only the generated
`development` dialect as a codec. Messages are pymavlink's generated classes; everywhere else
they are reached as `mavlink.MAVLink_<name>_message`.

A message is packed once into a `Payload` and framed per peer, because only the sequence
number differs between peers. Most messages are plain numbers; these are packed here, in half of
the time that pymavlink's own `pack` takes.

A datagram is searched for whole frames with a right checksum. Nothing is carried over from
one datagram to the next, so a hostile or broken datagram cannot swallow the frames of the
following one. Both protocol versions are read, because a client may begin with version 1;
everything is sent as version 2.
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
    """What a datagram held."""

    messages: list[Message]
    faults: int  # Stretches of bytes that were no valid frame


_parser = mavlink.MAVLink(None)


def register(message_class: type[Message]) -> type[Message]:
    """Make the codec know a message class that the shipped dialect lacks or has shorter."""
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
        body = _packed_by_its_class(message)
    else:
        body = kind.unpacker.pack(*numbers(message))
    # The id of the class: BATTERY_STATUS and others have a field of the name `id`.
    return Payload(kind.id, kind.crc_extra, body.rstrip(b"\x00") or body[:1])


@cache
def _numbers_of(kind: type[Message]) -> Callable[[Message], tuple[float, ...]] | None:
    """Give what reads the fields of a message class in their order on the wire.

    None for a class that has arrays or texts, or a single field.
    """
    names = kind.ordered_fieldnames
    if any(kind.array_lengths) or "char" in kind.fieldtypes or len(names) < 2:
        return None
    numbers: Callable[[Message], tuple[float, ...]] = attrgetter(*names)
    return numbers


def _packed_by_its_class(message: Message) -> bytes:
    message._pack = _only_payload  # noqa: SLF001 - the one seam before header and checksum
    try:
        body: bytes = message.pack(None)
    finally:
        del message._pack  # noqa: SLF001 - as above
    return body


def _only_payload(
    _codec: None, _crc_extra: int, payload: bytes, *, force_mavlink1: bool = False
) -> bytes:
    """Stand in for pymavlink's framing, which would be done once per peer for nothing."""
    del force_mavlink1
    return payload


def frame(
    payload: Payload, sequence: int, system: int, component: int, *, signed: bool = False
) -> bytes:
    """Frame a payload as MAVLink 2; a signed frame still needs its signature behind it."""
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
    checksum: int = mavlink.x25crc(covered + bytes((payload.crc_extra,))).crc
    return b"\xfd" + covered + checksum.to_bytes(2, "little")


def is_signed(message: Message) -> bool:
    """Whether a received message came in a frame with a signature, right or wrong."""
    flags: int = message.get_header().incompat_flags
    return bool(flags & _SIGNED_FLAG)


def is_version_1(message: Message) -> bool:
    """Whether a received message came in a frame of the old version, which cannot be signed."""
    marker: int = message.get_msgbuf()[0]
    return marker == _MARKER_V1


def parse(datagram: bytes) -> Parsed:
    """Find the messages in a datagram, skipping whatever is no valid frame.

    Messages whose id the dialect does not know cannot be checked and are skipped whole.
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
    """Length of the frame that begins at `position`, or 0 where no whole frame does."""
    remaining = len(datagram) - position
    marker = datagram[position]
    if marker == _MARKER_V1 and remaining >= _OVERHEAD_V1:
        length = datagram[position + 1] + _OVERHEAD_V1
    elif marker == _MARKER_V2 and remaining >= _OVERHEAD_V2:
        flags = datagram[position + 2]
        if flags & ~_SIGNED_FLAG:
            return 0  # An incompatibility that we do not know: the frame must be dropped
        signature = _SIGNATURE_LENGTH if flags & _SIGNED_FLAG else 0
        length = datagram[position + 1] + _OVERHEAD_V2 + signature
    else:
        return 0
    return length if length <= remaining else 0


def _next_marker(datagram: bytes, position: int) -> int:
    """Position of the next byte that may begin a frame; the end where there is none."""
    while position < len(datagram) and datagram[position] not in {_MARKER_V1, _MARKER_V2}:
        position += 1
    return position


def _decode(frame_bytes: bytes) -> Message | None:
    """Decode one whole frame; None when its checksum is wrong."""
    try:
        return _parser.decode(bytearray(frame_bytes))
    except mavlink.MAVError:
        return None
