"""Which items are a geofence, and which are rally points: pure.

mavlink applies the rules on an item to each one that it receives, and all rules to a plan stored
by a former run; the navigator applies all of them to an upload.
"""

import math
from collections.abc import Sequence
from typing import Final, TypeAlias

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.payload_rules import unset
from uav_firmware.lib.stepwise import finished
from uav_firmware.msg.mission import MissionItem, MissionRejection, MissionResult, PlanReview

Point: TypeAlias = tuple[float, float]
"""North, east [m]."""

RETURN_POINT: Final = 5000
POLYGON_INCLUSION: Final = 5001
POLYGON_EXCLUSION: Final = 5002
CIRCLE_INCLUSION: Final = 5003
CIRCLE_EXCLUSION: Final = 5004
RALLY_POINT: Final = 5100

POLYGONS: Final = frozenset({POLYGON_INCLUSION, POLYGON_EXCLUSION})
CIRCLES: Final = frozenset({CIRCLE_INCLUSION, CIRCLE_EXCLUSION})
_FENCE: Final = POLYGONS | CIRCLES | {RETURN_POINT}
_FRAMES: Final = frozenset({0, 3})
_FEWEST_VERTICES: Final = 3
_SMALLEST_RADIUS_M: Final = 0.5
_NARROWEST_M: Final = 0.01  # [m] Of a corner; narrower, its sides lie on each other
_COMPARED_PER_UNIT: Final = 8  # Sides whose boxes are compared in 5 us


def check_fence(items: Sequence[MissionItem]) -> MissionRejection | None:
    """First reason why the items are no geofence, or None."""
    return finished(review_fence(items))


def review_fence(items: Sequence[MissionItem]) -> PlanReview:
    """Do the work of `check_fence` item by item."""
    for item in items:
        rejection = check_fence_item(item)
        if rejection is not None:
            return rejection
        yield 2  # the completeness of the polygons below included
    returns = [item for item in items if item.command == RETURN_POINT]
    if len(returns) > 1:
        return _reject(returns[1], MissionResult.INVALID, "is a second return point")
    rejection = _check_polygons(items)
    if rejection is not None:
        return rejection
    for corners in _polygons_of(items):
        rejection = yield from _review_crossings(corners)
        if rejection is not None:
            return rejection
    return None


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
        if not unset(value):
            reason = f"parameter {number} is {value:g} but has no effect and must be unset"
            return _reject(item, results[number - 1], reason)
    return None


def _check_fence_item(item: MissionItem) -> MissionRejection | None:
    if item.command == RETURN_POINT:
        return _check_unset(item, 1, 2)
    if item.command in CIRCLES and not _SMALLEST_RADIUS_M <= item.param1 < math.inf:
        reason = f"radius is {item.param1:g} m, at least {_SMALLEST_RADIUS_M:g} m are needed"
        return _reject(item, MissionResult.INVALID_PARAM1, reason)
    count = item.param1
    if item.command in POLYGONS and not (count >= _FEWEST_VERTICES and count.is_integer()):
        return _reject(item, MissionResult.INVALID_PARAM1, f"vertex count is {count:g}")
    return _check_unset(item, 2)


def _check_polygons(items: Sequence[MissionItem]) -> MissionRejection | None:
    index = 0
    while index < len(items):
        item = items[index]
        if item.command not in POLYGONS:
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


def _polygons_of(items: Sequence[MissionItem]) -> list[Sequence[MissionItem]]:
    """Corners of each polygon of a checked fence."""
    polygons: list[Sequence[MissionItem]] = []
    index = 0
    while index < len(items):
        count = int(items[index].param1) if items[index].command in POLYGONS else 1
        if items[index].command in POLYGONS:
            polygons.append(items[index : index + count])
        index += count
    return polygons


def _review_crossings(corners: Sequence[MissionItem]) -> PlanReview:
    """Refuse a polygon whose sides cross or touch: its inside is not defined.

    Goes through the sides from south to north and compares each with those that reach as far.
    """
    frame = LocalFrame(corners[0].x, corners[0].y, 0.0)
    points = []
    for corner in corners:
        points.append(point_of(corner, frame))
        yield 1
    sides = []
    for index, start in enumerate(points):
        sides.append(_Side(start, points[(index + 1) % len(points)], index, len(points)))
        yield 1
    sides.sort(key=lambda side: side.south)
    abreast: list[_Side] = []
    for side in sides:
        abreast = [other for other in abreast if other.north >= side.south]
        for other in abreast:
            if side.meets(other):
                first, second = sorted((side.index, other.index))
                reason = f"begins a side that crosses the one from item {corners[second].seq}"
                return _reject(corners[first], MissionResult.INVALID, reason)
        yield 1 + len(abreast) // _COMPARED_PER_UNIT
        abreast.append(side)
    return None


class _Side:
    """One side of a polygon, with the box round it."""

    __slots__ = ("count", "east", "end", "index", "north", "south", "start", "west")

    def __init__(self, start: Point, end: Point, index: int, count: int) -> None:
        self.start, self.end, self.index, self.count = start, end, index, count
        self.south, self.north = min(start[0], end[0]), max(start[0], end[0])
        self.west, self.east = min(start[1], end[1]), max(start[1], end[1])

    def meets(self, other: "_Side") -> bool:
        """Whether two sides have a point in common that is no corner between them."""
        if other.east < self.west or other.west > self.east:
            return False
        if (self.index + 1) % self.count == other.index:
            return _folds_back(self.start, self.end, other.end)
        if (other.index + 1) % self.count == self.index:
            return _folds_back(other.start, other.end, self.end)
        return _sides_meet(self.start, self.end, other.start, other.end)


def _side_of(start: Point, end: Point, point: Point) -> float:
    """Twice the area [m^2] of a triangle, positive with the point on the right hand."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])


def _sides_meet(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether the side from a to b has a point in common with the one from c to d."""
    of_c, of_d = _side_of(a, b, c), _side_of(a, b, d)
    of_a, of_b = _side_of(c, d, a), _side_of(c, d, b)
    if of_c * of_d < 0.0 and of_a * of_b < 0.0:
        return True
    return (
        (of_c == 0.0 and _within(a, b, c))
        or (of_d == 0.0 and _within(a, b, d))
        or (of_a == 0.0 and _within(c, d, a))
        or (of_b == 0.0 and _within(c, d, b))
    )


def _within(start: Point, end: Point, point: Point) -> bool:
    """Whether a point on the line through a side lies on the side."""
    return min(start[0], end[0]) <= point[0] <= max(start[0], end[0]) and min(
        start[1], end[1]
    ) <= point[1] <= max(start[1], end[1])


def _folds_back(before: Point, corner: Point, after: Point) -> bool:
    """Whether two sides at a corner lie on each other, or one has no length."""
    if corner in {before, after}:
        return True
    ahead = (before[0] - corner[0], before[1] - corner[1])
    behind = (after[0] - corner[0], after[1] - corner[1])
    along = ahead[0] * behind[0] + ahead[1] * behind[1]
    apart = abs(_side_of(before, corner, after)) / max(math.hypot(*ahead), math.hypot(*behind))
    return along > 0.0 and apart < _NARROWEST_M


def _has_no_area(corners: Sequence[MissionItem]) -> bool:
    """Whether all corners lie on one line, to a few centimetres."""
    first = corners[0]
    frame = LocalFrame(first.x, first.y, 0.0)
    points = [point_of(corner, frame) for corner in corners]
    span = max(points, key=lambda point: math.hypot(*point))
    length = math.hypot(*span)
    return length == 0.0 or all(abs(n * span[1] - e * span[0]) <= 0.05 * length for n, e in points)
