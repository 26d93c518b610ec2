"""Finds when the process stood still, so that requests may have lain unread in their sockets.

A process that is suspended, or whose computer sleeps, reads afterwards what has arrived meanwhile,
and cannot know when that was. So whatever it reads shortly after a pause counts as having arrived
when the pause began.
"""

import time
from collections.abc import Callable
from typing import Final

PAUSE_S: Final = 1.0
"""Shorter pauses are those of a busy computer."""
UNREAD_S: Final = 2.0
"""So long behind a pause a request may be one that had waited."""


def since_boot_s() -> float:
    """Give a clock that goes on while the computer sleeps [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class StallMonitor:
    """Follows the turns of a loop; one thread calls all of it."""

    def __init__(self, clock: Callable[[], float] = since_boot_s) -> None:
        self._clock = clock
        self._noted_s = clock()
        self._began_s = -UNREAD_S  # Of the newest pause
        self._ended_s = -UNREAD_S

    def note(self, waited_s: float = 0.0) -> None:
        """Note that the loop goes on, which was to wait for at most so long."""
        now_s = self._clock()
        if now_s - self._noted_s > waited_s + PAUSE_S:
            self._began_s, self._ended_s = self._noted_s, now_s
        self._noted_s = now_s

    def arrived_s(self) -> float:
        """Give when a request that is complete now may have arrived at the earliest."""
        self.note()
        now_s = self._noted_s
        return self._began_s if now_s - self._ended_s < UNREAD_S else now_s
