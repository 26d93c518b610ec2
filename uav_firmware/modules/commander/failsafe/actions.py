"""What failsafes do, from nothing to the motors' stop, and the mode that each of it is."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from uav_firmware.msg.geofence import FenceAction
from uav_firmware.msg.status import NavigationState


class Action(IntEnum):
    """What a failsafe does; a greater one is worse."""

    NONE = 0
    WARN = 1
    POSITION = 2  # The pilot goes on in position mode
    ALTITUDE = 3  # The pilot goes on in altitude mode
    STABILIZED = 4  # The pilot goes on in stabilized mode
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8  # Land by what is left: at once, wherever it is
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
"""Modes flown by sticks."""

DEFERRED: Final = frozenset({Action.RETURN, Action.LAND})
"""Actions that leave the operator COM_FAIL_ACT_T to step in, unless the cause is urgent."""

LINK_ACTIONS: Final[Mapping[int, Action]] = {
    0: Action.NONE,
    1: Action.HOLD,
    2: Action.RETURN,
    3: Action.LAND,
    4: Action.LAND,
    5: Action.TERMINATE,
    6: Action.DISARM,
}
"""NAV_DLL_ACT and NAV_RCL_ACT; 4 is not given a meaning by PX4, so the vehicle lands."""

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
    """How strong a mode already is as an action; a hold may still be on its way to a place."""
    if mode in PILOTED or mode is NavigationState.AUTO_LOITER:
        return Action.NONE
    return max(
        (action for action, its in MODE_OF.items() if its is mode and action is not Action.DESCEND),
        default=Action.NONE,
    )
