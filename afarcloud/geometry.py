"""Plane geometry of fields and fences, good to centimetres over a farm.

Points are (latitude_deg, longitude_deg). Each ring is laid on the plane that touches the globe at
its first corner, or at the point that it is asked about.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from afarcloud.geodesy import LocalPlane

Point: TypeAlias = tuple[float, float]


class _Side(NamedTuple):
    """A side of a ring on the plane [m], sortable by its western end."""

    west: float
    east: float
    number: int
    start: Point
    end: Point


def contains(polygon: Sequence[Point], point: Point) -> bool:
    """Whether the polygon holds the point, by counting edges crossed to the east."""
    plane = _on_plane(polygon, point)
    inside = False
    for (x1, y1), (x2, y2) in zip(plane, plane[1:] + plane[:1], strict=True):
        if (y1 > 0) != (y2 > 0) and x1 + (0 - y1) * (x2 - x1) / (y2 - y1) > 0:
            inside = not inside
    return inside


def area_m2(ring: Sequence[Point]) -> float:
    """Size of what a ring encloses (shoelace formula)."""
    plane = _on_plane(ring, ring[0])
    pairs = zip(plane, [*plane[1:], plane[0]], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2.0


def ring_fault(ring: Sequence[Point], smallest_m2: float) -> str | None:
    """Give why a ring encloses nothing that could be meant, or None."""
    if (pair := _crossing(_on_plane(ring, ring[0]))) is not None:
        first, second = sorted(pair)
        return f"crosses itself: side {first} and side {second}, counted from 0"
    return "has no area" if area_m2(ring) < smallest_m2 else None


def _on_plane(ring: Sequence[Point], origin: Point) -> list[Point]:
    """East and north [m] of an origin."""
    plane = LocalPlane.at(*origin)
    offsets = (plane.to_plane(*corner) for corner in ring)
    return [(offset.east_m, offset.north_m) for offset in offsets]


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
