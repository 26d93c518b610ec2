"""How many reads of a file may be on their way at once: as many as do not make the link slower.

Loss tells nothing here: a radio loses frames whether it is busy or idle. What tells is the round
trip: a link that is full queues, so that answers come later than they could. While they come about
as fast as ever, each answer allows one read more; when they take twice as long, the number is
halved. The idea is that of LEDBAT (RFC 6817). New reads are spaced, because some servers queue
five requests and drop the sixth.
"""

from typing import Final

LEAST: Final = 4
MOST: Final = 32
"""What the servers of PX4, ArduPilot and this project's vehicle take, if it comes spaced."""
SPACING_S: Final = 0.01
AT_ONCE: Final = 4
SLACK_S: Final = 0.1
"""By so much round trips differ on an idle link."""


class ReadWindow:
    """The window of one transfer."""

    def __init__(self) -> None:
        self._size = float(LEAST)
        self._shortest_s: float | None = None
        self._halved_at = 0.0
        self._sent_at = 0.0

    @property
    def size(self) -> int:
        """How many may be on their way."""
        return int(self._size)

    def answered(self, round_trip_s: float, now: float) -> None:
        """Take the round trip of a read that was sent once."""
        if self._shortest_s is None or round_trip_s < self._shortest_s:
            self._shortest_s = round_trip_s
        if round_trip_s <= 1.5 * self._shortest_s + SLACK_S:
            self._size = min(float(MOST), self._size + 1.0)
        elif round_trip_s > 2.0 * self._shortest_s + SLACK_S:
            self._halve(now, round_trip_s)

    def allowance(self, now: float, pending: int) -> int:
        """How many may be sent now, with so many unanswered."""
        spaced = min(AT_ONCE, int((now - self._sent_at) / SPACING_S))
        count = max(0, min(self.size - pending, spaced))
        if count:
            self._sent_at = now
        return count

    def _halve(self, now: float, round_trip_s: float) -> None:
        """Halve it, once for all the answers that were on their way together."""
        if now - self._halved_at >= round_trip_s:
            self._halved_at = now
            self._size = max(float(LEAST), self._size / 2.0)
