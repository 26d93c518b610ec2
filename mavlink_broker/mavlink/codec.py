"""Datagrams to messages and back, on pymavlink's codec.

A datagram is searched for whole, correct frames; nothing is carried over to the next datagram,
so a broken or hostile one costs only itself.
"""

from typing import Any, Final

from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of
from mavlink_broker.mavlink.frames import (
    SIGNED_FLAG,
    frame_size,
    is_signed,
    message_id,
    next_marker,
    sender,
    sequence,
)

_SEQUENCES: Final = 256
_MAX_FAULTS_PER_DATAGRAM: Final = 16
"""So that a datagram full of frames' first bytes cannot keep the broker busy."""


SOURCES_KEPT: Final = 256
"""Senders per correspondent whose frames are counted."""


class Encoder:
    """Frames messages for one peer, with a sequence counter of its own."""

    def __init__(self, system: int, component: int) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._unsigned = self._codec.signing

    def encode(self, message: Message, signing: Any = None) -> bytes:
        """Give the next frame on this link; `signing` is what pymavlink signs by, if at all.

        Raises:
            struct.error: if a field does not fit its wire type.
        """
        self._codec.signing = self._unsigned if signing is None else signing
        frame: bytes = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % _SEQUENCES
        return frame


def encoded_as(message: Message, source: Source, sequence: int) -> bytes:
    """Frame a message in somebody's name."""
    codec = mavlink.MAVLink(None, source.system, source.component)
    codec.seq = sequence
    frame: bytes = message.pack(codec)
    return frame


class Decoder:
    """Reads one peer's datagrams and counts what was lost, by the gaps in its sequences."""

    def __init__(self, *, keeps_unknown: bool = False) -> None:
        """Read with the dialect; what it does not know is given out without fields, if asked."""
        self._keeps_unknown = keeps_unknown
        self._codec = mavlink.MAVLink(None)
        self._expected: dict[Source, int] = {}
        self.received = 0
        self.lost = 0
        self.faults = 0

    def decode(self, datagram: bytes) -> list[Message]:
        """Find every whole, correct frame whose message the dialect knows."""
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
                self._count(message)
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

    def _count(self, message: Message) -> None:
        source, sequence = source_of(message), message.get_seq()
        if source not in self._expected and len(self._expected) >= SOURCES_KEPT:
            self._expected.clear()  # Somebody counts through all numbers
        gap = (sequence - self._expected.get(source, sequence)) % _SEQUENCES
        self.received += 1
        if gap < _SEQUENCES // 2:  # Beyond half a turn it is a late or repeated frame
            self.lost += gap
            self._expected[source] = (sequence + 1) % _SEQUENCES


def _frame_end(datagram: bytes, position: int) -> int:
    """End of the frame that begins at `position`; `position` itself where none does."""
    size = frame_size(datagram, position) or 0
    return position + size if size <= len(datagram) - position else position
