"""Plane geometry of fields and fences, good to centimetres over a farm.

Points are (latitude_deg, longitude_deg). Distances use a local equirectangular plane: over
5 km its error is below 0.1 %, far under a fence's own accuracy.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

Point: TypeAlias = tuple[float, float]

METRES_PER_DEGREE = 111_319.49
"""Of latitude, and of longitude on the equator: WGS-84 semi-major axis times pi / 180."""


class _Side(NamedTuple):
    """A side of a ring on the plane [m], sortable by its western end."""

    west: float
    east: float
    number: int
    start: Point
    end: Point


def _to_plane(point: Point, origin: Point) -> tuple[float, float]:
    """East and north [m] of `point` from `origin`; by the shorter direction round the globe."""
    d_longitude = (point[1] - origin[1] + 180.0) % 360.0 - 180.0
    east = d_longitude * METRES_PER_DEGREE * math.cos(math.radians(origin[0]))
    return east, (point[0] - origin[0]) * METRES_PER_DEGREE


def distance_m(start: Point, end: Point) -> float:
    """Distance over ground of two places a few kilometres apart."""
    return math.hypot(*_to_plane(end, start))


def contains(polygon: Sequence[Point], point: Point) -> bool:
    """Whether the polygon holds the point, by counting edges crossed to the east."""
    plane = [_to_plane(vertex, point) for vertex in polygon]
    inside = False
    for (x1, y1), (x2, y2) in zip(plane, plane[1:] + plane[:1], strict=True):
        if (y1 > 0) != (y2 > 0) and x1 + (0 - y1) * (x2 - x1) / (y2 - y1) > 0:
            inside = not inside
    return inside


def area_m2(ring: Sequence[Point]) -> float:
    """Size of what a ring encloses (shoelace formula)."""
    plane = _on_plane(ring)
    pairs = zip(plane, [*plane[1:], plane[0]], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2.0


def ring_fault(ring: Sequence[Point], smallest_m2: float) -> str | None:
    """Give why a ring encloses nothing that could be meant, or None."""
    if (pair := _crossing(_on_plane(ring))) is not None:
        first, second = sorted(pair)
        return f"crosses itself: side {first} and side {second}, counted from 0"
    return "has no area" if area_m2(ring) < smallest_m2 else None


def _on_plane(ring: Sequence[Point]) -> list[Point]:
    """East and north [m] of the first corner."""
    return [_to_plane(corner, ring[0]) for corner in ring]


def _crossing(plane: Sequence[Point]) -> tuple[int, int] | None:
    """Two sides that cross, found from west to east; None in a simple ring."""
    sides = sorted(
        _Side(min(a[0], b[0]), max(a[0], b[0]), index, a, b)
        for index, (a, b) in enumerate(zip(plane, [*plane[1:], plane[0]], strict=True))
    )
    begun: list[_Side] = []
    for side in sides:
        begun = [other for other in begun if other.east >= side.west]
        for other in begun:
            if crosses(side.start, side.end, other.start, other.end):
                return side.number, other.number
        begun.append(side)
    return None


def crosses(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether two segments cross in their insides; a shared corner is no crossing."""
    return turn(a, b, c) * turn(a, b, d) < 0.0 and turn(c, d, a) * turn(c, d, b) < 0.0


def turn(a: Point, b: Point, c: Point) -> float:
    """Twice the area of a triangle on a plane, positive when its corners run anticlockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
