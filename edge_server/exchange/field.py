"""What a field is, and what its outline must be like for anybody to fly over it."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Final, NamedTuple

from pydantic import Field as Bounds

from afarcloud import geometry
from afarcloud.faults import Fault, InvalidError
from afarcloud.geometry import METRES_PER_DEGREE
from afarcloud.model import Model
from afarcloud.numbers import ShortText
from afarcloud.plan import Polygon, Vertex

SMALLEST_M2: Final = 1.0
MOST_CORNERS: Final = 5000
Rings = Annotated[tuple[Polygon, ...], Bounds(max_length=50)]


class Field(Model):
    """The boundary of a field: rings of (latitude, longitude), the first corner not repeated.

    A hole is no part of the field; an exclusion is, but nobody may fly there.
    """

    name: ShortText | None = None
    boundary: Polygon
    holes: Rings = ()
    exclusions: Rings = ()


class _Edge(NamedTuple):
    """A side of a ring on the plane [m], from its western end."""

    west: float
    east: float
    number: int
    start: tuple[float, float]
    end: tuple[float, float]


def check(field: Field, path: str = "") -> None:
    """Hold a field against what no type can say; raises InvalidError with every fault."""
    if found := tuple(_faults(field)):
        raise InvalidError(tuple(one._replace(path=f"{path}{one.path}") for one in found))


def area_m2(field: Field) -> float:
    """Size of a field without its holes."""
    return abs(_signed_m2(_on_plane(field.boundary))) - sum(
        abs(_signed_m2(_on_plane(hole))) for hole in field.holes
    )


def _faults(field: Field) -> Iterator[Fault]:
    inner = [(f"holes.{index}", ring) for index, ring in enumerate(field.holes)]
    inner += [(f"exclusions.{index}", ring) for index, ring in enumerate(field.exclusions)]
    rings = [("boundary", field.boundary), *inner]
    if sum(len(ring) for _, ring in rings) > MOST_CORNERS:
        yield Fault("boundary", f"and what lies in it have more than {MOST_CORNERS} corners")
        return
    for path, ring in rings:
        yield from _ring_faults(path, ring)
    for path, ring in inner:
        if path.startswith("holes") and not any(
            geometry.contains(field.boundary, corner) for corner in ring
        ):
            yield Fault(path, "lies outside of the boundary")


def _ring_faults(path: str, ring: Sequence[Vertex]) -> Iterator[Fault]:
    plane = _on_plane(ring)
    if (pair := _crossing(plane)) is not None:
        first, second = sorted(pair)
        yield Fault(path, f"crosses itself: side {first} and side {second}, counted from 0")
    elif abs(_signed_m2(plane)) < SMALLEST_M2:
        yield Fault(path, "has no area")


def _on_plane(ring: Sequence[Vertex]) -> list[tuple[float, float]]:
    """East and north [m] of the first corner, the shorter way round the globe."""
    origin = ring[0]
    narrowing = math.cos(math.radians(origin[0]))
    return [
        (
            ((longitude - origin[1] + 180.0) % 360.0 - 180.0) * METRES_PER_DEGREE * narrowing,
            (latitude - origin[0]) * METRES_PER_DEGREE,
        )
        for latitude, longitude in ring
    ]


def _signed_m2(plane: Sequence[tuple[float, float]]) -> float:
    """Area, positive anticlockwise (shoelace formula)."""
    pairs = zip(plane, [*plane[1:], plane[0]], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2.0


def _crossing(plane: Sequence[tuple[float, float]]) -> tuple[int, int] | None:
    """Two sides that cross, found from west to east; None in a simple ring."""
    edges = sorted(
        _Edge(min(a[0], b[0]), max(a[0], b[0]), index, a, b)
        for index, (a, b) in enumerate(zip(plane, [*plane[1:], plane[0]], strict=True))
    )
    open_edges: list[_Edge] = []
    for edge in edges:
        open_edges = [other for other in open_edges if other.east >= edge.west]
        for other in open_edges:
            if _cross(edge.start, edge.end, other.start, other.end):
                return edge.number, other.number
        open_edges.append(edge)
    return None


def _cross(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], d: tuple[float, float]
) -> bool:
    """Whether two segments cross in their insides; a shared corner is no crossing."""
    return _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0


def _side(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
