"""One burst after the other: where the next begins, whether one is on, how long to pause."""

from typing import Final

BREATH: Final = 0.25
"""Of a burst's time: how long others may speak behind it."""
LONGEST_BREATH_S: Final = 1.0
SHORTEST_SILENCE_S: Final = 0.25
"""Packets of a burst follow each other closely; behind such a pause the rest of it is lost."""
GAPS: Final = 3.0
"""How many times the longest pause between packets so far a silence must last."""


class Bursts:
    """The bursts of one file."""

    def __init__(self) -> None:
        self._began_at: float | None = None
        self._heard_at = 0.0
        self._longest_gap_s = 0.0
        self._news = 0  # Packets of the burst that is on which brought something
        self.position = 0  # [bytes] Behind the newest packet, or where the next was asked for

    @property
    def is_on(self) -> bool:
        """Whether packets are still to come."""
        return self._began_at is not None

    def begin(self, now: float) -> None:
        """Take that the first packet has come."""
        self._began_at = self._heard_at = now
        self._news = 0

    def heard(self, now: float, end: int, *, is_news: bool) -> None:
        """Take that a packet has come, and where in the file its data end."""
        if self.is_on:
            self._longest_gap_s = max(self._longest_gap_s, now - self._heard_at)
        self._heard_at = now
        self._news += is_news
        self.position = max(self.position, end)

    def is_silent(self, now: float, timeout_s: float) -> bool:
        """Whether the rest of a burst is lost."""
        silence_s = min(timeout_s, max(SHORTEST_SILENCE_S, GAPS * self._longest_gap_s))
        return self.is_on and now - self._heard_at >= silence_s

    def end(self, now: float) -> tuple[float, bool]:
        """End it; gives how long to pause, and whether it brought anything new."""
        began_at = now if self._began_at is None else self._began_at
        self._began_at = None
        return min(BREATH * (now - began_at), LONGEST_BREATH_S), self._news > 0

    def stop(self) -> None:
        """Expect no more packets."""
        self._began_at = None
