"""Whether a mission can be flown, item by item, before it is accepted: pure.

The masks of honoured parameters are PX4's (`mavlink_command_params.hpp`); a parameter that is
set and not honoured is refused with its number rather than dropped. Unset is NaN or 0, for
NAV_DELAY's clock also -1.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final

from uav_firmware.lib.geo import distance_and_bearing
from uav_firmware.lib.stepwise import finished
from uav_firmware.modules.navigator.mission.item_rules import (
    PLAN_RULES,
    ROI_LOCATION,
    RULES,
    Check,
    name_of,
    reject,
)
from uav_firmware.modules.navigator.mission.route import (
    PAYLOAD,
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
    PlanReview,
)
from uav_firmware.msg.status import HomePosition

LOWEST_TAKEOFF_M = 1.0  # [m] above home; lower would end inside the take-off's own ramp
HIGHEST_M = 5000.0  # [m] above home
DEEPEST_M = 100.0  # [m] below home, where a hillside falls away
FARTHEST_M = 10_000.0  # [m] from home; beyond it a position is a mistake, such as 0, 0

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
    **dict.fromkeys(PAYLOAD, frozenset(range(1, 8))),  # Judged by what payload itself applies
}


def check(
    items: Sequence[MissionItem], home: HomePosition | None, params: NavigatorParams
) -> MissionRejection | None:
    """First reason why the items cannot be flown, or None.

    Without a home, what depends on its place is left out; the navigator checks again when
    there is one.
    """
    return finished(review(items, home, params))


def review(
    items: Sequence[MissionItem], home: HomePosition | None, params: NavigatorParams
) -> PlanReview:
    """Judge as `check` does, item by item."""
    legs = _Legs(home, params)
    for index, item in enumerate(items):
        if item.seq != index:
            return MissionRejection(
                index, MissionResult.INVALID_SEQUENCE, f"item {index}: numbered {item.seq}"
            )
        for one in (*_CHECKS, *_PLAN_CHECKS):
            rejection = one(item, items, home, params)
            if rejection is not None:
                return rejection
        rejection = legs.fault_of(item)
        if rejection is not None:
            return rejection
        yield 1
    return None


def check_item(
    item: MissionItem, home: HomePosition | None, params: NavigatorParams
) -> MissionRejection | None:
    """First reason why an item could be flown in no mission, or None."""
    return next(
        (fault for one in _CHECKS if (fault := one(item, (), home, params)) is not None), None
    )


def _parameters(item: MissionItem) -> tuple[float, ...]:
    return (item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z)


def _known(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command not in _HONOURED:
        return MissionRejection(
            item.seq, MissionResult.UNSUPPORTED, f"{name_of(item)}: cannot be flown"
        )
    frames = _FRAMES_GLOBAL if _carries_place(item) else _FRAMES_NO_POSITION
    if item.frame not in frames:
        return MissionRejection(
            item.seq,
            MissionResult.UNSUPPORTED_FRAME,
            f"{name_of(item)}: frame {item.frame} is not supported",
        )
    return None


def _honoured(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    honoured = _HONOURED[item.command]
    for number, value in enumerate(_parameters(item), start=1):
        if math.isinf(value):
            return reject(item, number, "is infinite")
        clock = item.command == MissionCommand.NAV_DELAY and number <= 4 and value == -1.0
        if number not in honoured and not unset(value) and not clock:
            return reject(item, number, f"is {value:g} but has no effect and must be unset")
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
    _params: object,
) -> MissionRejection | None:
    if not _carries_place(item):
        return None
    if item.command in {MissionCommand.NAV_LAND, MissionCommand.NAV_TAKEOFF} and (
        unset(item.x) and unset(item.y)
    ):
        return None
    for number, value, limit in ((5, item.x, 90.0), (6, item.y, 180.0)):
        if not abs(value) <= limit:
            return reject(item, number, f"is {value:g}, not within {limit:g} degrees")
    if home is None:
        return None
    distance, _ = distance_and_bearing(home.latitude_deg, home.longitude_deg, item.x, item.y)
    if not distance <= FARTHEST_M:
        return reject(item, 5, f"lies {distance / 1000.0:.0f} km from home")
    return None


class _Legs:
    """Distances from home to the first position and from each position to the next."""

    def __init__(self, home: HomePosition | None, params: NavigatorParams) -> None:
        self._before = None if home is None else (home.latitude_deg, home.longitude_deg)
        self._limit, self._name = params.farthest_first_position, "MIS_DIST_1WP"
        self._params = params

    def fault_of(self, item: MissionItem) -> MissionRejection | None:
        """Why an item lies too far from the position before it, or None."""
        if item.command not in POSITIONAL or (unset(item.x) and unset(item.y)):
            return None
        before, limit, name = self._before, self._limit, self._name
        self._before = (item.x, item.y)
        self._limit, self._name = self._params.longest_leg, "MIS_DIST_WPS"
        if before is None or limit <= 0.0:
            return None
        distance, _ = distance_and_bearing(*before, item.x, item.y)
        if distance <= limit:
            return None
        origin = "home" if name == "MIS_DIST_1WP" else "the position before it"
        return reject(item, 5, f"lies {distance:.0f} m from {origin}, beyond {name}")


def _altitude(
    item: MissionItem,
    _items: Sequence[MissionItem],
    home: HomePosition | None,
    _params: object,
) -> MissionRejection | None:
    if item.command not in POSITIONAL:
        return None
    if math.isnan(item.z):
        landing = item.command == MissionCommand.NAV_LAND
        return None if landing else reject(item, 7, "holds no altitude")
    if item.frame == 0 and home is None:
        return None
    base = home.altitude_amsl_m if home is not None else 0.0
    height = altitude_amsl(item, base) - base
    taking_off = item.command == MissionCommand.NAV_TAKEOFF
    lowest = LOWEST_TAKEOFF_M if taking_off else -DEEPEST_M
    if not lowest <= height <= HIGHEST_M:
        return reject(
            item, 7, f"is {height:g} m above home, not within {lowest:g} to {HIGHEST_M:g}"
        )
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
                f"{name_of(item)}: must come before all other positions",
            )
    return None


_CHECKS: Final[tuple[Check, ...]] = (
    _known,
    _honoured,
    _place,
    _altitude,
    *RULES,
)
_PLAN_CHECKS: Final[tuple[Check, ...]] = (*PLAN_RULES, _takeoff_first)
