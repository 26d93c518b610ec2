"""Rules that no single field can state: between fields, missions, fence and vehicles.

`check` is pure; it returns faults (the plan is refused) and warnings (it is flown).
"""

import math
import re
import unicodedata
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Final, NamedTuple

from afarcloud import flyable
from afarcloud.annex import annex_faults
from afarcloud.area import TooManyComparisonsError
from afarcloud.commands import (
    FLYING,
    Command,
    NavHotpoint,
)
from afarcloud.enumerations import CommandType, Profile
from afarcloud.faults import Fault
from afarcloud.fence_check import FenceCheck, altitude_name
from afarcloud.flyable import VehicleLimits
from afarcloud.geodesy import distance_m
from afarcloud.plan import Mission, Plan
from afarcloud.route import Spot, spot_of

_CONTROLS: Final = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Unicode's categories Cc, Zl, Zp and Cs, and its embeddings, overrides and isolates (UAX 9)."""
_BLANK_LETTERS: Final = frozenset("\u115f\u1160\u2800\u3164\uffa0\U0001d159")
"""Letters and symbols of Unicode that show nothing."""


class Verdict(NamedTuple):
    """Result of checking a plan against the rules."""

    faults: tuple[Fault, ...]
    warnings: tuple[Fault, ...]
    missing: tuple[Fault, ...] = ()  # Of the faults: what a draft may still lack


class FenceVerdict(NamedTuple):
    """Result of checking a plan against its geofence: expensive, and independent of vehicles."""

    outlines: tuple[Fault, ...]  # Of the geofence itself; with any of them nothing else is checked
    rally_points: tuple[Fault, ...]
    missions: tuple[tuple[Fault, ...], ...]  # In the plan's order
    warnings: tuple[Fault, ...] = ()  # Of areas beside the plan's own


def check_fence(plan: Plan) -> FenceVerdict:
    """Check a plan's geofence, and its missions and rally points against it."""
    fence = None if plan.geofence is None else FenceCheck(plan.geofence)
    outlines = () if fence is None else fence.outline_faults
    if fence is not None and not outlines:
        try:
            return _against_fence(plan, fence)
        except TooManyComparisonsError:
            outlines = (fence.too_many_comparisons,)
    faults = tuple(Fault(f"geofence.{one.field}", one.text) for one in outlines)
    return FenceVerdict(faults, (), ((),) * len(plan.missions))


def _against_fence(plan: Plan, fence: FenceCheck) -> FenceVerdict:
    return FenceVerdict(
        (),
        tuple(_rally_faults(plan, fence)),
        tuple(
            tuple(_fence_faults(mission, f"missions.{index}", fence))
            for index, mission in enumerate(plan.missions)
        ),
    )


def check(
    plan: Plan,
    vehicles: Mapping[int, VehicleLimits],
    now: datetime,
    fence: FenceVerdict | None = None,
) -> Verdict:
    """Hold a plan against the registered vehicles and the time of day.

    `fence` is the result of `check_fence` for this plan, if the caller has it already.
    """
    fence = check_fence(plan) if fence is None else fence
    faults = [*_plan_faults(plan, now), *fence.outlines, *fence.rally_points]
    warnings: list[Fault] = [*fence.warnings]
    missing: list[Fault] = []
    for index, mission in enumerate(plan.missions):
        path = f"missions.{index}"
        limits = vehicles.get(mission.vehicle_id)
        if limits is None:
            faults.append(
                Fault(f"{path}.vehicle_id", f"vehicle {mission.vehicle_id} is not registered")
            )
        else:
            faults += _limit_faults(mission, path, limits)
            faults += flyable.reach_faults(mission, path, limits)
        faults += _mission_faults(mission, path)
        if plan.profile == Profile.FIELD:
            missing += _takeoff_first(mission, path)
        faults += flyable.faults(mission, path)
        faults += fence.missions[index]
        warnings += _warnings(mission, path, plan.profile)
    outside = {fault.path for fault in fence.rally_points}
    faults += (one for one in _rally_reach_faults(plan, vehicles) if one.path not in outside)
    faults += missing
    if plan.profile == Profile.ANNEX:
        faults += annex_faults(plan)
    return Verdict(tuple(faults), tuple(warnings), tuple(missing))


def name_faults(name: str | None, path: str = "name") -> Iterator[Fault]:
    """Find why a name cannot be shown as it is: in a list, a log line or a file's name.

    Characters that change the direction of text can make a name look like another one.
    """
    if name is None:
        return
    if _CONTROLS.search(name):
        yield Fault(path, "must not contain control characters or changes of the text's direction")
    elif not any(_is_visible(character) for character in name):
        yield Fault(path, "must contain a character that can be seen")


def _is_visible(character: str) -> bool:
    """Whether it is a letter, a number, a sign or a symbol; a mark alone has no place to be on."""
    return unicodedata.category(character)[0] in "LNPS" and character not in _BLANK_LETTERS


def _plan_faults(plan: Plan, now: datetime) -> Iterator[Fault]:
    yield from name_faults(plan.name)
    if plan.expires_at is not None and plan.expires_at <= now:
        yield Fault("expires_at", "is in the past")
    seen_vehicles: dict[int, int] = {}
    seen_missions: dict[int, int] = {}
    for index, mission in enumerate(plan.missions):
        first = seen_vehicles.setdefault(mission.vehicle_id, index)
        if first != index:
            message = f"vehicle {mission.vehicle_id} flies missions.{first} already"
            yield Fault(f"missions.{index}.vehicle_id", message)
        first = seen_missions.setdefault(mission.mission_id, index)
        if first != index:
            message = f"{mission.mission_id} is already in missions.{first}"
            yield Fault(f"missions.{index}.mission_id", message)


def _limit_faults(mission: Mission, path: str, limits: VehicleLimits) -> Iterator[Fault]:
    text = flyable.speed_fault(mission.maximum_speed, limits)
    if text is not None and mission.maximum_speed >= flyable.SLOWEST_M_S:  # Slower: unflyable
        yield Fault(f"{path}.maximum_speed", text)
    for where, command in _commands(mission, path):
        place = spot_of(command)
        if place and place.relative_altitude_m > limits.maximum_height_above_home_m:
            yield Fault(
                f"{where}.parameters.{altitude_name(command)}",
                f"must be at most {limits.maximum_height_above_home_m} m, the vehicle's limit",
            )


def _mission_faults(mission: Mission, path: str) -> Iterator[Fault]:
    seen: dict[int, int] = {}
    for index, (where, command) in enumerate(_commands(mission, path)):
        first = seen.setdefault(command.command_id, index)
        if first != index:
            yield Fault(
                f"{where}.command_id",
                f"{command.command_id} is already in command_array.{first}",
            )
        if isinstance(command, NavHotpoint):
            speed = math.radians(command.parameters.angular_velocity) * command.parameters.radius
            if speed > mission.maximum_speed:
                yield Fault(
                    f"{where}.parameters.angular_velocity",
                    f"times radius is {speed:.2f} m/s, above maximum_speed "
                    f"{mission.maximum_speed} m/s",
                )


_BEGINNINGS: Final = frozenset(
    {CommandType.NAV_TAKEOFF, CommandType.NAV_LAND, CommandType.NAV_HOME}
)
"""What a mission may begin with: a take-off, or the end of a hover in which a mission left it."""


def _takeoff_first(mission: Mission, path: str) -> Iterator[Fault]:
    for where, command in _commands(mission, path):
        if command.command_type_id in FLYING:
            if command.command_type_id not in _BEGINNINGS:
                yield Fault(
                    f"{where}.command_type_id",
                    "the first command that moves the vehicle must be NAV_TAKEOFF (1), "
                    "or NAV_LAND (2) or NAV_HOME (11) for a vehicle that hovers",
                )
            return


def _rally_faults(plan: Plan, fence: FenceCheck) -> Iterator[Fault]:
    for index, point in enumerate(plan.rally_points):
        place = Spot(point.latitude, point.longitude, point.altitude)
        for fault in fence.faults_of_place(place):
            path = f"rally_points.{index}"
            yield Fault(f"{path}.altitude" if fault.is_height else path, fault.text)


def _rally_reach_faults(plan: Plan, vehicles: Mapping[int, VehicleLimits]) -> Iterator[Fault]:
    """Name each rally point that no vehicle of the plan would reach."""
    begins = [
        (first, vehicles[mission.vehicle_id].farthest_m)
        for mission in plan.missions
        if mission.vehicle_id in vehicles and (first := flyable.first_place(mission)) is not None
    ]
    for index, point in enumerate(plan.rally_points if begins else ()):
        place = point.latitude, point.longitude
        if all(distance_m(*first[:2], *place) > limit_m > 0.0 for first, limit_m in begins):
            text = (
                "lies farther from the first place of every mission than vehicles go (farthest_m)"
            )
            yield Fault(f"rally_points.{index}", text)


def _fence_faults(mission: Mission, path: str, fence: FenceCheck) -> Iterator[Fault]:
    """Name each place, leg, circle and height that the fence forbids, once."""
    seen: set[str] = set()
    for fault in fence.faults(mission.command_array):
        where = f"{path}.command_array.{fault.command}.parameters"
        if fault.is_height:
            where = f"{where}.{fault.parameter}"
        if where not in seen:
            seen.add(where)
            yield Fault(where, fault.text)


def _warnings(mission: Mission, path: str, profile: Profile) -> Iterator[Fault]:
    if profile == Profile.ANNEX:
        yield from _takeoff_first(mission, path)
    flying = [c for c in mission.command_array if c.command_type_id in FLYING]
    if flying and flying[-1].command_type_id not in {CommandType.NAV_LAND, CommandType.NAV_HOME}:
        yield Fault(f"{path}.command_array", "does not end with NAV_LAND or NAV_HOME")


def _commands(mission: Mission, path: str) -> Iterator[tuple[str, Command]]:
    for index, command in enumerate(mission.command_array):
        yield f"{path}.command_array.{index}", command
