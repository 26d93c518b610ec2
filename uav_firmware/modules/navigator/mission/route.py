"""Which waypoints are flown without a stop: pure.

A route begins at an item and continues while waypoints are flown through. It ends in a stop: at
a hold time, at an item that is no waypoint, at the last item, and where `autocontinue` is off.
Changes of speed in between apply to the legs after them. A position after a condition is a stop
too.

A route is built piece by piece, `CHUNK` waypoints at a time and well ahead of the vehicle, so
that no control step does work that grows with the length of the mission.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from uav_firmware.lib.mission_rules import HOVERING, PAYLOAD, altitude_amsl
from uav_firmware.lib.payload_rules import unset
from uav_firmware.lib.smoothing import Waypoint
from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.msg.mission import MissionCommand, MissionItem
from uav_firmware.msg.vectors import Vector3

TURN_SHARE = 0.3
"""Part of the acceptance radius that a turn may cut; the rest is for errors."""

PASSED = frozenset({MissionCommand.NAV_WAYPOINT, MissionCommand.NAV_SPLINE_WAYPOINT})
"""Items that may be flown through."""
LOOKING = frozenset(
    {
        MissionCommand.DO_SET_ROI,
        MissionCommand.DO_SET_ROI_LOCATION,
        MissionCommand.DO_SET_ROI_NONE,
    }
)
INSTANT = (
    LOOKING
    | PAYLOAD
    | {
        MissionCommand.DO_CHANGE_SPEED,
        MissionCommand.DO_SET_HOME,
        MissionCommand.DO_LAND_START,
        MissionCommand.DO_FENCE_ENABLE,
    }
)
"""Items that take no time and do not interrupt a route."""
CONDITIONS = frozenset({MissionCommand.CONDITION_DELAY, MissionCommand.CONDITION_DISTANCE})
"""Conditions: the vehicle flies to the next position meanwhile and stops there."""

CHUNK = 24
"""Waypoints that are built in one step."""
AHEAD = 12
"""A route with fewer waypoints left is extended: more than shape the speed of a leg."""

AFTER_JUMP = -2
"""In a route: a position that is flown to again after a jump back."""


class Route(NamedTuple):
    """Waypoints to fly without a stop between, and the items that they are."""

    seqs: tuple[int, ...]  # [-] Item of each waypoint; -1: a climb from the ground
    waypoints: tuple[Waypoint, ...]
    rest: int | None = None  # [-] Item at which the route continues; None: it ends in a stop
    speeds: Speeds = Speeds()  # With which it continues

    def followed_by(self, more: "Route") -> "Route":
        """This route and its continuation."""
        return more._replace(
            seqs=(*self.seqs, *more.seqs), waypoints=(*self.waypoints, *more.waypoints)
        )


def target_of(item: MissionItem, flight: Flight) -> Vector3:
    """Local position of an item [m, NED]; unset parts are those of the rest point."""
    home = flight.home.altitude_amsl_m if flight.home is not None else 0.0
    here = unset(item.x) and unset(item.y) and item.command not in HOVERING
    latitude, longitude = (math.nan, math.nan) if here else (item.x, item.y)
    return flight.to_ned(latitude, longitude, altitude_amsl(item, home))


def stop_pictures(item: MissionItem) -> MissionItem:
    """IMAGE_STOP_CAPTURE with the header of an item: a return takes no more pictures."""
    nothing = math.nan
    return item._replace(
        command=MissionCommand.IMAGE_STOP_CAPTURE,
        param1=0.0,
        param2=nothing,
        param3=nothing,
        param4=nothing,
        x=nothing,
        y=nothing,
        z=nothing,
    )


def radius_of(item: MissionItem, flight: Flight) -> float:
    """Acceptance radius of an item [m]."""
    own = item.param2 if item.command == MissionCommand.NAV_WAYPOINT else math.nan
    return flight.params.acceptance_radius if unset(own) else own


def speeds_after(item: MissionItem, speeds: Speeds) -> Speeds:
    """Speeds once a DO_CHANGE_SPEED has been carried out; -1 keeps, -2 goes back."""
    if item.param2 == -1.0:
        return speeds
    speed_type = 1 if math.isnan(item.param1) else int(item.param1)
    return speeds.with_change(speed_type, math.nan if item.param2 == -2.0 else item.param2)


def flown_through(item: MissionItem, following: MissionItem | None) -> bool:
    """Whether the vehicle passes an item without stopping."""
    return (
        item.command in PASSED
        and unset(item.param1)
        and item.autocontinue
        and following is not None
        and following.command in HOVERING
    )


def following(
    items: Sequence[MissionItem], seq: int, resolve_jumps: Callable[[int], int]
) -> MissionItem | None:
    """Next item that is neither instant nor a condition; `resolve_jumps` follows the jumps."""
    for _ in items:
        seq = resolve_jumps(seq + 1)
        if seq >= len(items):
            return None
        if items[seq].command not in INSTANT | CONDITIONS:
            return items[seq]
    return None


def awaited_before(items: Sequence[MissionItem], seq: int) -> bool:
    """Whether an item comes after a condition on the same leg."""
    for item in reversed(items[:seq]):
        if item.command not in INSTANT:
            return item.command in CONDITIONS
    return False


def build(
    items: Sequence[MissionItem],
    seq: int,
    flight: Flight,
    resolve_jumps: Callable[[int], int],
    speeds: Speeds | None = None,
) -> Route:
    """Route from item `seq` on, with the present speeds or those given; `CHUNK` waypoints at most.

    `resolve_jumps` gives the item that is flown when an index comes next. After a jump back the
    route is built anew; until then it leads to the first position after the jump.
    """
    seqs: list[int] = []
    waypoints: list[Waypoint] = []
    speeds = flight.speeds if speeds is None else speeds
    awaited = False  # A condition has to be met before the next position is left
    while True:
        item = items[seq]
        if item.command == MissionCommand.DO_CHANGE_SPEED and not awaited:
            speeds = speeds_after(item, speeds)
        elif item.command in CONDITIONS:
            awaited = True
        elif item.command not in INSTANT:
            goal = following(items, seq, resolve_jumps)
            through = not awaited and flown_through(item, goal)
            tolerance = TURN_SHARE * radius_of(item, flight) if through else 0.0
            waypoints.append(
                Waypoint(target_of(item, flight), tolerance, flight.limits_with(speeds))
            )
            seqs.append(seq)
            if goal is None or not through:
                return Route(tuple(seqs), tuple(waypoints))
            if goal.seq <= seq:
                behind = Waypoint(target_of(goal, flight), 0.0, flight.limits_with(speeds))
                return Route((*seqs, AFTER_JUMP), (*waypoints, behind))
            if len(seqs) >= CHUNK:
                return Route(tuple(seqs), tuple(waypoints), resolve_jumps(seq + 1), speeds)
        seq = resolve_jumps(seq + 1)


def from_the_ground(route: Route, flight: Flight) -> Route:
    """The same route with a climb straight up to its first height, MIS_TAKEOFF_ALT at least."""
    here, first = flight.rest_point(), route.waypoints[0]
    lowest = flight.home_down(flight.params.takeoff_height)
    down = min(here[2], first.position[2], lowest)
    climb = Waypoint((here[0], here[1], down), 0.0, first.limits)
    return route._replace(seqs=(-1, *route.seqs), waypoints=(climb, *route.waypoints))
