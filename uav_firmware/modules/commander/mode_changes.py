"""Changes of the mode besides commands and failsafes: stick override, end of a timed hold."""

from typing import Final

from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.status import NavigationState


class StickOverride:
    """Detects that the pilot moves a stick out of its centre (PX4's COM_RC_OVERRIDE)."""

    def __init__(self) -> None:
        self._was_centred = False

    def moved(
        self, sticks: ManualControlSetpoint | None, threshold: float, mode: NavigationState
    ) -> bool:
        """Whether roll, pitch or yaw stick has just left the centre; None when they are lost.

        In an orbit the yaw stick is an input of the orbit and does not count.
        """
        if sticks is None:
            self._was_centred = False
            return False
        yaw = 0.0 if mode is NavigationState.ORBIT else abs(sticks.yaw)
        largest = max(abs(sticks.forward), abs(sticks.right), yaw)
        moved = self._was_centred and largest > threshold
        self._was_centred = largest <= threshold
        return moved


_SETTLE_US: Final = 200_000
"""[us] Until the navigator's status is certain to refer to the ordered hold."""


class TimedHold:
    """NAV_LOITER_TIME in flight: a hold with a limit of time.

    idle     --ordered------------------> going      to the target, or to rest
    going    --at rest------------------> waiting    the time begins
    waiting  --the time has passed------> idle       the former mode continues
    any      --another mode is entered--> idle
    """

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
        """Drop the order: another mode is flown."""
        self._seconds = None

    def next_mode(self, mode: NavigationState, now_us: int, *, at_rest: bool) -> NavigationState:
        """Mode to fly: the present one until the time has passed."""
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
