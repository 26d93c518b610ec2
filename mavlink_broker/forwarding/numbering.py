"""Sequence numbers towards ground stations, which judge a link by the gaps between them.

What is kept from them must not look like a loss, and what is said in a vehicle's name must not
look like 255 of them. So numbers are moved by as many as frames were withheld or added; true
losses between vehicle and broker stay visible.
"""

from mavlink_broker.mavlink.dialect import Source
from mavlink_broker.mavlink.frames import sender, sequence, with_sequence

_SEQUENCES = 256


class Numbering:
    """Counts what was added and withheld, per sender."""

    def __init__(self) -> None:
        self._moved: dict[Source, int] = {}
        self._newest: dict[Source, int] = {}

    def passed(self, frame: bytes) -> bytes:
        """Give an unsigned frame with the number that it has for ground stations."""
        source = Source(*sender(frame))
        moved = self._moved.get(source, 0)
        number = (sequence(frame) + moved) % _SEQUENCES
        self._newest[source] = number
        return with_sequence(frame, number) if moved else frame

    def withheld(self, source: Source) -> None:
        """Close the gap of a frame that is not for ground stations."""
        self._moved[source] = (self._moved.get(source, 0) - 1) % _SEQUENCES

    def added(self, source: Source) -> int:
        """Give the number of a frame that is put in between."""
        self._moved[source] = (self._moved.get(source, 0) + 1) % _SEQUENCES
        self._newest[source] = (self._newest.get(source, -1) + 1) % _SEQUENCES
        return self._newest[source]
