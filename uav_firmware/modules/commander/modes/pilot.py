"""The pilot at the sticks: taking over from an automatic mode, and arming with safe sticks."""

from typing import Final

from uav_firmware.modules.commander.failsafe.actions import PILOTED
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.status import NavigationState

_CENTRED_UP: Final = 0.1  # [-] Throttle above the centre by more than this lifts off
_LOW: Final = -0.9  # [-] Throttle at and below it is down
_BY_THRUST: Final = frozenset({NavigationState.MANUAL, NavigationState.STAB, NavigationState.ACRO})


class TakeOver:
    """Notices that the pilot moves a stick: it was near its centre and is not any more."""

    def __init__(self) -> None:
        self._rested = False

    def moved(
        self, sticks: ManualControlSetpoint | None, threshold: float, mode: NavigationState
    ) -> bool:
        """Whether roll, pitch or yaw stick has just left the centre; None when they are lost.

        In an orbit the yaw stick belongs to the orbit, which may let it turn the nose.
        """
        if sticks is None:
            self._rested = False
            return False
        yaw = 0.0 if mode is NavigationState.ORBIT else abs(sticks.yaw)
        largest = max(abs(sticks.forward), abs(sticks.right), yaw)
        moved = self._rested and largest > threshold
        self._rested = largest <= threshold
        return moved


def unsafe_throttle(mode: NavigationState, sticks: ManualControlSetpoint | None) -> str | None:
    """Why arming with this throttle would jump; None when it would not."""
    if mode not in PILOTED or sticks is None:
        return None
    if mode in _BY_THRUST:
        return None if sticks.up <= _LOW else "Throttle is not down"
    return None if sticks.up <= _CENTRED_UP else "Throttle is above the centre"
