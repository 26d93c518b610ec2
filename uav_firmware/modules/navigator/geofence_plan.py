"""Geofence and rally points as uploaded: checked, and brought to local metres. Pure."""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.stepwise import finished
from uav_firmware.modules.navigator.geofence import Area, Disc, Point, Polygon
from uav_firmware.msg.mission import MissionItem, MissionRejection, MissionResult, PlanReview

RETURN_POINT: Final = 5000
POLYGON_INCLUSION: Final = 5001
POLYGON_EXCLUSION: Final = 5002
CIRCLE_INCLUSION: Final = 5003
CIRCLE_EXCLUSION: Final = 5004
RALLY_POINT: Final = 5100

_POLYGONS: Final = frozenset({POLYGON_INCLUSION, POLYGON_EXCLUSION})
_CIRCLES: Final = frozenset({CIRCLE_INCLUSION, CIRCLE_EXCLUSION})
_FENCE: Final = _POLYGONS | _CIRCLES | {RETURN_POINT}
_FRAMES: Final = frozenset({0, 3})
_FEWEST_VERTICES: Final = 3
_SMALLEST_RADIUS_M: Final = 0.5


def check_fence(items: Sequence[MissionItem]) -> MissionRejection | None:
    """First reason why the items are no geofence, or None."""
    return finished(review_fence(items))


def review_fence(items: Sequence[MissionItem]) -> PlanReview:
    """Judge as `check_fence`, item by item; for the upload."""
    for item in items:
        rejection = check_fence_item(item)
        if rejection is not None:
            return rejection
        yield 2  # the polygons below included
    returns = [item for item in items if item.command == RETURN_POINT]
    if len(returns) > 1:
        return _reject(returns[1], MissionResult.INVALID, "is a second return point")
    return _check_polygons(items)


def check_rally_points(items: Sequence[MissionItem]) -> MissionRejection | None:
    """First reason why the items are no rally points, or None."""
    return next((fault for item in items if (fault := check_rally_point(item)) is not None), None)


def check_fence_item(item: MissionItem) -> MissionRejection | None:
    """Why an item can be part of no geofence, or None."""
    return _check_item(item, _FENCE) or _check_fence_item(item)


def check_rally_point(item: MissionItem) -> MissionRejection | None:
    """Why an item is no rally point, or None."""
    rejection = _check_item(item, frozenset({RALLY_POINT})) or _check_unset(item, 1, 2)
    if rejection is not None:
        return rejection
    if not math.isfinite(item.z):
        return _reject(item, MissionResult.INVALID_PARAM7, "holds no altitude")
    return None


def areas_of(items: Sequence[MissionItem], frame: LocalFrame) -> tuple[Area, ...]:
    """Areas of checked fence items."""
    areas: list[Area] = []
    index = 0
    while index < len(items):
        item = items[index]
        if item.command in _CIRCLES:
            inclusion = item.command == CIRCLE_INCLUSION
            areas.append(Disc(inclusion, point_of(item, frame), item.param1))
        elif item.command in _POLYGONS:
            corners = items[index : index + int(item.param1)]
            inclusion = item.command == POLYGON_INCLUSION
            areas.append(Polygon(inclusion, tuple(point_of(corner, frame) for corner in corners)))
            index += len(corners) - 1
        index += 1
    return tuple(areas)


def point_of(item: MissionItem, frame: LocalFrame) -> Point:
    """North and east [m] of an item."""
    north, east, _ = frame.to_ned(item.x, item.y, frame.altitude_amsl_m)
    return (north, east)


def _reject(item: MissionItem, result: MissionResult, reason: str) -> MissionRejection:
    return MissionRejection(item.seq, result, f"command {item.command} {reason}")


def _check_item(item: MissionItem, known: frozenset[int]) -> MissionRejection | None:
    if item.command not in known:
        return _reject(item, MissionResult.UNSUPPORTED, "does not belong here")
    if item.frame not in _FRAMES:
        return _reject(item, MissionResult.UNSUPPORTED_FRAME, f"frame {item.frame} holds no place")
    if not abs(item.x) <= 90.0:
        return _reject(item, MissionResult.INVALID_PARAM5_X, f"latitude is {item.x:g}")
    if not abs(item.y) <= 180.0:
        return _reject(item, MissionResult.INVALID_PARAM6_Y, f"longitude is {item.y:g}")
    return _check_unset(item, 3, 4)


def _check_unset(item: MissionItem, *numbers: int) -> MissionRejection | None:
    results = (
        MissionResult.INVALID_PARAM1,
        MissionResult.INVALID_PARAM2,
        MissionResult.INVALID_PARAM3,
        MissionResult.INVALID_PARAM4,
    )
    values = (item.param1, item.param2, item.param3, item.param4)
    for number in numbers:
        value = values[number - 1]
        if not (math.isnan(value) or value == 0.0):
            reason = f"parameter {number} is {value:g} but has no effect and must be unset"
            return _reject(item, results[number - 1], reason)
    return None


def _check_fence_item(item: MissionItem) -> MissionRejection | None:
    if item.command == RETURN_POINT:
        return _check_unset(item, 1, 2)
    if item.command in _CIRCLES and not _SMALLEST_RADIUS_M <= item.param1 < math.inf:
        reason = f"radius is {item.param1:g} m, at least {_SMALLEST_RADIUS_M:g} m are needed"
        return _reject(item, MissionResult.INVALID_PARAM1, reason)
    count = item.param1
    if item.command in _POLYGONS and not (count >= _FEWEST_VERTICES and count.is_integer()):
        return _reject(item, MissionResult.INVALID_PARAM1, f"vertex count is {count:g}")
    return _check_unset(item, 2)


def _check_polygons(items: Sequence[MissionItem]) -> MissionRejection | None:
    index = 0
    while index < len(items):
        item = items[index]
        if item.command not in _POLYGONS:
            index += 1
            continue
        count = item.param1
        corners = items[index : index + int(count)]
        same = all((c.command, c.param1) == (item.command, count) for c in corners)
        if len(corners) < count or not same:
            reason = f"begins a polygon of {count:g} vertices that is not complete"
            return _reject(item, MissionResult.INVALID_PARAM1, reason)
        if _has_no_area(corners):
            return _reject(item, MissionResult.INVALID, "begins a polygon without area")
        index += len(corners)
    return None


def _has_no_area(corners: Sequence[MissionItem]) -> bool:
    """Whether all corners lie on one line, to a few centimetres."""
    first = corners[0]
    frame = LocalFrame(first.x, first.y, 0.0)
    points = [point_of(corner, frame) for corner in corners]
    span = max(points, key=lambda point: math.hypot(*point))
    length = math.hypot(*span)
    return length == 0.0 or all(abs(n * span[1] - e * span[0]) <= 0.05 * length for n, e in points)
