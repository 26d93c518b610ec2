"""Actions of failsafes in the order of their severity, and the mode of each."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from uav_firmware.msg.geofence import FenceAction
from uav_firmware.msg.status import NavigationState


class Action(IntEnum):
    """Action of a failsafe; a greater one is more severe."""

    NONE = 0
    WARN = 1
    POSITION = 2  # The pilot continues in position mode
    ALTITUDE = 3  # The pilot continues in altitude mode
    STABILIZED = 4  # The pilot continues in stabilized mode
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8  # Land at once at the present place with the sensors left
    DISARM = 9
    TERMINATE = 10


MODE_OF: Final[Mapping[Action, NavigationState]] = {
    Action.POSITION: NavigationState.POSCTL,
    Action.ALTITUDE: NavigationState.ALTCTL,
    Action.STABILIZED: NavigationState.STAB,
    Action.HOLD: NavigationState.AUTO_LOITER,
    Action.RETURN: NavigationState.AUTO_RTL,
    Action.LAND: NavigationState.AUTO_LAND,
    Action.DESCEND: NavigationState.AUTO_LAND,
}

PILOTED: Final = frozenset(
    {
        NavigationState.MANUAL,
        NavigationState.STAB,
        NavigationState.ACRO,
        NavigationState.ALTCTL,
        NavigationState.POSCTL,
    }
)
"""Modes in which the pilot controls the vehicle by sticks."""

DEFERRED: Final = frozenset({Action.RETURN, Action.LAND})
"""Actions that wait COM_FAIL_ACT_T for the operator, unless the cause is urgent."""

LINK_ACTIONS: Final[Mapping[int, Action]] = {
    0: Action.NONE,
    1: Action.HOLD,
    2: Action.RETURN,
    3: Action.LAND,
    4: Action.LAND,
    5: Action.TERMINATE,
    6: Action.DISARM,
}
"""NAV_DLL_ACT and NAV_RCL_ACT; 4 has no meaning in PX4: the vehicle lands."""

OFFBOARD_ACTIONS: Final[Mapping[int, Action]] = {
    0: Action.POSITION,
    1: Action.ALTITUDE,
    2: Action.STABILIZED,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
    6: Action.TERMINATE,
    7: Action.DISARM,
}
"""COM_OBL_RC_ACT."""

MOTOR_ACTIONS: Final[Mapping[int, Action]] = {
    0: Action.WARN,
    1: Action.HOLD,
    2: Action.LAND,
    3: Action.RETURN,
    4: Action.TERMINATE,
}
"""COM_ACT_FAIL_ACT."""

FENCE_ACTIONS: Final[Mapping[int, Action]] = {
    FenceAction.NONE: Action.NONE,
    FenceAction.WARN: Action.WARN,
    FenceAction.HOLD: Action.HOLD,
    FenceAction.RETURN: Action.RETURN,
    FenceAction.TERMINATE: Action.TERMINATE,
    FenceAction.LAND: Action.LAND,
}
"""GF_ACTION; COM_WIND_MAX_ACT has the same numbers."""


def strength_of(mode: NavigationState) -> Action:
    """Action that a mode already is; a hold may still fly to a place and counts as none."""
    if mode in PILOTED or mode is NavigationState.AUTO_LOITER:
        return Action.NONE
    return max(
        (action for action, its in MODE_OF.items() if its is mode and action is not Action.DESCEND),
        default=Action.NONE,
    )
