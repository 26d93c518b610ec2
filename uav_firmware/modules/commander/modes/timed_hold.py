"""A hold that ends by itself: NAV_LOITER_TIME in flight.

idle     --ordered------------------> going      to the place, or to rest here
going    --at rest------------------> waiting    the time begins
waiting  --the time is over---------> idle       what was flown before goes on
any      --another mode is entered--> idle
"""

from typing import Final

from uav_firmware.msg.status import NavigationState

_SETTLE_US: Final = 200_000
"""[us] Until the navigator's report can no longer be about what it flew before the order."""


class TimedHold:
    """Counts the time of one hold."""

    def __init__(self) -> None:
        self._seconds: float | None = None
        self._then = NavigationState.AUTO_LOITER
        self._ordered_us = 0
        self._at_rest_us: int | None = None

    def order(self, seconds: float, then: NavigationState, now_us: int) -> None:
        """Hold for `seconds` once at rest, then fly in mode `then`."""
        self._seconds, self._then = seconds, then
        self._ordered_us, self._at_rest_us = now_us, None

    def cancel(self) -> None:
        """Forget the order: something else is flown."""
        self._seconds = None

    def next_mode(self, mode: NavigationState, now_us: int, *, at_rest: bool) -> NavigationState:
        """The mode to fly in: the present one until the time is over."""
        if self._seconds is None:
            return mode
        if mode is not NavigationState.AUTO_LOITER:
            self.cancel()
            return mode
        if self._at_rest_us is None:
            if at_rest and now_us - self._ordered_us >= _SETTLE_US:
                self._at_rest_us = now_us
            return mode
        if now_us - self._at_rest_us < self._seconds * 1e6:
            return mode
        self.cancel()
        return self._then
