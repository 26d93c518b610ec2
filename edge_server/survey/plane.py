"""The field on a plane: metres along (x) and across (y) the flight lines. Pure.

An area is an outer ring less its holes. Rings are lists of corners without the first repeated.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

from afarcloud import geometry
from afarcloud.geodesy import LocalPlane

Point: TypeAlias = tuple[float, float]
Ring: TypeAlias = Sequence[Point]
Interval: TypeAlias = tuple[float, float]

SMALLEST_M2: Final = 1.0
"""A smaller area is refused."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A plane that touches the globe at an origin; x runs along `bearing_deg` from north."""

    latitude_deg: float
    longitude_deg: float
    bearing_deg: float

    def to_plane(self, place: Point) -> Point:
        """From (latitude, longitude) [deg] to (along, across) [m]; across is to the right."""
        north, east = LocalPlane.at(self.latitude_deg, self.longitude_deg).to_plane(*place)
        cosine, sine = self._turn()
        return north * cosine + east * sine, east * cosine - north * sine

    def to_globe(self, point: Point) -> Point:
        """From (along, across) [m] to (latitude, longitude) [deg]."""
        cosine, sine = self._turn()
        north = point[0] * cosine - point[1] * sine
        east = point[0] * sine + point[1] * cosine
        return LocalPlane.at(self.latitude_deg, self.longitude_deg).to_globe(north, east)

    def _turn(self) -> Point:
        angle = math.radians(self.bearing_deg)
        return math.cos(angle), math.sin(angle)


@dataclass(frozen=True)
class Area:
    """What is to be covered, and where alone a vehicle may be."""

    outer: Ring
    holes: Sequence[Ring] = ()

    @cached_property
    def edges(self) -> list[tuple[Point, Point]]:
        """Every side of every ring."""
        return [
            (start, end)
            for ring in (self.outer, *self.holes)
            for start, end in zip(ring, [*ring[1:], ring[0]], strict=True)
        ]

    def row(self, y: float) -> list[Interval]:
        """Where the line at `y` lies in the area: intervals of x from left to right."""
        inside = _crossings(self.outer, y)
        for hole in self.holes:
            inside = _without(inside, _crossings(hole, y))
        return inside

    def holds(self, point: Point) -> bool:
        """Whether a point lies in the area."""
        return any(low <= point[0] <= high for low, high in self.row(point[1]))

    def is_free(self, start: Point, end: Point, clearance_m: float = 0.0) -> bool:
        """Whether the straight line between two points of the area stays in it.

        It is not free either if it passes a corner within the clearance.
        """
        left, right = min(start[0], end[0]) - clearance_m, max(start[0], end[0]) + clearance_m
        low, high = min(start[1], end[1]) - clearance_m, max(start[1], end[1]) + clearance_m
        for first_x, last_x, first_y, last_y, corner, other in self.boxes:
            if first_x > right or last_x < left or first_y > high or last_y < low:
                continue
            if geometry.crosses(start, end, corner, other):
                return False
            if clearance_m and passes(start, end, corner, clearance_m):
                return False
        return self.holds(((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0))

    @cached_property
    def boxes(self) -> list[tuple[float, float, float, float, Point, Point]]:
        """Each side with its least and greatest x and y: most sides are far from a line."""
        return [
            (min(a[0], b[0]), max(a[0], b[0]), min(a[1], b[1]), max(a[1], b[1]), a, b)
            for a, b in self.edges
        ]

    @cached_property
    def square_metres(self) -> float:
        """Its size: of holes that overlap or reach beyond the outer ring only what they take."""
        if not self.holes:
            return abs(signed(self.outer))
        # Between two of these the width changes evenly
        ys = sorted({point[1] for edge in self.edges for point in edge} | {*self._crossed()})
        return sum(
            (high - low) * sum(end - start for start, end in self.row((low + high) / 2.0))
            for low, high in itertools.pairwise(ys)
        )

    def _crossed(self) -> Iterator[float]:
        """Where along y a side of a hole crosses another side."""
        first_of_hole = len(self.outer)
        for index, (start, end) in enumerate(self.edges[first_of_hole:], start=first_of_hole):
            for edge in self.edges[:index]:
                if (part := crossing(start, end, *edge)) is not None:
                    yield start[1] + part * (end[1] - start[1])

    def corners(self, clearance_m: float) -> Iterator[Point]:
        """Where a path round an obstacle may bend: its corners, moved into the area."""
        for ring, is_hole in [(self.outer, False), *((hole, True) for hole in self.holes)]:
            turn = 1.0 if (signed(ring) > 0) != is_hole else -1.0
            for before, corner, after in zip(
                [ring[-1], *ring], ring, [*ring[1:], ring[0]], strict=False
            ):
                point = _moved_inside(before, corner, after, turn, clearance_m)
                if point is not None and self.holds(point):
                    yield point


def crossing(a: Point, b: Point, c: Point, d: Point) -> float | None:
    """Which part of the way from a to b lies before its crossing with cd; None without one."""
    if not geometry.crosses(a, b, c, d):
        return None
    before, after = geometry.turn(c, d, a), geometry.turn(c, d, b)
    return before / (before - after)


def distance_to_side(point: Point, start: Point, end: Point) -> float:
    """Distance of a point from the nearest point between two others [m]."""
    length = math.dist(start, end)
    if length == 0.0:
        return math.dist(point, start)
    x, y = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    along = (point[0] - start[0]) * x + (point[1] - start[1]) * y
    along = min(max(along, 0.0), length)
    return math.dist(point, (start[0] + along * x, start[1] + along * y))


def _crossings(ring: Ring, y: float) -> list[Interval]:
    """Intervals of the line at `y` inside a ring (even-odd rule)."""
    crossings = sorted(
        start[0] + (y - start[1]) * (end[0] - start[0]) / (end[1] - start[1])
        for start, end in zip(ring, [*ring[1:], ring[0]], strict=True)
        if (start[1] > y) != (end[1] > y)
    )
    return list(zip(crossings[::2], crossings[1::2], strict=True))


def _without(intervals: Sequence[Interval], removed: Sequence[Interval]) -> list[Interval]:
    """Cut intervals out of intervals."""
    left = list(intervals)
    for low, high in removed:
        cut = []
        for start, end in left:
            cut += [(start, min(end, low)), (max(start, high), end)]
        left = [(start, end) for start, end in cut if end > start]
    return left


def passes(start: Point, end: Point, corner: Point, clearance_m: float) -> bool:
    """Whether a corner lies beside a path, between its ends, within a distance."""
    length = math.dist(start, end)
    if length == 0.0:
        return False
    along = (corner[0] - start[0]) * (end[0] - start[0]) + (corner[1] - start[1]) * (
        end[1] - start[1]
    )
    beside = abs(geometry.turn(start, end, corner)) / length
    return 0.0 < along < length * length and beside < clearance_m


def signed(ring: Ring) -> float:
    """Area of a ring, positive when its corners run anticlockwise (shoelace formula)."""
    pairs = zip(ring, [*ring[1:], ring[0]], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2.0


def _moved_inside(
    before: Point, corner: Point, after: Point, turn: float, clearance_m: float
) -> Point | None:
    """A corner at which the area bulges in, moved into the area; None for any other corner."""
    if geometry.turn(before, corner, after) * turn >= 0.0:
        return None
    first, second = _unit(before, corner), _unit(after, corner)
    x, y = first[0] + second[0], first[1] + second[1]
    length = math.hypot(x, y)
    if length == 0.0:
        return None
    return corner[0] + x / length * clearance_m, corner[1] + y / length * clearance_m


def _unit(start: Point, end: Point) -> Point:
    length = math.dist(start, end) or 1.0
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length
