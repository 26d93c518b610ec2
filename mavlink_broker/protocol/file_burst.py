"""One burst after the other: where the next begins, whether one is on, how long to pause."""

from typing import Final

BREATH: Final = 0.25
"""Of a burst's time: how long others may speak behind it."""
LONGEST_BREATH_S: Final = 1.0


class Bursts:
    """The bursts of one file."""

    def __init__(self) -> None:
        self._began: tuple[float, int] | None = None  # When, and from where
        self._heard_at = 0.0
        self.begins_at = 0  # The offset from which the next is asked for

    @property
    def is_on(self) -> bool:
        """Whether packets are still to come."""
        return self._began is not None

    def begin(self, now: float) -> None:
        """Take that the first packet has come."""
        self._began = now, self.begins_at

    def heard(self, now: float, frontier: int) -> None:
        """Take that a packet has come, and what lies in front of all that has come."""
        self._heard_at = now
        self.begins_at = max(self.begins_at, frontier)

    def is_silent(self, now: float, timeout_s: float) -> bool:
        """Whether the rest of a burst is lost."""
        return self.is_on and now - self._heard_at >= timeout_s

    def end(self, now: float) -> tuple[float, bool]:
        """End it; gives how long to pause, and whether it brought anything new."""
        began_at, began_with = self._began or (now, 0)
        self._began = None
        return min(BREATH * (now - began_at), LONGEST_BREATH_S), self.begins_at > began_with

    def stop(self) -> None:
        """Expect no more packets."""
        self._began = None
