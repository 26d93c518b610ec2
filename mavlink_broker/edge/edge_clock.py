"""Estimates the edge server's time of day from its answers.

Work expires by the edge server's clock: an abort within 10 s. A broker on another machine, whose
clock is wrong, would refuse every abort as expired, or carry out one that nobody wants any more.

An answer names the time at which it was written and arrives later: of several answers the one that
was on its way for the shortest time is nearest to the truth. It was written after its request was
sent, so that a time which is too early even for that moment is that of a clock which was set back,
or of another edge server. An answer that is merely read late, as by a broker that was suspended for
minutes, changes nothing: an order in it has expired meanwhile.

The first answer has none before it that would show how long it was on its way. It is asked for
without a wait, so that it counts as written at once: an order in it may be older than it says.
"""

import logging
from collections import deque
from datetime import UTC, datetime, timedelta
from typing import Final

from pydantic import AwareDatetime, TypeAdapter, ValidationError

ANSWERS_KEPT: Final = 16
"""A drift of 100 ppm makes 30 ms within so many long polls."""
SET_BACK_S: Final = 1.0
"""More than the clocks drift apart within the answers that are kept."""

_TIME: Final[TypeAdapter[datetime]] = TypeAdapter(AwareDatetime)
_LOG = logging.getLogger(__name__)


class EdgeClock:
    """The edge server's time of day on this program's monotonic clock."""

    def __init__(self) -> None:
        self._ahead_s: deque[float] = deque(maxlen=ANSWERS_KEPT)  # [s] Of the monotonic clock
        self._first_at_most_s: float | None = None  # The same, until there is a second answer

    def read(self, written: object, sent_at: float, now: float) -> datetime | None:
        """Give the present time of day after an answer; None while none has named one to be used.

        `written` is the time as the answer has it; request and answer at monotonic times [s].
        """
        try:
            if isinstance(written, str):
                self.note(_TIME.validate_python(written), sent_at, now)
            return self.time(now)
        except (ValidationError, OverflowError):
            _LOG.warning("the time of the edge server's answer cannot be used: %.40r", written)
            return None

    def note(self, written: datetime, sent_at: float, now: float) -> None:
        """Take the time that an answer names; request and answer at monotonic times [s]."""
        at_least_s, at_most_s = written.timestamp() - now, written.timestamp() - sent_at
        is_first = not self._ahead_s
        if not is_first and at_most_s < max(self._ahead_s) - SET_BACK_S:
            self._ahead_s.clear()
        self._ahead_s.append(at_least_s)
        self._first_at_most_s = at_most_s if is_first else None

    def time(self, now: float) -> datetime | None:
        """Give the edge server's time of day at a monotonic time [s]; None without an answer."""
        if not self._ahead_s:
            return None
        first_s = self._first_at_most_s
        ahead_s = max(self._ahead_s) if first_s is None else first_s
        return datetime.fromtimestamp(0.0, UTC) + timedelta(seconds=ahead_s + now)
