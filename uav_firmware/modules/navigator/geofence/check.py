"""Plans and orders against the geofence, before they are accepted: pure.

Legs are straight from item to item; what a turn cuts off a corner lies between them. The way to
the first position is judged when it begins at home, with a take-off.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.modules.navigator.geofence.geofence import Geofence, Point
from uav_firmware.msg.mission import (
    MissionCommand,
    MissionItem,
    MissionRejection,
    MissionResult,
    PlanReview,
)
from uav_firmware.msg.vectors import Vector3

_SIDES_PER_UNIT: Final = 16  # Sides of a polygon that a leg is held against in 5 us

Locate: TypeAlias = Callable[[MissionItem], Vector3]
"""North and east [m] and height above home [m] of an item; NaN where it keeps what is."""


class Surroundings(NamedTuple):
    """What a mission is judged by."""

    positional: Callable[[MissionItem], bool]  # Whether an item is flown to
    locate: Locate
    home: Point
    fence: Geofence
    orbit_radius: float  # [m] Of circles that give none


def review_mission(items: Sequence[MissionItem], surroundings: Surroundings) -> PlanReview:
    """First item that leaves the fence, on the way to it or at it; None when all stay within.

    Where the mission itself has switched the fence off, it may leave it.
    """
    if surroundings.fence == Geofence():
        return None
    whole, without = surroundings, surroundings._replace(fence=Geofence())
    work = work_of(surroundings.fence)
    before: Point | None = None
    for item in items:
        if item.command == MissionCommand.DO_FENCE_ENABLE:
            surroundings = whole if item.param1 == 1.0 else without
        reason, before = _step(item, items, before, surroundings)
        if reason:
            name = MissionCommand(item.command).name
            text = f"item {item.seq} ({name}): {reason}"
            return MissionRejection(item.seq, MissionResult.INVALID, text)
        yield work
    return None


def work_of(fence: Geofence) -> int:
    """Work of one look at the fence, in the unit of PlanReview."""
    return 1 + fence.sides // _SIDES_PER_UNIT


def _step(
    item: MissionItem,
    items: Sequence[MissionItem],
    before: Point | None,
    surroundings: Surroundings,
) -> tuple[str, Point | None]:
    """What is wrong with an item, and where the vehicle is after it."""
    fence = surroundings.fence
    if item.command == MissionCommand.DO_JUMP:
        target = _position_from(items[int(item.param1) :], surroundings)
        allowed = _way_allowed(before, target, fence)
        return "" if allowed else "the way of the jump leaves the geofence", before
    if item.command == MissionCommand.NAV_RETURN_TO_LAUNCH:
        allowed = _way_allowed(before, surroundings.home, fence)
        return "" if allowed else "the way home leaves the geofence", surroundings.home
    if not surroundings.positional(item):
        return "", before
    north, east, height = surroundings.locate(item)
    if not math.isnan(height) and not fence.height_allowed(height):
        return f"{height:g} m above home is beyond GF_MAX_VER_DIST", before
    if item.command == MissionCommand.NAV_TAKEOFF and before is None:
        before = surroundings.home
    place = before if math.isnan(north) else (north, east)
    if item.command == MissionCommand.NAV_LOITER_TURNS and place is not None:
        return _step_round(item, place, before, surroundings)
    return _fault(before, place, fence), place


def _step_round(
    item: MissionItem, centre: Point, before: Point | None, surroundings: Surroundings
) -> tuple[str, Point | None]:
    unset = math.isnan(item.param3) or item.param3 == 0.0
    radius = surroundings.orbit_radius if unset else item.param3
    circle = _Turns(centre, radius, item.param1)
    if not surroundings.fence.circle_allowed(centre, abs(radius)):
        return "its circle leaves the geofence", before
    return _fault(before, circle.entry(before), surroundings.fence), circle.exit(before)


class _Turns(NamedTuple):
    """A circle in a mission: entered at the nearest point, left where its turns end."""

    centre: Point
    radius: float  # [m]
    turns: float

    def entry(self, before: Point | None) -> Point | None:
        """Where it is entered, if that is known."""
        return self._at(before, 0.0)

    def exit(self, before: Point | None) -> Point | None:
        """Where it is left, if that is known."""
        return self._at(before, math.copysign(self.turns * math.tau, self.radius))

    def _at(self, before: Point | None, angle: float) -> Point | None:
        if before is None or before == self.centre:
            return None
        bearing = angle + math.atan2(before[1] - self.centre[1], before[0] - self.centre[0])
        size = abs(self.radius)
        return (
            self.centre[0] + size * math.cos(bearing),
            self.centre[1] + size * math.sin(bearing),
        )


def _fault(before: Point | None, place: Point | None, fence: Geofence) -> str:
    if place is None:
        return ""
    if not fence.allows(place):
        return "lies outside the geofence"
    return "" if _way_allowed(before, place, fence) else "the way there leaves the geofence"


def _way_allowed(start: Point | None, end: Point | None, fence: Geofence) -> bool:
    if start is None or end is None:
        return True
    return fence.line_allowed(start, end)


def _position_from(items: Sequence[MissionItem], surroundings: Surroundings) -> Point | None:
    for item in items:
        if surroundings.positional(item):
            north, east, _ = surroundings.locate(item)
            return None if math.isnan(north) else (north, east)
    return None


def way_fault(fence: Geofence, start: Vector3, end: Vector3, height: float) -> str:
    """Why a straight way to a point [m, NED] is not allowed; empty when it is.

    From outside, only the end counts: the vehicle must be able to come back.
    """
    here, there = (start[0], start[1]), (end[0], end[1])
    if not fence.height_allowed(height):
        return f"{height:.1f} m above home is beyond GF_MAX_VER_DIST"
    if not fence.allows(there):
        return "the target lies outside the geofence"
    if fence.allows(here) and not fence.line_allowed(here, there):
        return "the way there leaves the geofence"
    return ""
