"""Whether a mission can be flown, item by item, before it is accepted: pure.

The masks of honoured parameters are PX4's (`mavlink_command_params.hpp`); a parameter that is
set and not honoured is refused with its number rather than dropped. Unset is NaN or 0, for
NAV_DELAY's clock also -1.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from uav_firmware.lib.geo import distance_and_bearing
from uav_firmware.modules.navigator.mission_route import (
    HOVERING,
    POSITIONAL,
    altitude_amsl,
    unset,
)
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.msg.mission import (
    MissionCommand,
    MissionItem,
    MissionRejection,
    MissionResult,
)
from uav_firmware.msg.status import HomePosition

LOWEST_TAKEOFF_M = 1.0  # [m] above home; lower would end inside the take-off's own ramp
HIGHEST_M = 5000.0  # [m] above home

_FRAMES_GLOBAL = frozenset({0, 3})
_FRAMES_NO_POSITION = frozenset({0, 2, 3})
_PARAMETER: Final = (
    MissionResult.INVALID_PARAM1,
    MissionResult.INVALID_PARAM2,
    MissionResult.INVALID_PARAM3,
    MissionResult.INVALID_PARAM4,
    MissionResult.INVALID_PARAM5_X,
    MissionResult.INVALID_PARAM6_Y,
    MissionResult.INVALID_PARAM7,
)
_HONOURED: Final[Mapping[int, frozenset[int]]] = {
    MissionCommand.NAV_WAYPOINT: frozenset({1, 2, 4, 5, 6, 7}),
    MissionCommand.NAV_LOITER_UNLIM: frozenset({2, 3, 4, 5, 6, 7}),
    MissionCommand.NAV_LOITER_TIME: frozenset({1, 2, 3, 4, 5, 6, 7}),
    MissionCommand.NAV_RETURN_TO_LAUNCH: frozenset(),
    MissionCommand.NAV_LAND: frozenset({1, 2, 4, 5, 6, 7}),
    MissionCommand.NAV_TAKEOFF: frozenset({1, 4, 5, 6, 7}),
    MissionCommand.NAV_DELAY: frozenset({1}),
    MissionCommand.DO_JUMP: frozenset({1, 2}),
    MissionCommand.DO_CHANGE_SPEED: frozenset({1, 2, 3}),
}

Check = Callable[
    [MissionItem, Sequence[MissionItem], HomePosition | None, NavigatorParams],
    MissionRejection | None,
]


def check(
    items: Sequence[MissionItem], home: HomePosition | None, params: NavigatorParams
) -> MissionRejection | None:
    """First reason why the items cannot be flown, or None.

    Without a home, what depends on its place is left out; the navigator checks again when
    there is one.
    """
    for index, item in enumerate(items):
        if item.seq != index:
            return MissionRejection(
                index, MissionResult.INVALID_SEQUENCE, f"item {index}: numbered {item.seq}"
            )
        for one in _CHECKS:
            rejection = one(item, items, home, params)
            if rejection is not None:
                return rejection
    return None


def _name(item: MissionItem) -> str:
    try:
        return f"item {item.seq} ({MissionCommand(item.command).name})"
    except ValueError:
        return f"item {item.seq} (command {item.command})"


def _reject(item: MissionItem, parameter: int, reason: str) -> MissionRejection:
    return MissionRejection(
        item.seq, _PARAMETER[parameter - 1], f"{_name(item)}: parameter {parameter} {reason}"
    )


def _parameters(item: MissionItem) -> tuple[float, ...]:
    return (item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z)


def _known(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command not in _HONOURED:
        return MissionRejection(
            item.seq, MissionResult.UNSUPPORTED, f"{_name(item)}: cannot be flown"
        )
    frames = _FRAMES_GLOBAL if item.command in POSITIONAL else _FRAMES_NO_POSITION
    if item.frame not in frames:
        return MissionRejection(
            item.seq,
            MissionResult.UNSUPPORTED_FRAME,
            f"{_name(item)}: frame {item.frame} is not supported",
        )
    return None


def _honoured(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    honoured = _HONOURED[item.command]
    for number, value in enumerate(_parameters(item), start=1):
        if math.isinf(value):
            return _reject(item, number, "is infinite")
        clock = item.command == MissionCommand.NAV_DELAY and number <= 4 and value == -1.0
        if number not in honoured and not unset(value) and not clock:
            return _reject(item, number, f"is {value:g} but has no effect and must be unset")
    return None


def _place(
    item: MissionItem,
    _items: Sequence[MissionItem],
    home: HomePosition | None,
    params: NavigatorParams,
) -> MissionRejection | None:
    if item.command not in POSITIONAL:
        return None
    if item.command not in HOVERING and unset(item.x) and unset(item.y):
        return None
    for number, value, limit in ((5, item.x, 90.0), (6, item.y, 180.0)):
        if not abs(value) <= limit:
            return _reject(item, number, f"is {value:g}, not within {limit:g} degrees")
    if home is None or params.farthest_waypoint <= 0.0:
        return None
    distance, _ = distance_and_bearing(home.latitude_deg, home.longitude_deg, item.x, item.y)
    if not distance <= params.farthest_waypoint:
        return _reject(item, 5, f"lies {distance:.0f} m from home, beyond MIS_DIST_1WP")
    return None


def _altitude(
    item: MissionItem,
    _items: Sequence[MissionItem],
    home: HomePosition | None,
    _params: object,
) -> MissionRejection | None:
    if item.command not in POSITIONAL:
        return None
    landing = item.command == MissionCommand.NAV_LAND
    if math.isnan(item.z):
        return None if landing else _reject(item, 7, "holds no altitude")
    if item.frame == 0 and home is None:
        return None
    base = home.altitude_amsl_m if home is not None else 0.0
    height = altitude_amsl(item, base) - base
    lowest = -HIGHEST_M if landing else 0.0
    if item.command == MissionCommand.NAV_TAKEOFF:
        lowest = LOWEST_TAKEOFF_M
    if not lowest <= height <= HIGHEST_M:
        return _reject(
            item, 7, f"is {height:g} m above home, not within {lowest:g} to {HIGHEST_M:g}"
        )
    return None


def _hold_and_radius(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    timed = {
        MissionCommand.NAV_WAYPOINT,
        MissionCommand.NAV_LOITER_TIME,
        MissionCommand.NAV_LAND,
    }
    if item.command in timed and item.param1 < 0.0:
        return _reject(item, 1, "is negative")
    if item.command == MissionCommand.NAV_DELAY and not item.param1 >= 0.0:
        return _reject(item, 1, "must be a delay in seconds; a time of day is not supported")
    if item.command == MissionCommand.NAV_WAYPOINT and item.param2 < 0.0:
        return _reject(item, 2, "is negative")
    if item.command == MissionCommand.NAV_LAND and item.param2 not in {0.0, 1.0}:
        return None if math.isnan(item.param2) else _reject(item, 2, "asks for a landing target")
    return None


def _speed(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
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
    item: MissionItem, items: Sequence[MissionItem], _home: object, _params: object
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


def _takeoff_first(
    item: MissionItem, items: Sequence[MissionItem], _home: object, _params: object
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
                f"{_name(item)}: must come before all other positions",
            )
    return None


_CHECKS: Final[tuple[Check, ...]] = (
    _known,
    _honoured,
    _place,
    _altitude,
    _hold_and_radius,
    _speed,
    _jump,
    _takeoff_first,
)
