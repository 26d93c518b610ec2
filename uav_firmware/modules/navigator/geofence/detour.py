"""The shortest path between two points within the geofence: pure.

A shortest path among polygons turns at their corners only (visibility graph; Lozano-Perez and
Wesley, "An algorithm for planning collision-free paths among polyhedral obstacles", 1979). Each
corner is moved off the boundary by a clearance to the allowed side; a circle is approximated by
a polygon. The graph is searched by A* (Hart, Nilsson and Raphael, 1968), and each line is checked
only when the search needs it. Horizontal metres north and east.
"""

import heapq
import itertools
import math
from collections.abc import Iterator
from typing import Final

from uav_firmware.modules.navigator.geofence.geofence import Area, Disc, Geofence, Point, Polygon

CLEARANCES_M: Final = (3.0, 1.5, 0.75)
"""Distances to the geofence, tried in this order."""
_CIRCLE_CORNERS: Final = 12
_SHARPEST: Final = 0.35  # Sine of half an angle; limits the clearance of sharper corners
_KEPT_SHARE: Final = 0.6  # Of the clearance: distance of a corner to every other boundary
_CHECKS_MAX: Final = 60_000  # Checks of sides and circles for each clearance: some 50 ms at most


def find_detour(fence: Geofence, start: Point, goal: Point) -> tuple[Point, ...] | None:
    """Points at which the path from start to goal turns; None when no path is found.

    Empty when the straight path is allowed. None also from or to a point that is not allowed,
    and when the geofence is so large that the search would take too long.
    """
    if fence.line_allowed(start, goal):
        return ()
    if not (fence.allows(start) and fence.allows(goal)):
        return None
    size = 1 + len(fence.areas) + fence.sides
    if (2 * fence.sides + _CIRCLE_CORNERS * len(fence.areas)) * size > _CHECKS_MAX:
        return None
    for clearance in CLEARANCES_M:
        corners = tuple(_corners(fence, clearance))
        turns = _search(fence, start, goal, corners, _CHECKS_MAX // (2 * size))
        if turns is not None:
            return turns
    return None


def length(start: Point, turns: tuple[Point, ...], goal: Point) -> float:
    """Length [m] of a path."""
    return sum((math.dist(a, b) for a, b in itertools.pairwise((start, *turns, goal))), 0.0)


def _corners(fence: Geofence, clearance: float) -> Iterator[Point]:
    areas = fence.areas if fence.around_home is None else (*fence.areas, fence.around_home)
    for area in areas:
        for corner in _clear_of(area, clearance):
            if fence.allows(corner) and fence.margin(corner) >= _KEPT_SHARE * clearance:
                yield corner


def _clear_of(area: Area, clearance: float) -> Iterator[Point]:
    """Corners of an area, moved off its boundary to either side."""
    if isinstance(area, Disc):
        yield from _about_circle(area, clearance)
        return
    count = len(area.vertices)
    for number, corner in enumerate(area.vertices):
        yield from _about_corner(area, number, corner, count, clearance)


def _about_circle(disc: Disc, clearance: float) -> Iterator[Point]:
    """Outside, a polygon whose sides keep off the circle; inside, one whose corners do."""
    outside = (disc.radius + clearance) / math.cos(math.pi / _CIRCLE_CORNERS)
    radius = disc.radius - clearance if disc.inclusion else outside
    for number in range(_CIRCLE_CORNERS):
        bearing = math.tau * number / _CIRCLE_CORNERS
        yield (
            disc.centre[0] + radius * math.cos(bearing),
            disc.centre[1] + radius * math.sin(bearing),
        )


def _about_corner(
    area: Polygon, number: int, corner: Point, count: int, clearance: float
) -> Iterator[Point]:
    """Both points on the bisector of a corner that are `clearance` from its two sides."""
    to_former = _direction(corner, area.vertices[number - 1])
    to_next = _direction(corner, area.vertices[(number + 1) % count])
    between = (to_former[0] + to_next[0], to_former[1] + to_next[1])
    size = math.hypot(*between)
    straight = size < 1e-6  # the sides lie on one line
    bisector = (-to_next[1], to_next[0]) if straight else (between[0] / size, between[1] / size)
    sine = abs(bisector[0] * to_next[1] - bisector[1] * to_next[0])
    off = clearance / max(sine, _SHARPEST)
    yield (corner[0] + off * bisector[0], corner[1] + off * bisector[1])
    yield (corner[0] - off * bisector[0], corner[1] - off * bisector[1])


def _direction(start: Point, end: Point) -> Point:
    distance = math.dist(start, end)
    if distance == 0.0:
        return (0.0, 0.0)
    return ((end[0] - start[0]) / distance, (end[1] - start[1]) / distance)


def _search(
    fence: Geofence, start: Point, goal: Point, corners: tuple[Point, ...], lines: int
) -> tuple[Point, ...] | None:
    """A* over start, corners and goal, with `lines` checks of lines at most."""
    places = (start, *corners, goal)
    last = len(places) - 1
    previous: dict[int, int] = {}
    costs = {0: 0.0}
    done: set[int] = set()
    waiting = [(math.dist(start, goal), 0)]
    while waiting and lines > 0:
        _, here = heapq.heappop(waiting)
        if here == last:
            return _turns(places, previous, last)
        if here in done:
            continue
        done.add(here)
        for there in range(1, last + 1):
            cost = costs[here] + math.dist(places[here], places[there])
            if there in done or cost >= costs.get(there, math.inf):
                continue
            lines -= 1
            if fence.line_allowed(places[here], places[there]):
                costs[there], previous[there] = cost, here
                heapq.heappush(waiting, (cost + math.dist(places[there], goal), there))
    return None


def _turns(places: tuple[Point, ...], previous: dict[int, int], last: int) -> tuple[Point, ...]:
    turns: list[Point] = []
    at = previous[last]
    while at != 0:
        turns.append(places[at])
        at = previous[at]
    return tuple(reversed(turns))
