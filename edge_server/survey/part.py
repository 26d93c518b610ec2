"""A part of a field as the area of a survey: a simple ring that does not leave the field. Pure."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Final

from afarcloud import geometry
from afarcloud.faults import Fault
from afarcloud.plan import Polygon
from edge_server.survey.plane import (
    SMALLEST_M2,
    Area,
    Frame,
    Point,
    crossing,
    distance_to_side,
)

TOLERANCE_M: Final = 0.1
"""A corner on an edge of the field is rounded; places keep a wider margin from the edge."""
LEAST_SHOWN_M: Final = 1.0
MOST_LOOKS: Final = 2_000_000
"""Places on sides times edges of the field: a part of any real field takes a hundredth."""
_LOOKED_AT: Final = tuple(number / 8 for number in range(1, 8))


def faults(area: Polygon, boundary: Polygon) -> Iterator[Fault]:
    """Why an area is no part of the field with this boundary; nothing if it is one.

    The path names the corner, from which the next side begins.
    """
    found = list(_faults_of_sides(area, boundary))
    yield from found or _surrounded(area, boundary)


def _faults_of_sides(area: Polygon, boundary: Polygon) -> Iterator[Fault]:
    if (text := geometry.ring_fault(area, SMALLEST_M2)) is not None:
        yield Fault("area", text)
        return
    known = set(_sides(boundary))
    frame = Frame(*boundary[0], 0.0)
    field = Area([frame.to_plane(corner) for corner in boundary])
    looks = 0
    for index, (here, after) in enumerate(_sides(area)):
        if (here, after) in known or (after, here) in known:
            continue
        start, end = frame.to_plane(here), frame.to_plane(after)
        if (outside_m := _outside_m(field, start)) > TOLERANCE_M:
            yield Fault(f"area.{index}", f"is {_shown(outside_m)} m outside of the field")
        elif _outside_m(field, end) <= TOLERANCE_M:
            points = [*_between(field, start, end)]
            looks += len(points) * len(boundary)
            if looks > MOST_LOOKS:
                yield Fault(
                    "area", "crosses the boundary of the field too often; draw a simpler one"
                )
                return
            outside_m = max(_outside_m(field, point) for point in points)
            if outside_m > TOLERANCE_M:
                text = f"is followed by a side that is {_shown(outside_m)} m outside of the field"
                yield Fault(f"area.{index}", text)


def _surrounded(ring: Polygon, boundary: Polygon) -> Iterator[Fault]:
    """A bay of the field's boundary in the area, whose mouth may lie on a side of the area."""
    frame = Frame(*boundary[0], 0.0)
    area = Area([frame.to_plane(corner) for corner in ring])
    for corner in map(frame.to_plane, boundary):
        if area.holds(corner) and _to_edge_m(area, corner) > TOLERANCE_M:
            yield Fault("area", "surrounds ground that is outside of the field")
            return


def touching(area: Polygon, rings: Sequence[Polygon]) -> tuple[Polygon, ...]:
    """Rings that may reach into an area: those of which nothing is near it are left out."""
    frame = Frame(*area[0], 0.0)
    west, south, east, north = _extent(frame, area)
    found = []
    for ring in rings:
        left, low, right, high = _extent(frame, ring)
        if left <= east and right >= west and low <= north and high >= south:
            found.append(ring)
    return tuple(found)


def _sides(ring: Polygon) -> Iterator[tuple[Point, Point]]:
    return zip(ring, [*ring[1:], ring[0]], strict=True)


def _between(field: Area, start: Point, end: Point) -> Iterator[Point]:
    """Places on each piece of a side between two edges of the field."""
    crossed = (crossing(start, end, *edge) for edge in field.edges)
    cuts = sorted({0.0, 1.0, *(cut for cut in crossed if cut is not None)})
    for first, last in itertools.pairwise(cuts):
        for share in _LOOKED_AT:
            part = first + share * (last - first)
            yield start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])


def _outside_m(field: Area, point: Point) -> float:
    """How far a point lies outside of the field; 0 in it."""
    return 0.0 if field.holds(point) else _to_edge_m(field, point)


def _to_edge_m(area: Area, point: Point) -> float:
    return min(distance_to_side(point, *edge) for edge in area.edges)


def _shown(distance_m: float) -> str:
    """Whole metres; tenths where that would be none."""
    return f"{distance_m:.0f}" if distance_m >= LEAST_SHOWN_M else f"{distance_m:.1f}"


def _extent(frame: Frame, ring: Polygon) -> tuple[float, float, float, float]:
    xs, ys = zip(*(frame.to_plane(corner) for corner in ring), strict=True)
    return min(ys) - TOLERANCE_M, min(xs) - TOLERANCE_M, max(ys), max(xs)
