"""A field, and the conditions under which its outline can be flown."""

from collections.abc import Iterator
from typing import Annotated, Final

from pydantic import Field as Bounds

from afarcloud import geometry
from afarcloud.faults import Fault, InvalidError
from afarcloud.geodesy import distance_m
from afarcloud.numbers import Model, ShortText
from afarcloud.plan import Polygon, Vertex

SMALLEST_M2: Final = 1.0
NOTHING_M2: Final = 0.05  # Shown as 0.0
MOST_CORNERS: Final = 5000
FARTHEST_ENTRY_M: Final = 2000.0
"""From the nearest corner: an entry farther away is that of another field, or mistyped."""
FARTHEST_CORNER_M: Final = 100_000.0
"""From the first corner of the boundary: usually a minus sign is missing."""
Rings = Annotated[tuple[Polygon, ...], Bounds(max_length=50)]


class Field(Model):
    """The boundary of a field: rings of (latitude, longitude), the first corner not repeated.

    A hole is not part of the field; an exclusion is, but no vehicle may fly there. Vehicles enter
    at the entry, where they are started and a survey begins.
    """

    name: ShortText | None = None
    boundary: Polygon
    holes: Rings = ()
    exclusions: Rings = ()
    entry: Vertex | None = None


def check(field: Field, path: str = "") -> None:
    """Check what the types cannot express; raises InvalidError with every fault."""
    if found := tuple(_faults(field)):
        raise InvalidError(tuple(one._replace(path=f"{path}{one.path}") for one in found))


def area_m2(field: Field) -> float:
    """Size of a field without its holes."""
    return geometry.area_m2(field.boundary) - sum(geometry.area_m2(hole) for hole in field.holes)


def _faults(field: Field) -> Iterator[Fault]:
    inner = [(f"holes.{index}", ring) for index, ring in enumerate(field.holes)]
    inner += [(f"exclusions.{index}", ring) for index, ring in enumerate(field.exclusions)]
    rings = [("boundary", field.boundary), *inner]
    if sum(len(ring) for _, ring in rings) > MOST_CORNERS:
        yield Fault("boundary", f"and what lies in it have more than {MOST_CORNERS} corners")
        return
    for path, ring in rings:
        yield from _far_corner(path, ring, field.boundary[0])
        if (text := geometry.ring_fault(ring, SMALLEST_M2)) is not None:
            yield Fault(path, text)
    for path, ring in inner:
        if path.startswith("holes") and not any(
            geometry.contains(field.boundary, corner) for corner in ring
        ):
            yield Fault(path, "lies outside of the boundary")
    if field.holes and area_m2(field) < NOTHING_M2 < geometry.area_m2(field.boundary):
        yield Fault("holes", "leave nothing of the field")
    if field.entry is not None:
        away_m = min(distance_m(*corner, *field.entry) for corner in field.boundary)
        if away_m > FARTHEST_ENTRY_M:
            text = f"is {away_m:.0f} m from the field, at most {FARTHEST_ENTRY_M:.0f} m"
            yield Fault("entry", text)


def _far_corner(path: str, ring: Polygon, first: Vertex) -> Iterator[Fault]:
    """Give the first corner of a ring that cannot be of this field, if there is one."""
    for index, corner in enumerate(ring):
        away_m = distance_m(*first, *corner)
        if away_m > FARTHEST_CORNER_M:
            yield Fault(
                path,
                f"corner {index} is {away_m / 1000:.0f} km from the first one of the field, "
                f"at most {FARTHEST_CORNER_M / 1000:.0f} km",
            )
            return
