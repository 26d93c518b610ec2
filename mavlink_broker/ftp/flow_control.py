"""Flow control of a file transfer: pauses between bursts, and the window of parallel reads.

The window is as large as possible without lengthening the round trip, as in LEDBAT (RFC 6817). Loss
is no measure: a radio loses frames whether it is busy or idle. But a full link queues, so that
answers are delayed. While answers arrive about as fast as ever, each increases the window by one;
when they take twice as long, the window is halved. New reads are spaced, because some servers queue
five requests and drop the sixth.
"""

from typing import Final

PAUSE_SHARE: Final = 0.25
"""Pause after a burst, as a share of its duration."""
MAX_PAUSE_S: Final = 1.0
MIN_SILENCE_S: Final = 0.25
"""Packets of a burst are sent closely: after such a silence the rest of it is lost."""
SILENCE_GAPS: Final = 3.0
"""Least silence as a multiple of the longest gap between packets so far."""


class BurstTracker:
    """Tracks the bursts of one file."""

    def __init__(self) -> None:
        self._started_at: float | None = None
        self._received_at = 0.0
        self._longest_gap_s = 0.0
        self._new_packets = 0  # Packets of the current burst with new data
        self.position = 0  # [bytes] End of the newest packet, or start of the requested burst

    @property
    def is_active(self) -> bool:
        """Whether a burst is being received."""
        return self._started_at is not None

    def start(self, now: float) -> None:
        """Start a burst: its first packet was received."""
        self._started_at = self._received_at = now
        self._new_packets = 0

    def received(self, now: float, end: int, *, is_new: bool) -> None:
        """Take a packet whose data ends at this offset."""
        if self.is_active:
            self._longest_gap_s = max(self._longest_gap_s, now - self._received_at)
        self._received_at = now
        self._new_packets += is_new
        self.position = max(self.position, end)

    def is_silent(self, now: float, timeout_s: float) -> bool:
        """Whether the rest of a burst is lost."""
        silence_s = min(timeout_s, max(MIN_SILENCE_S, SILENCE_GAPS * self._longest_gap_s))
        return self.is_active and now - self._received_at >= silence_s

    def end(self, now: float) -> tuple[float, bool]:
        """End the burst; returns how long to pause [s], and whether it had new data."""
        started_at = now if self._started_at is None else self._started_at
        self._started_at = None
        return min(PAUSE_SHARE * (now - started_at), MAX_PAUSE_S), self._new_packets > 0

    def stop(self) -> None:
        """Expect no further packets."""
        self._started_at = None


MIN_SIZE: Final = 4
MAX_SIZE: Final = 32
"""The servers of PX4, ArduPilot and this project's vehicle accept so many if they are spaced."""
SPACING_S: Final = 0.01
MAX_NEW_REQUESTS: Final = 4
ROUND_TRIP_TOLERANCE_S: Final = 0.1
"""Variation of round trips on an idle link."""


class ReadWindow:
    """Window of parallel reads of one transfer."""

    def __init__(self) -> None:
        self._size = float(MIN_SIZE)
        self._shortest_s: float | None = None
        self._halved_at = 0.0
        self._sent_at = 0.0

    @property
    def size(self) -> int:
        """How many reads may be unanswered."""
        return int(self._size)

    def answered(self, round_trip_s: float, now: float) -> None:
        """Take the round trip of a read that was not repeated."""
        if self._shortest_s is None or round_trip_s < self._shortest_s:
            self._shortest_s = round_trip_s
        if round_trip_s <= 1.5 * self._shortest_s + ROUND_TRIP_TOLERANCE_S:
            self._size = min(float(MAX_SIZE), self._size + 1.0)
        elif round_trip_s > 2.0 * self._shortest_s + ROUND_TRIP_TOLERANCE_S:
            self._halve(now, round_trip_s)

    def allowance(self, now: float, pending: int) -> int:
        """How many may be sent now, with `pending` unanswered."""
        spaced = min(MAX_NEW_REQUESTS, int((now - self._sent_at) / SPACING_S))
        count = max(0, min(self.size - pending, spaced))
        if count:
            self._sent_at = now
        return count

    def _halve(self, now: float, round_trip_s: float) -> None:
        """Halve it, at most once per round trip."""
        if now - self._halved_at >= round_trip_s:
            self._halved_at = now
            self._size = max(float(MIN_SIZE), self._size / 2.0)
