"""Checks missions and targets against the geofence before they are accepted: pure.

Legs are straight from item to item; a turn stays between two legs. The leg to the first position
is checked when it begins at home, with a take-off.
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

_SIDES_PER_UNIT: Final = 16  # Sides of a polygon that a leg is compared with in 5 us

Locate: TypeAlias = Callable[[MissionItem], Vector3]
"""North and east [m] and height above home [m] of an item; NaN keeps the present value."""


class FenceContext(NamedTuple):
    """What the check of a mission depends on."""

    positional: Callable[[MissionItem], bool]  # Whether an item is flown to
    locate: Locate
    home: Point
    fence: Geofence
    orbit_radius: float  # [m] Of circles that give none


def review_mission(items: Sequence[MissionItem], context: FenceContext) -> PlanReview:
    """First item that leaves the geofence, on its leg or at its position, or None.

    Between DO_FENCE_ENABLE items that disable and enable it, the geofence is not checked.
    """
    if context.fence == Geofence():
        return None
    whole, without = context, context._replace(fence=Geofence())
    work = work_of(context.fence)
    before: Point | None = None
    for item in items:
        if item.command == MissionCommand.DO_FENCE_ENABLE:
            context = whole if item.param1 == 1.0 else without
        reason, before = _step(item, items, before, context)
        if reason:
            name = MissionCommand(item.command).name
            text = f"item {item.seq} ({name}): {reason}"
            return MissionRejection(item.seq, MissionResult.INVALID, text)
        yield work
    return None


def work_of(fence: Geofence) -> int:
    """Work of one check by the geofence, in the unit of PlanReview."""
    return 1 + fence.sides // _SIDES_PER_UNIT


def _step(
    item: MissionItem,
    items: Sequence[MissionItem],
    before: Point | None,
    context: FenceContext,
) -> tuple[str, Point | None]:
    """Fault of an item, and the position after it."""
    fence = context.fence
    if item.command == MissionCommand.DO_JUMP:
        target = _position_from(items[int(item.param1) :], context)
        allowed = _leg_allowed(before, target, fence)
        return "" if allowed else "the leg of the jump leaves the geofence", before
    if item.command == MissionCommand.NAV_RETURN_TO_LAUNCH:
        allowed = _leg_allowed(before, context.home, fence)
        return "" if allowed else "the return leaves the geofence", context.home
    if not context.positional(item):
        return "", before
    north, east, height = context.locate(item)
    if not math.isnan(height) and not fence.height_allowed(height):
        return f"{height:g} m above home is beyond GF_MAX_VER_DIST", before
    if item.command == MissionCommand.NAV_TAKEOFF and before is None:
        before = context.home
    place = before if math.isnan(north) else (north, east)
    if item.command == MissionCommand.NAV_LOITER_TURNS and place is not None:
        return _step_round(item, place, before, context)
    return _fault(before, place, fence), place


def _step_round(
    item: MissionItem, centre: Point, before: Point | None, context: FenceContext
) -> tuple[str, Point | None]:
    unset = math.isnan(item.param3) or item.param3 == 0.0
    radius = context.orbit_radius if unset else item.param3
    circle = _Turns(centre, radius, item.param1)
    if not context.fence.circle_allowed(centre, abs(radius)):
        return "its circle leaves the geofence", before
    return _fault(before, circle.entry(before), context.fence), circle.exit(before)


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
    return "" if _leg_allowed(before, place, fence) else "the path there leaves the geofence"


def _leg_allowed(start: Point | None, end: Point | None, fence: Geofence) -> bool:
    if start is None or end is None:
        return True
    return fence.line_allowed(start, end)


def _position_from(items: Sequence[MissionItem], context: FenceContext) -> Point | None:
    for item in items:
        if context.positional(item):
            north, east, _ = context.locate(item)
            return None if math.isnan(north) else (north, east)
    return None


def path_fault(fence: Geofence, start: Vector3, end: Vector3, height: float) -> str:
    """Why a straight path to a point [m, NED] is not allowed; empty when it is.

    From outside the geofence only the end is checked, so that the vehicle can return.
    """
    here, there = (start[0], start[1]), (end[0], end[1])
    if not fence.height_allowed(height):
        return f"{height:.1f} m above home is beyond GF_MAX_VER_DIST"
    if not fence.allows(there):
        return "the target lies outside the geofence"
    if fence.allows(here) and not fence.line_allowed(here, there):
        return "the path there leaves the geofence"
    return ""
