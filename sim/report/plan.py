"""What was to be flown, read from a plan as the edge server shows it: JSON, not types.

Degrees and metres above home, as AFarCloud has them. The launcher imports no type of the other
programs, so the numbers of commands and statuses are spelled here once more.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sim.report.arrays import Array
from sim.report.truth_track import Plane

TAKEOFF: Final = 1
LAND: Final = 2
WAYPOINT: Final = 3
ORBIT: Final = 7
HOME: Final = 11

COMMAND_NAMES: Final[Mapping[int, str]] = {
    TAKEOFF: "NAV_TAKEOFF",
    LAND: "NAV_LAND",
    WAYPOINT: "NAV_WAYPOINT",
    4: "CAMERA_IMAGE",
    5: "VIDEO_START_CAPTURE",
    6: "VIDEO_STOP_CAPTURE",
    ORBIT: "NAV_HOTPOINT",
    8: "NAV_FOLLOW_TARGET",
    9: "NAV_TRACK_SUBJECT",
    10: "CAMERA_PANORAMA",
    HOME: "NAV_HOME",
}
STATUS_NAMES: Final[Mapping[int, str]] = {
    1: "NOT_STARTED",
    2: "RUNNING",
    3: "FINISHED",
    4: "FAILED",
    5: "ABORTED",
}
_ACCEPTANCE_M: Final = 1.0  # of a waypoint that gives none


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A place to pass, or the middle of an orbit."""

    label: str
    position: Array  # [m] north, east, up
    acceptance_m: float | None  # None: no circle to pass
    orbit_radius_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One line of the plan and its result."""

    command_id: int
    name: str
    summary: str
    status: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """The missions of one vehicle."""

    points: list[Point]
    commands: list[Command]
    landing: Array | None  # [m] north, east; None: the plan does not end on the ground
    inclusions: list[Array]  # [m] north, east of the corners
    exclusions: list[Array]
    statuses: list[str]  # of the missions


def planned_for(document: Mapping[str, Any], vehicle_id: int, plane: Plane) -> Planned:
    """Read a vehicle's part of a plan; home is the middle of the plane."""
    plan = document.get("plan", document)
    missions = [
        mission
        for mission in plan.get("missions", [plan])
        if int(mission["vehicle_id"]) == vehicle_id
    ]
    commands = [command for mission in missions for command in mission["command_array"]]
    fence = plan.get("geofence") or {}
    return Planned(
        points=[point for command in commands if (point := _point(command, plane)) is not None],
        commands=[_command(command) for command in commands],
        landing=_landing(commands, plane),
        inclusions=[_polygon(corners, plane) for corners in fence.get("inclusion") or ()],
        exclusions=[_polygon(corners, plane) for corners in fence.get("exclusion") or ()],
        statuses=[_status(mission.get("mission_status_id")) for mission in missions],
    )


def _point(command: Mapping[str, Any], plane: Plane) -> Point | None:
    kind, given = int(command["command_type_id"]), command.get("parameters") or {}
    if kind not in {TAKEOFF, WAYPOINT, ORBIT, LAND}:
        return None
    height = {LAND: "landing_altitude", ORBIT: "orbit_altitude"}.get(kind, "altitude")
    return Point(
        label=str(command["command_id"]),
        position=np.append(_place(given, plane), float(given.get(height) or 0.0)),
        acceptance_m=float(given.get("acceptance_radius") or _ACCEPTANCE_M)
        if kind == WAYPOINT
        else None,
        orbit_radius_m=float(given["radius"]) if kind == ORBIT else None,
    )


def _landing(commands: list[Mapping[str, Any]], plane: Plane) -> Array | None:
    if not commands:
        return None
    last = commands[-1]
    kind, given = int(last["command_type_id"]), last.get("parameters") or {}
    if kind == LAND:
        return _place(given, plane)
    if kind == HOME and given.get("landing", True):
        return np.zeros(2)
    return None


def _place(given: Mapping[str, Any], plane: Plane) -> Array:
    latitude, longitude = np.array(given["latitude"]), np.array(given["longitude"])
    return plane.place(latitude, longitude)


def _polygon(corners: list[list[float]], plane: Plane) -> Array:
    table = np.array(corners, dtype=np.float64)
    return plane.place(table[:, 0], table[:, 1])


def _command(command: Mapping[str, Any]) -> Command:
    kind = int(command["command_type_id"])
    return Command(
        command_id=int(command["command_id"]),
        name=COMMAND_NAMES.get(kind, f"command type {kind}"),
        summary=_summary(command.get("parameters") or {}),
        status=_status(command.get("command_status_id")),
    )


def _summary(given: Mapping[str, Any]) -> str:
    """The parameters that are set, as short text."""
    units = {
        "altitude": "m up",
        "orbit_altitude": "m up",
        "landing_altitude": "m up",
        "radius": "m radius",
        "angular_velocity": "deg/s",
        "acceptance_radius": "m acceptance",
        "hold_time": "s hold",
        "desired_yaw_angle": "deg yaw",
        "photo_count": "photos",
    }
    return ", ".join(
        f"{given[name]:g} {unit}"
        for name, unit in units.items()
        if given.get(name) is not None and not (name == "hold_time" and given[name] == 0)
    )


def _status(number: Any) -> str:
    return STATUS_NAMES.get(int(number), str(number)) if number is not None else "unknown"
