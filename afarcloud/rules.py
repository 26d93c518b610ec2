"""Rules that no single field can state: between fields, missions, fence and vehicles.

`check` is pure; it returns faults (the plan is refused) and warnings (it is flown).
"""

import math
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import NamedTuple

from afarcloud import geometry
from afarcloud.annex import annex_faults
from afarcloud.commands import (
    FLYING,
    Command,
    NavFollowTarget,
    NavHotpoint,
    NavLand,
    NavTakeoff,
    NavWaypoint,
)
from afarcloud.enumerations import CommandType, Profile
from afarcloud.faults import Fault
from afarcloud.plan import Geofence, Mission, Plan
from afarcloud.vehicle import VehicleLimits


class Verdict(NamedTuple):
    """What the rules say of a plan."""

    faults: tuple[Fault, ...]
    warnings: tuple[Fault, ...]


class _Place(NamedTuple):
    """Where a command takes the vehicle."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    radius_m: float
    altitude_name: str


def check(plan: Plan, vehicles: Mapping[int, VehicleLimits], now: datetime) -> Verdict:
    """Hold a plan against the registered vehicles and the time of day."""
    faults = [*_plan_faults(plan, now), *_rally_faults(plan)]
    warnings: list[Fault] = []
    for index, mission in enumerate(plan.missions):
        path = f"missions.{index}"
        limits = vehicles.get(mission.vehicle_id)
        if limits is None:
            faults.append(
                Fault(f"{path}.vehicle_id", f"vehicle {mission.vehicle_id} is not registered")
            )
        else:
            faults += _limit_faults(mission, path, limits)
        faults += _mission_faults(mission, path, plan.profile)
        faults += _fence_faults(mission, path, plan.geofence)
        warnings += _warnings(mission, path, plan.profile)
    if plan.profile == Profile.ANNEX:
        faults += annex_faults(plan)
    return Verdict(tuple(faults), tuple(warnings))


def _plan_faults(plan: Plan, now: datetime) -> Iterator[Fault]:
    if plan.expires_at is not None and plan.expires_at <= now:
        yield Fault("expires_at", "is in the past")
    seen_vehicles: dict[int, int] = {}
    seen_missions: dict[int, int] = {}
    for index, mission in enumerate(plan.missions):
        for seen, key, name in (
            (seen_vehicles, mission.vehicle_id, "vehicle_id"),
            (seen_missions, mission.mission_id, "mission_id"),
        ):
            first = seen.setdefault(key, index)
            if first != index:
                yield Fault(f"missions.{index}.{name}", f"{key} is already in missions.{first}")


def _limit_faults(mission: Mission, path: str, limits: VehicleLimits) -> Iterator[Fault]:
    if mission.maximum_speed > limits.maximum_speed_m_s:
        yield Fault(
            f"{path}.maximum_speed",
            f"must be at most {limits.maximum_speed_m_s} m/s, the vehicle's limit",
        )
    for where, command in _commands(mission, path):
        place = place_of(command)
        if place and place.altitude_m > limits.maximum_height_above_home_m:
            yield Fault(
                f"{where}.parameters.{place.altitude_name}",
                f"must be at most {limits.maximum_height_above_home_m} m, the vehicle's limit",
            )


def _mission_faults(mission: Mission, path: str, profile: Profile) -> Iterator[Fault]:
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
    if profile == Profile.FIELD:
        yield from _takeoff_first(mission, path)


def _takeoff_first(mission: Mission, path: str) -> Iterator[Fault]:
    for where, command in _commands(mission, path):
        if command.command_type_id in FLYING:
            if command.command_type_id != CommandType.NAV_TAKEOFF:
                yield Fault(
                    f"{where}.command_type_id",
                    "the first command that moves the vehicle must be NAV_TAKEOFF (1)",
                )
            return


def _rally_faults(plan: Plan) -> Iterator[Fault]:
    for index, point in enumerate(plan.rally_points):
        place = _Place(point.latitude, point.longitude, point.altitude, 0.0, "altitude")
        path = f"rally_points.{index}"
        yield from _place_faults(place, path, plan.geofence)


def _fence_faults(mission: Mission, path: str, fence: Geofence | None) -> Iterator[Fault]:
    for where, command in _commands(mission, path):
        place = place_of(command)
        if place is not None:
            yield from _place_faults(place, f"{where}.parameters", fence)


def _place_faults(place: _Place, path: str, fence: Geofence | None) -> Iterator[Fault]:
    if fence is None:
        return
    centre = (place.latitude_deg, place.longitude_deg)
    if fence.inclusion and not any(
        geometry.circle_inside(polygon, centre, place.radius_m) for polygon in fence.inclusion
    ):
        yield Fault(path, "leaves the geofence's inclusion area")
    for index, polygon in enumerate(fence.exclusion):
        if not geometry.circle_outside(polygon, centre, place.radius_m):
            yield Fault(path, f"enters geofence.exclusion.{index}")
    if fence.max_altitude is not None and place.altitude_m > fence.max_altitude:
        yield Fault(
            f"{path}.{place.altitude_name}",
            f"must be at most geofence.max_altitude, {fence.max_altitude} m",
        )


def _warnings(mission: Mission, path: str, profile: Profile) -> Iterator[Fault]:
    if profile == Profile.ANNEX:
        yield from _takeoff_first(mission, path)
    flying = [c for c in mission.command_array if c.command_type_id in FLYING]
    if flying and flying[-1].command_type_id not in {CommandType.NAV_LAND, CommandType.NAV_HOME}:
        yield Fault(f"{path}.command_array", "does not end with NAV_LAND or NAV_HOME")


def _commands(mission: Mission, path: str) -> Iterator[tuple[str, Command]]:
    for index, command in enumerate(mission.command_array):
        yield f"{path}.command_array.{index}", command


def place_of(command: Command) -> _Place | None:
    """Where a command takes the vehicle, or None when it has no position of its own."""
    match command:
        case NavTakeoff(parameters=p) | NavWaypoint(parameters=p) | NavFollowTarget(parameters=p):
            return _Place(p.latitude, p.longitude, p.altitude, 0.0, "altitude")
        case NavLand(parameters=p):
            return _Place(p.latitude, p.longitude, p.landing_altitude, 0.0, "landing_altitude")
        case NavHotpoint(parameters=p):
            return _Place(p.latitude, p.longitude, p.orbit_altitude, p.radius, "orbit_altitude")
        case _:
            return None
