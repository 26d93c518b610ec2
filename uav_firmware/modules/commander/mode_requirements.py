"""What each mode needs, as one table. Modes that are not in it cannot be chosen.

The manual modes need a stick input and OFFBOARD a stream of set-points; neither exists here
yet, so asking for them is refused.
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final

from uav_firmware.modules.commander import health_checks
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.status import NavigationState


class Need(Enum):
    """One thing that a mode needs."""

    ATTITUDE = auto()
    ALTITUDE = auto()
    POSITION = auto()
    HOME = auto()
    MISSION = auto()


_FLY: Final = frozenset({Need.ATTITUDE, Need.ALTITUDE, Need.POSITION})

REQUIREMENTS: Final[Mapping[NavigationState, frozenset[Need]]] = {
    NavigationState.AUTO_LOITER: _FLY,
    NavigationState.AUTO_TAKEOFF: _FLY | {Need.HOME},
    NavigationState.AUTO_MISSION: _FLY | {Need.HOME, Need.MISSION},
    NavigationState.AUTO_RTL: _FLY | {Need.HOME},
    NavigationState.AUTO_LAND: frozenset({Need.ATTITUDE}),
    NavigationState.ORBIT: _FLY | {Need.HOME},
}

STARTABLE: Final = frozenset(
    {
        NavigationState.AUTO_LOITER,
        NavigationState.AUTO_TAKEOFF,
        NavigationState.AUTO_MISSION,
    }
)
"""Modes in which the vehicle may be armed."""

AIRBORNE_ONLY: Final = frozenset(
    {
        NavigationState.AUTO_RTL,
        NavigationState.AUTO_LAND,
        NavigationState.ORBIT,
    }
)
"""Modes that can only be entered in the air."""

ENDING_IN_HOLD: Final = frozenset({NavigationState.AUTO_TAKEOFF, NavigationState.ORBIT})
"""Modes that give way to AUTO_LOITER when their work is done."""


def missing(state: NavigationState, view: VehicleView) -> str | None:
    """Why a mode of the table cannot be flown now; None when it can."""
    needs = REQUIREMENTS[state]
    if Need.ATTITUDE in needs and not view.aligned:
        return "Attitude and heading not yet estimated"
    if Need.ALTITUDE in needs and (view.position is None or not view.position.altitude_valid):
        return "Altitude not estimated"
    if Need.POSITION in needs and not view.position_valid:
        return "Position not estimated"
    if Need.HOME in needs and view.home is None:
        return "Home position not set"
    return health_checks.mission_ready(view) if Need.MISSION in needs else None
