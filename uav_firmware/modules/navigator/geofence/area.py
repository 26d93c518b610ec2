"""Geofence and rally points in local metres, and the check of plans and targets by them."""

import math
from collections.abc import Sequence
from typing import Any

from uav_firmware.bus import Topic
from uav_firmware.lib import fence_rules
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.mission_rules import POSITIONAL, altitude_amsl
from uav_firmware.lib.payload_rules import unset
from uav_firmware.modules.navigator.circle import Circle, circle_of
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.geofence import check
from uav_firmware.modules.navigator.geofence.geofence import Area, Disc, Geofence, Polygon
from uav_firmware.modules.navigator.mission.route import target_of
from uav_firmware.msg.geofence import Fence, RallyPoints
from uav_firmware.msg.guidance import OrbitTarget
from uav_firmware.msg.mission import (
    MissionItem,
    MissionRejection,
    MissionResult,
    ModeTarget,
    NavigatorTarget,
    PlanReview,
)
from uav_firmware.msg.vectors import Vector3


class LocalGeofence:
    """Keeps the geofence and the rally points of a flight up to date."""

    def __init__(self, fence: Topic[Fence], rally_points: Topic[RallyPoints]) -> None:
        self._fence = fence
        self._rally = rally_points
        self._known: tuple[Any, ...] = ()
        self.version = 0  # Grows with every change
        self._armed = False

    def update_arming(self, flight: Flight, *, armed: bool) -> None:
        """Enable a disabled geofence again after the disarming."""
        if self._armed and not armed:
            flight.switch_fence(enabled=True)
        self._armed = armed

    def update(self, flight: Flight) -> None:
        """Convert again when a plan, the origin, home or a parameter has changed."""
        state = (
            self._fence.count,
            self._rally.count,
            flight.frame,
            None if flight.home is None else flight.home.position_ned,
            flight.params,
            flight.fence_enabled,
        )
        if state != self._known:
            self._known = state
            self.version += 1
            flight.fence = self._geofence(flight)
            flight.rally_points = self._rally_points(flight)
            flight.fence_return = self._return_point(flight)

    def _geofence(self, flight: Flight) -> Geofence:
        fence, frame, params = self._fence.value, flight.frame, flight.params
        if not flight.fence_enabled:
            return Geofence()
        areas = () if fence is None or frame is None else _areas_of(fence.items, frame)
        around_home = None
        if params.fence_distance > 0.0 and flight.home is not None:
            around_home = Disc(
                inclusion=True, centre=flight.home.position_ned[:2], radius=params.fence_distance
            )
        if params.fence_height > 0.0:
            return Geofence(areas, around_home, params.fence_height)
        return Geofence(areas, around_home)

    def _rally_points(self, flight: Flight) -> tuple[Vector3, ...]:
        rally = self._rally.value
        if rally is None or flight.frame is None or flight.home is None:
            return ()
        return tuple(_point(item, flight) for item in rally.items)

    def _return_point(self, flight: Flight) -> Vector3 | None:
        fence, home = self._fence.value, flight.home
        if fence is None or flight.frame is None or home is None:
            return None
        for item in fence.items:
            if item.command == fence_rules.RETURN_POINT:
                north, east, _ = _point(item, flight)
                return (north, east, home.position_ned[2])
        return None


def _areas_of(items: Sequence[MissionItem], frame: LocalFrame) -> tuple[Area, ...]:
    """Areas of checked fence items."""
    areas: list[Area] = []
    index = 0
    while index < len(items):
        item = items[index]
        if item.command in fence_rules.CIRCLES:
            inclusion = item.command == fence_rules.CIRCLE_INCLUSION
            areas.append(Disc(inclusion, fence_rules.point_of(item, frame), item.param1))
        elif item.command in fence_rules.POLYGONS:
            corners = items[index : index + int(item.param1)]
            inclusion = item.command == fence_rules.POLYGON_INCLUSION
            points = tuple(fence_rules.point_of(corner, frame) for corner in corners)
            areas.append(Polygon(inclusion, points))
            index += len(corners) - 1
        index += 1
    return tuple(areas)


def _point(item: MissionItem, flight: Flight) -> Vector3:
    home = flight.home.altitude_amsl_m if flight.home is not None else 0.0
    return flight.to_ned(item.x, item.y, altitude_amsl(item, home))


def review_mission(items: Sequence[MissionItem], flight: Flight) -> PlanReview:
    """First item that leaves the geofence, or None; without a home nothing is checked."""
    home = flight.home
    if home is None or flight.frame is None:
        return None

    def locate(item: MissionItem) -> Vector3:
        north, east, down = target_of(item, flight)
        height = flight.height_of(down)
        if unset(item.x) and unset(item.y):
            return (math.nan, math.nan, height)
        return (north, east, height)

    context = check.FenceContext(
        lambda item: item.command in POSITIONAL,
        locate,
        home.position_ned[:2],
        flight.fence,
        flight.params.orbit_radius,
    )
    return (yield from check.review_mission(items, context))


def review_rally_points(items: Sequence[MissionItem], flight: Flight) -> PlanReview:
    """First item that is no rally point or lies outside the geofence, or None."""
    rejection = fence_rules.check_rally_points(items)
    if rejection is not None or flight.frame is None:
        return rejection
    work = check.work_of(flight.fence)
    for item in items:
        if not flight.fence.allows(fence_rules.point_of(item, flight.frame)):
            return MissionRejection(item.seq, MissionResult.INVALID, "lies outside the geofence")
        yield work
    return None


def refusal_of(target: ModeTarget, flight: Flight) -> str | None:
    """Why the geofence forbids a target; None when it allows it."""
    here = flight.rest_point()
    if isinstance(target, OrbitTarget):
        circle = circle_of(target, flight)
        entry, _ = circle.entry(here, flight.yaw.yaw)
        return _circle_refusal(circle, flight) or _path_refusal(here, entry, flight)
    if not isinstance(target, NavigatorTarget):
        return None
    goal = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
    return None if goal == here else _path_refusal(here, goal, flight)


def _circle_refusal(circle: Circle, flight: Flight) -> str | None:
    if flight.fence.circle_allowed(circle.centre[:2], abs(circle.radius)):
        return None
    return "the circle leaves the geofence"


def _path_refusal(here: Vector3, goal: Vector3, flight: Flight) -> str | None:
    height = flight.height_of(goal[2])
    return check.path_fault(flight.fence, here, goal, height) or None
