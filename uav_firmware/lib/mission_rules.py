"""Which missions this vehicle can fly: rules on single items and on their order, pure.

As PX4's mission manager (rules on an item) and mission feasibility checker (rules on the
mission). mavlink applies the rules on an item to each one that it receives, and all rules to a
mission stored by a former run; the navigator applies all of them to an upload, and again when
home changes. Distances to the geofence are the navigator's alone.

The masks of honoured parameters are PX4's (`mavlink_command_params.hpp`); a parameter that is
set and not honoured is refused with its number rather than dropped. Unset is NaN or 0, for
NAV_DELAY's clock also -1.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from uav_firmware.lib.geo import distance_and_bearing
from uav_firmware.lib.payload_rules import GIMBAL_DEVICE, fault_of, unset
from uav_firmware.lib.stepwise import finished
from uav_firmware.msg.mission import (
    MissionCommand,
    MissionItem,
    MissionRejection,
    MissionResult,
    PlanReview,
)
from uav_firmware.msg.status import HomePosition

HOVERING: Final = frozenset(
    {
        MissionCommand.NAV_WAYPOINT,
        MissionCommand.NAV_LOITER_UNLIM,
        MissionCommand.NAV_LOITER_TIME,
        MissionCommand.NAV_SPLINE_WAYPOINT,
    }
)
POSITIONAL: Final = HOVERING | {
    MissionCommand.NAV_LAND,
    MissionCommand.NAV_TAKEOFF,
    MissionCommand.NAV_LOITER_TURNS,
    MissionCommand.NAV_LOITER_TO_ALT,
}
PAYLOAD: Final = frozenset(
    {
        MissionCommand.DO_DIGICAM_CONTROL,
        MissionCommand.DO_MOUNT_CONFIGURE,
        MissionCommand.DO_MOUNT_CONTROL,
        MissionCommand.DO_SET_CAM_TRIGG_DIST,
        MissionCommand.SET_CAMERA_MODE,
        MissionCommand.DO_GIMBAL_MANAGER_PITCHYAW,
        MissionCommand.DO_GIMBAL_MANAGER_CONFIGURE,
        MissionCommand.IMAGE_START_CAPTURE,
        MissionCommand.IMAGE_STOP_CAPTURE,
        MissionCommand.VIDEO_START_CAPTURE,
        MissionCommand.VIDEO_STOP_CAPTURE,
    }
)
"""Items that camera and gimbal carry out."""

LOWEST_TAKEOFF_M: Final = 1.0  # [m] above home; lower would end inside the take-off's own ramp
HIGHEST_M: Final = 5000.0  # [m] above home
DEEPEST_M: Final = 100.0  # [m] below home, where a hillside falls away
FARTHEST_M: Final = 10_000.0  # [m] from home; beyond it a position is a mistake, such as 0, 0

_FRAMES_GLOBAL = frozenset({0, 3})
_FRAMES_NO_POSITION = frozenset({0, 2, 3})
_HONOURED: Final[Mapping[int, frozenset[int]]] = {
    MissionCommand.NAV_WAYPOINT: frozenset({1, 2, 4, 5, 6, 7}),
    MissionCommand.NAV_LOITER_UNLIM: frozenset({2, 3, 4, 5, 6, 7}),
    MissionCommand.NAV_LOITER_TIME: frozenset({1, 2, 3, 4, 5, 6, 7}),
    MissionCommand.NAV_RETURN_TO_LAUNCH: frozenset({5, 6, 7}),  # Ignored: Mission Planner leaves
    MissionCommand.NAV_LAND: frozenset({1, 2, 4, 5, 6, 7}),
    MissionCommand.NAV_TAKEOFF: frozenset({1, 4, 5, 6, 7}),
    MissionCommand.NAV_DELAY: frozenset({1}),
    MissionCommand.DO_JUMP: frozenset({1, 2}),
    MissionCommand.DO_CHANGE_SPEED: frozenset({1, 2, 3}),
    MissionCommand.NAV_LOITER_TURNS: frozenset({1, 3, 4, 5, 6, 7}),
    MissionCommand.NAV_LOITER_TO_ALT: frozenset({1, 2, 4, 5, 6, 7}),
    MissionCommand.NAV_SPLINE_WAYPOINT: frozenset({1, 5, 6, 7}),
    MissionCommand.CONDITION_DELAY: frozenset({1}),
    MissionCommand.CONDITION_DISTANCE: frozenset({1}),
    MissionCommand.CONDITION_YAW: frozenset({1, 2, 3, 4}),
    MissionCommand.DO_SET_HOME: frozenset({1, 4, 5, 6, 7}),
    MissionCommand.DO_LAND_START: frozenset({5, 6, 7}),
    MissionCommand.DO_FENCE_ENABLE: frozenset({1}),
    MissionCommand.DO_SET_ROI: frozenset({1, 5, 6, 7}),
    MissionCommand.DO_SET_ROI_LOCATION: frozenset({1, 5, 6, 7}),
    MissionCommand.DO_SET_ROI_NONE: frozenset({1}),
    **dict.fromkeys(PAYLOAD, frozenset(range(1, 8))),  # Checked by the rules of payload
}

ROI_LOCATION: Final = 3.0  # MAV_ROI_LOCATION

_PARAMETER: Final = (
    MissionResult.INVALID_PARAM1,
    MissionResult.INVALID_PARAM2,
    MissionResult.INVALID_PARAM3,
    MissionResult.INVALID_PARAM4,
    MissionResult.INVALID_PARAM5_X,
    MissionResult.INVALID_PARAM6_Y,
    MissionResult.INVALID_PARAM7,
)
_RELATIVE_ALTITUDE: Final = 3  # MAV_FRAME_GLOBAL_RELATIVE_ALT

_Rule = Callable[[MissionItem, Sequence[MissionItem], HomePosition | None], MissionRejection | None]


class DistanceLimits(NamedTuple):
    """Longest distances between positions of a mission; 0 or less for no limit."""

    first_position_m: float = 0.0  # [m] From home to the first one, MIS_DIST_1WP
    leg_m: float = 0.0  # [m] From each one to the next, MIS_DIST_WPS


def check(
    items: Sequence[MissionItem], home: HomePosition | None, limits: DistanceLimits
) -> MissionRejection | None:
    """First reason why the items cannot be flown, or None.

    Without a home the rules that depend on it are left out; the navigator checks again when
    there is one.
    """
    return finished(review(items, home, limits))


def review(
    items: Sequence[MissionItem], home: HomePosition | None, limits: DistanceLimits
) -> PlanReview:
    """Do the work of `check` item by item."""
    legs = _Legs(home, limits)
    for index, item in enumerate(items):
        if item.seq != index:
            return MissionRejection(
                index, MissionResult.INVALID_SEQUENCE, f"item {index}: numbered {item.seq}"
            )
        for rule in (*_ITEM_RULES, *_MISSION_RULES):
            rejection = rule(item, items, home)
            if rejection is not None:
                return rejection
        rejection = legs.fault_of(item)
        if rejection is not None:
            return rejection
        yield 1
    return None


def check_item(item: MissionItem, home: HomePosition | None) -> MissionRejection | None:
    """First reason why an item can be part of no mission, or None."""
    return next(
        (fault for rule in _ITEM_RULES if (fault := rule(item, (), home)) is not None), None
    )


def altitude_amsl(item: MissionItem, home_altitude_amsl_m: float) -> float:
    """Altitude of an item above mean sea level [m]."""
    return item.z + (home_altitude_amsl_m if item.frame == _RELATIVE_ALTITUDE else 0.0)


def _name_of(item: MissionItem) -> str:
    """Number and command of an item, for texts."""
    try:
        return f"item {item.seq} ({MissionCommand(item.command).name})"
    except ValueError:
        return f"item {item.seq} (command {item.command})"


def _reject(item: MissionItem, parameter: int, reason: str) -> MissionRejection:
    """Refuse a parameter of an item, counted from 1."""
    return MissionRejection(
        item.seq, _PARAMETER[parameter - 1], f"{_name_of(item)}: parameter {parameter} {reason}"
    )


def _parameters(item: MissionItem) -> tuple[float, ...]:
    return (item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z)


def _known(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    if item.command not in _HONOURED:
        return MissionRejection(
            item.seq, MissionResult.UNSUPPORTED, f"{_name_of(item)}: cannot be flown"
        )
    frames = _FRAMES_GLOBAL if _carries_place(item) else _FRAMES_NO_POSITION
    if item.frame not in frames:
        return MissionRejection(
            item.seq,
            MissionResult.UNSUPPORTED_FRAME,
            f"{_name_of(item)}: frame {item.frame} is not supported",
        )
    return None


def _honoured(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    honoured = _HONOURED[item.command]
    for number, value in enumerate(_parameters(item), start=1):
        if math.isinf(value):
            return _reject(item, number, "is infinite")
        clock = item.command == MissionCommand.NAV_DELAY and number <= 4 and value == -1.0
        if number not in honoured and not unset(value) and not clock:
            return _reject(item, number, f"is {value:g} but has no effect and must be unset")
    return None


def _carries_place(item: MissionItem) -> bool:
    """Whether parameters 5 to 7 are a place."""
    if item.command == MissionCommand.DO_SET_ROI:
        return item.param1 == ROI_LOCATION
    if item.command == MissionCommand.DO_SET_HOME:
        return item.param1 == 0.0
    return item.command in POSITIONAL or item.command == MissionCommand.DO_SET_ROI_LOCATION


def _place(
    item: MissionItem,
    _items: Sequence[MissionItem],
    home: HomePosition | None,
) -> MissionRejection | None:
    if not _carries_place(item):
        return None
    if item.command in {MissionCommand.NAV_LAND, MissionCommand.NAV_TAKEOFF} and (
        unset(item.x) and unset(item.y)
    ):
        return None
    for number, value, limit in ((5, item.x, 90.0), (6, item.y, 180.0)):
        if not abs(value) <= limit:
            return _reject(item, number, f"is {value:g}, not within {limit:g} degrees")
    if home is None:
        return None
    distance, _ = distance_and_bearing(home.latitude_deg, home.longitude_deg, item.x, item.y)
    if not distance <= FARTHEST_M:
        return _reject(item, 5, f"lies {distance / 1000.0:.0f} km from home")
    return None


class _Legs:
    """Checks the distances between the positions of a mission, in its order."""

    def __init__(self, home: HomePosition | None, limits: DistanceLimits) -> None:
        self._before = None if home is None else (home.latitude_deg, home.longitude_deg)
        self._limit, self._name = limits.first_position_m, "MIS_DIST_1WP"
        self._leg_limit = limits.leg_m

    def fault_of(self, item: MissionItem) -> MissionRejection | None:
        """Why an item lies too far from the position before it, or None."""
        if item.command not in POSITIONAL or (unset(item.x) and unset(item.y)):
            return None
        before, limit, name = self._before, self._limit, self._name
        self._before = (item.x, item.y)
        self._limit, self._name = self._leg_limit, "MIS_DIST_WPS"
        if before is None or limit <= 0.0:
            return None
        distance, _ = distance_and_bearing(*before, item.x, item.y)
        if distance <= limit:
            return None
        origin = "home" if name == "MIS_DIST_1WP" else "the position before it"
        return _reject(item, 5, f"lies {distance:.0f} m from {origin}, beyond {name}")


def _altitude(
    item: MissionItem,
    _items: Sequence[MissionItem],
    home: HomePosition | None,
) -> MissionRejection | None:
    if item.command not in POSITIONAL:
        return None
    if math.isnan(item.z):
        landing = item.command == MissionCommand.NAV_LAND
        return None if landing else _reject(item, 7, "holds no altitude")
    if item.frame == 0 and home is None:
        return None
    base = home.altitude_amsl_m if home is not None else 0.0
    height = altitude_amsl(item, base) - base
    taking_off = item.command == MissionCommand.NAV_TAKEOFF
    lowest = LOWEST_TAKEOFF_M if taking_off else -DEEPEST_M
    if not lowest <= height <= HIGHEST_M:
        return _reject(
            item, 7, f"is {height:g} m above home, not within {lowest:g} to {HIGHEST_M:g}"
        )
    return None


def _takeoff_first(
    item: MissionItem, items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    """A take-off stands first, or after a landing."""
    if item.command != MissionCommand.NAV_TAKEOFF:
        return None
    grounding = {MissionCommand.NAV_LAND, MissionCommand.NAV_RETURN_TO_LAUNCH}
    for before in reversed(items[: item.seq]):
        if before.command in grounding:
            return None
        if before.command in POSITIONAL:
            return MissionRejection(
                item.seq,
                MissionResult.INVALID,
                f"{_name_of(item)}: must come before all other positions",
            )
    return None


def _hold_and_radius(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    timed = {
        MissionCommand.NAV_WAYPOINT,
        MissionCommand.NAV_LOITER_TIME,
        MissionCommand.NAV_LAND,
    }
    if item.command in timed and item.param1 < 0.0:
        return _reject(item, 1, "is negative")
    if item.command == MissionCommand.NAV_LAND and item.param1 > HIGHEST_M:
        return _reject(item, 1, f"is {item.param1:g} m, above {HIGHEST_M:g}")
    if item.command == MissionCommand.NAV_DELAY and not item.param1 >= 0.0:
        return _reject(item, 1, "must be a delay in seconds; a time of day is not supported")
    if item.command == MissionCommand.NAV_WAYPOINT and item.param2 < 0.0:
        return _reject(item, 2, "is negative")
    if item.command == MissionCommand.NAV_LAND and item.param2 not in {0.0, 1.0}:
        return None if math.isnan(item.param2) else _reject(item, 2, "asks for a landing target")
    return None


def _circle(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    if item.command != MissionCommand.NAV_LOITER_TURNS:
        return None
    if not item.param1 > 0.0:
        return _reject(item, 1, f"is {item.param1:g}, no number of turns")
    if not unset(item.param3) and not 1.0 <= abs(item.param3) <= 1000.0:
        return _reject(item, 3, f"is a radius of {item.param3:g} m, not within 1 to 1000")
    return None


def _condition(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    waits = {MissionCommand.CONDITION_DELAY, MissionCommand.CONDITION_DISTANCE}
    if item.command in waits and not item.param1 >= 0.0:
        return _reject(item, 1, f"is {item.param1:g}, nothing to wait for")
    if item.command != MissionCommand.CONDITION_YAW:
        return None
    if not abs(item.param1) <= 360.0:
        return _reject(item, 1, f"is {item.param1:g}, no angle")
    if item.param2 < 0.0:
        return _reject(item, 2, "is negative")
    for number, value, allowed in (
        (3, item.param3, (-1.0, 0.0, 1.0)),
        (4, item.param4, (0.0, 1.0)),
    ):
        if not math.isnan(value) and value not in allowed:
            return _reject(item, number, f"is {value:g}")
    return None


def _home_and_region_of_interest(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    if item.command == MissionCommand.DO_SET_HOME and item.param1 not in {0.0, 1.0}:
        return _reject(item, 1, f"is {item.param1:g}, neither 0 nor 1")
    if item.command == MissionCommand.DO_SET_HOME and item.param1 == 0.0 and math.isnan(item.z):
        return _reject(item, 7, "holds no altitude")
    if item.command == MissionCommand.DO_SET_ROI and not (
        unset(item.param1) or item.param1 == ROI_LOCATION
    ):
        return _reject(item, 1, f"is {item.param1:g}: only 0 (none) and 3 (a place) are supported")
    return None


def _fence_enable(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    if item.command != MissionCommand.DO_FENCE_ENABLE or item.param1 in {0.0, 1.0}:
        return None
    if item.param1 == 2.0:
        return _reject(item, 1, "is 2, but the geofence has no floor to switch off")
    return _reject(item, 1, f"is {item.param1:g}, neither 0 nor 1")


def _payload(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    """What camera and gimbal can honour; a place to look at may name the one gimbal."""
    if item.command in {MissionCommand.DO_SET_ROI_LOCATION, MissionCommand.DO_SET_ROI_NONE}:
        known = unset(item.param1) or item.param1 == GIMBAL_DEVICE
        return None if known else _reject(item, 1, f"is {item.param1:g}, no gimbal")
    if item.command not in PAYLOAD:
        return None
    fault = fault_of(item.command, item[5:12])
    return None if fault is None else _reject(item, fault.parameter, fault.reason)


def _speed(
    item: MissionItem, _items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    if item.command != MissionCommand.DO_CHANGE_SPEED:
        return None
    if not math.isnan(item.param1) and item.param1 not in {0.0, 1.0, 2.0, 3.0}:
        return _reject(item, 1, f"is {item.param1:g}, no speed type")
    if not (item.param2 > 0.0 or item.param2 in {-1.0, -2.0}):
        return _reject(item, 2, f"is {item.param2:g}, no speed")
    if item.param3 > 0.0:
        return _reject(item, 3, "asks for a throttle, which a multirotor has not")
    return None


def _jump(
    item: MissionItem, items: Sequence[MissionItem], _home: object
) -> MissionRejection | None:
    if item.command != MissionCommand.DO_JUMP:
        return None
    if item.param1 not in range(len(items)):
        return _reject(item, 1, f"is {item.param1:g}, no item of this mission")
    if not item.param2 >= -1.0 or item.param2 != int(item.param2):
        return _reject(item, 2, f"is {item.param2:g}, no number of repetitions")
    between = items[int(item.param1) : item.seq]
    takes_time = any(other.command < MissionCommand.NAV_DELAY + 1 for other in between)
    if int(item.param1) <= item.seq and not takes_time:
        return _reject(item, 1, "jumps over nothing that is flown")
    return None


_ITEM_RULES: Final[tuple[_Rule, ...]] = (
    _known,
    _honoured,
    _place,
    _altitude,
    _hold_and_radius,
    _circle,
    _condition,
    _home_and_region_of_interest,
    _fence_enable,
    _payload,
    _speed,
)
"""Rules on an item by itself."""
_MISSION_RULES: Final[tuple[_Rule, ...]] = (_jump, _takeoff_first)
"""Rules on an item among the others."""
