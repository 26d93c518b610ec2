"""Detects a reboot of a vehicle: its time since boot goes back.

These are not reboots: frames that overtake one another; frames that a radio has delayed, some
seconds of them in a row; messages whose clocks differ by some seconds, which is why each kind of
message is tracked separately; and the overflow of the counter at 2^32 ms, after 49.7 days. The
speed of the clock does not matter: a simulated one may run at any speed.
"""

import math
from dataclasses import dataclass
from typing import Final

TOLERANCE_MS: Final = 1000
"""Frames that overtake one another step back by less."""
CONFIRMATIONS: Final = 3
"""One late frame proves nothing; a rebooted vehicle continues to count from zero."""
SILENCE_S: Final = 2.0
"""After this silence any step back counts: the vehicle may have been switched off."""
FAR_BACK_MS: Final = 30_000
"""Step back that counts without a silence: no radio delays frames for so long."""
MESSAGES_KEPT: Final = 64
_COUNTER: Final = 1 << 32
_NEAR_THE_END_MS: Final = 600_000


@dataclass(slots=True)
class _Clock:
    """The clock of one kind of message."""

    newest_ms: int
    received_at: float
    behind: int = 0
    was_silent: bool = False  # Before it went back


class RebootMonitor:
    """Follows `time_boot_ms` of one vehicle."""

    def __init__(self) -> None:
        self._clocks: dict[str, _Clock] = {}
        self.confirmed_at = -math.inf  # When the clock last went on, or a reboot was detected

    def sample(self, kind: str, time_boot_ms: int, now: float) -> bool:
        """Take a time since boot of a kind of message; true when it proves a reboot."""
        clock = self._clocks.get(kind)
        if clock is None:
            if len(self._clocks) < MESSAGES_KEPT:
                self._clocks[kind] = _Clock(time_boot_ms, now)
            return False
        gap_s, clock.received_at = now - clock.received_at, now
        if time_boot_ms >= clock.newest_ms or _has_wrapped(clock.newest_ms, time_boot_ms):
            clock.newest_ms, clock.behind, clock.was_silent = time_boot_ms, 0, False
            self.confirmed_at = now
        else:
            clock.was_silent |= gap_s >= SILENCE_S
            clock.behind += _is_suspicious(clock, time_boot_ms)
        if clock.behind < CONFIRMATIONS:
            return False
        self._clocks = {kind: _Clock(time_boot_ms, now)}
        self.confirmed_at = now
        return True


def _is_suspicious(clock: _Clock, time_boot_ms: int) -> bool:
    back_ms = clock.newest_ms - time_boot_ms
    if back_ms <= TOLERANCE_MS:
        return False
    begun_again = back_ms > FAR_BACK_MS or time_boot_ms < clock.newest_ms / 2
    return begun_again or clock.was_silent


def _has_wrapped(newest_ms: int, time_boot_ms: int) -> bool:
    at_the_end = newest_ms > _COUNTER - _NEAR_THE_END_MS
    return at_the_end and time_boot_ms < _NEAR_THE_END_MS
