"""What each mode needs, and which module controls in it: two tables, pure.

As PX4's `mode_requirements` and `control_mode`. A mode without requirements cannot be chosen.
"""

from collections.abc import Callable, Mapping
from enum import Enum, auto
from typing import Final

from uav_firmware.modules.commander import health_checks
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.control_mode import ControlLevel, ControlSource, OffboardSetpoint
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import NavigationState


class Need(Enum):
    """One requirement of a mode."""

    ATTITUDE = auto()
    ALTITUDE = auto()
    POSITION = auto()
    FIX = auto()  # A position that is measured, not by dead reckoning: the mode flies to a place.
    # Hold and landing need one only while they fly to a place: see `missing_for_place`.
    HOME = auto()
    MISSION = auto()
    STICKS = auto()  # MANUAL_CONTROL is received
    SETPOINTS = auto()  # Setpoints are streamed; by their kind also POSITION and ALTITUDE


_STAY: Final = frozenset({Need.ATTITUDE, Need.ALTITUDE, Need.POSITION})
_FLY: Final = _STAY | {Need.FIX}

REQUIREMENTS: Final[Mapping[NavigationState, frozenset[Need]]] = {
    NavigationState.AUTO_LOITER: _STAY,
    NavigationState.AUTO_TAKEOFF: _FLY | {Need.HOME},
    NavigationState.AUTO_MISSION: _FLY | {Need.HOME, Need.MISSION},
    NavigationState.AUTO_RTL: _FLY | {Need.HOME},
    NavigationState.AUTO_LAND: frozenset({Need.ATTITUDE}),
    NavigationState.ORBIT: _FLY | {Need.HOME},
    NavigationState.AUTO_FOLLOW_TARGET: _FLY | {Need.HOME},
    NavigationState.POSCTL: _STAY | {Need.STICKS},
    NavigationState.ALTCTL: frozenset({Need.ATTITUDE, Need.ALTITUDE, Need.STICKS}),
    NavigationState.STAB: frozenset({Need.ATTITUDE, Need.STICKS}),
    NavigationState.MANUAL: frozenset({Need.ATTITUDE, Need.STICKS}),
    NavigationState.ACRO: frozenset({Need.ATTITUDE, Need.STICKS}),
    NavigationState.OFFBOARD: frozenset({Need.ATTITUDE, Need.SETPOINTS}),
}

STARTABLE: Final = frozenset(
    {
        NavigationState.AUTO_LOITER,
        NavigationState.AUTO_TAKEOFF,
        NavigationState.AUTO_MISSION,
        NavigationState.POSCTL,
        NavigationState.ALTCTL,
        NavigationState.STAB,
        NavigationState.MANUAL,
        NavigationState.ACRO,
        NavigationState.OFFBOARD,
    }
)
"""Modes in which the vehicle may be armed."""

AIRBORNE_ONLY: Final = frozenset(
    {
        NavigationState.AUTO_RTL,
        NavigationState.AUTO_LAND,
        NavigationState.ORBIT,
        NavigationState.AUTO_FOLLOW_TARGET,
    }
)
"""Modes that are flown in the air only; before arming they can be chosen but not armed in."""

ENDING_IN_HOLD: Final = frozenset({NavigationState.AUTO_TAKEOFF, NavigationState.ORBIT})
"""Modes that change to AUTO_LOITER when they are finished."""


_ALL: Final = tuple(Need)


def needs_of(state: NavigationState, view: VehicleView) -> frozenset[Need]:
    """Requirements of a mode; of OFFBOARD, by the streamed setpoint. Empty if not available."""
    needs = REQUIREMENTS.get(state, frozenset())
    if Need.SETPOINTS in needs and isinstance(view.offboard, TrajectorySetpoint):
        return needs | _FLY
    return needs


def missing(state: NavigationState, view: VehicleView) -> str | None:
    """Why a mode of the table cannot be flown now; None when it can."""
    needs = needs_of(state, view)
    for need in _ALL:
        if need in needs and (reason := _CHECKS[need](view)) is not None:
            return reason
    return None


def missing_for_place(view: VehicleView) -> str | None:
    """Why the vehicle cannot fly to a place now, in any mode; None when it can."""
    return _position(view) or _fix(view)


def _attitude(view: VehicleView) -> str | None:
    return None if view.aligned else "Attitude and heading not yet estimated"


def _altitude(view: VehicleView) -> str | None:
    known = view.position is not None and view.position.altitude_valid
    return None if known else "Altitude not estimated"


def _position(view: VehicleView) -> str | None:
    return None if view.position_valid else "Position not estimated"


def _fix(view: VehicleView) -> str | None:
    if not health_checks.without_fix(view):
        return None
    return "Position by dead reckoning only: no GPS fix is used"


def _home(view: VehicleView) -> str | None:
    return None if view.home is not None else "Home position not set"


def _sticks(view: VehicleView) -> str | None:
    return None if view.sticks_fresh else "No manual control input"


def _setpoints(view: VehicleView) -> str | None:
    return None if view.offboard_fresh else "No stream of offboard setpoints"


_CHECKS: Final[Mapping[Need, Callable[[VehicleView], str | None]]] = {
    Need.ATTITUDE: _attitude,
    Need.ALTITUDE: _altitude,
    Need.POSITION: _position,
    Need.FIX: _fix,
    Need.HOME: _home,
    Need.MISSION: health_checks.mission_ready,
    Need.STICKS: _sticks,
    Need.SETPOINTS: _setpoints,
}


_PILOTED_LEVELS: Final[Mapping[NavigationState, ControlLevel]] = {
    NavigationState.MANUAL: ControlLevel.ATTITUDE,
    NavigationState.STAB: ControlLevel.ATTITUDE,
    NavigationState.ACRO: ControlLevel.RATES,
    NavigationState.ALTCTL: ControlLevel.POSITION,
    NavigationState.POSCTL: ControlLevel.POSITION,
}
"""The outermost loop that sticks command, of each mode of `PILOTED`."""


def level_of(setpoint: OffboardSetpoint | None) -> ControlLevel:
    """The outermost loop that a streamed setpoint commands."""
    if isinstance(setpoint, VehicleAttitudeSetpoint):
        return ControlLevel.ATTITUDE
    if isinstance(setpoint, VehicleRatesSetpoint):
        return ControlLevel.RATES
    return ControlLevel.POSITION


def control_of(
    mode: NavigationState, setpoint: OffboardSetpoint | None
) -> tuple[ControlSource, ControlLevel]:
    """Module that controls in a mode, and the outermost loop that is closed."""
    if mode in _PILOTED_LEVELS:
        return ControlSource.MANUAL, _PILOTED_LEVELS[mode]
    if mode is NavigationState.OFFBOARD:
        return ControlSource.OFFBOARD, level_of(setpoint)
    return ControlSource.NAVIGATOR, ControlLevel.POSITION
