"""Decodes datagrams to messages and encodes messages, with pymavlink's codec.

The decoder finds whole, correct frames in a datagram and keeps nothing for the next one, so a
broken or hostile datagram affects only itself.
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
"""Limit for a datagram full of start bytes, which would be slow to search."""


SOURCES_KEPT: Final = 256
"""Senders per peer whose losses are counted."""


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
        self._codec.seq = (self._codec.seq + 1) % _SEQUENCES
        return frame


def encoded_as(message: Message, source: Source, sequence: int) -> bytes:
    """Encode a message with another source."""
    codec = mavlink.MAVLink(None, source.system, source.component)
    codec.seq = sequence
    frame: bytes = message.pack(codec)
    return frame


class Decoder:
    """Decodes one peer's datagrams and counts lost frames by gaps in the sequence numbers."""

    def __init__(self, *, keeps_unknown: bool = False) -> None:
        """Decode with the dialect; `keeps_unknown` returns unknown messages, without fields."""
        self._keeps_unknown = keeps_unknown
        self._codec = mavlink.MAVLink(None)
        self._expected: dict[Source, int] = {}
        self.received = 0
        self.lost = 0
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
            self._expected.clear()  # A hostile peer uses all ids
        gap = (sequence - self._expected.get(source, sequence)) % _SEQUENCES
        self.received += 1
        if gap < _SEQUENCES // 2:  # A larger gap is a late or repeated frame
            self.lost += gap
            self._expected[source] = (sequence + 1) % _SEQUENCES


def _frame_end(datagram: bytes, position: int) -> int:
    """End of the frame that begins at `position`; `position` itself where none does."""
    size = frame_size(datagram, position) or 0
    return position + size if size <= len(datagram) - position else position
