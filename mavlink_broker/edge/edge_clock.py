"""Estimates the edge server's time of day from its answers.

Work expires by the edge server's clock: an abort within 10 s. A broker on another machine, whose
clock is wrong, would refuse every abort as expired, or carry out one that nobody wants any more.

An answer names the time at which it was written and arrives later: of several answers the one that
was on its way for the shortest time is nearest to the truth. A time that differs from the estimate
by more than an answer may take is that of a clock which was set, or of another edge server.
"""

from collections import deque
from datetime import UTC, datetime, timedelta
from typing import Final

ANSWERS_KEPT: Final = 16
"""A drift of 100 ppm makes 30 ms within so many long polls."""
LONGEST_DELAY_S: Final = 60.0
"""Longer than an answer is waited for."""


class EdgeClock:
    """The edge server's time of day on this program's monotonic clock."""

    def __init__(self) -> None:
        self._ahead_s: deque[float] = deque(maxlen=ANSWERS_KEPT)  # [s] Of the monotonic clock

    def note(self, written: datetime, now: float) -> None:
        """Take the time that an answer names, received at a monotonic time [s]."""
        ahead_s = written.timestamp() - now
        if self._ahead_s and abs(ahead_s - max(self._ahead_s)) > LONGEST_DELAY_S:
            self._ahead_s.clear()
        self._ahead_s.append(ahead_s)

    def time(self, now: float) -> datetime | None:
        """Give the edge server's time of day at a monotonic time [s]; None without an answer."""
        if not self._ahead_s:
            return None
        return datetime.fromtimestamp(0.0, UTC) + timedelta(seconds=max(self._ahead_s) + now)
