"""The geofence: polygons, circles, a height and a distance from home. Pure.

A place is allowed when it lies in any of the inclusion areas (or there is none), in no exclusion
area and within the distance from home. Lines and circles are checked exactly: they are cut where
they cross a boundary, and the middle of each part is checked. Horizontal metres north and
east; heights above home.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from uav_firmware.msg.geofence import FenceBreach

Point: TypeAlias = tuple[float, float]
"""North and east [m]."""

_ON_THE_LINE_M = 1e-9
_HEIGHT_SLACK_M = 0.01  # [m] A target exactly at the limit is allowed


class Disc(NamedTuple):
    """A circle and what is in it."""

    inclusion: bool
    centre: Point
    radius: float  # [m]

    def contains(self, point: Point) -> bool:
        """Whether a point lies within."""
        return math.dist(point, self.centre) <= self.radius

    def distance(self, point: Point) -> float:
        """Distance [m] to the circle itself."""
        return abs(math.dist(point, self.centre) - self.radius)

    def cuts_of_line(self, start: Point, end: Point) -> Iterator[float]:
        """Fractions of the line from start to end at which it crosses the circle."""
        dn, de = end[0] - start[0], end[1] - start[1]
        n, e = start[0] - self.centre[0], start[1] - self.centre[1]
        yield from _roots(dn * dn + de * de, n * dn + e * de, n * n + e * e - self.radius**2)

    def cuts_of_circle(self, centre: Point, radius: float) -> Iterator[float]:
        """Bearings [rad] at which a circle crosses this one."""
        apart = math.dist(centre, self.centre)
        if apart < _ON_THE_LINE_M or radius <= 0.0:
            return
        cosine = (apart**2 + radius**2 - self.radius**2) / (2.0 * apart * radius)
        if abs(cosine) <= 1.0:
            middle = math.atan2(self.centre[1] - centre[1], self.centre[0] - centre[0])
            yield from (middle - math.acos(cosine), middle + math.acos(cosine))


class Polygon(NamedTuple):
    """A closed polygon and what is in it, by the even-odd rule."""

    inclusion: bool
    vertices: tuple[Point, ...]

    def sides(self) -> Iterator[tuple[Point, Point]]:
        """Both ends of each side."""
        return zip(self.vertices, (*self.vertices[1:], self.vertices[0]), strict=True)

    def contains(self, point: Point) -> bool:
        """Whether a ray to the east crosses an odd number of sides."""
        north, east = point
        inside = False
        for (n1, e1), (n2, e2) in self.sides():
            if (n1 > north) != (n2 > north):
                crossing = e1 + (north - n1) / (n2 - n1) * (e2 - e1)
                inside ^= crossing > east
        return inside

    def distance(self, point: Point) -> float:
        """Distance [m] to the nearest side."""
        return min(_distance_to_side(point, *side) for side in self.sides())

    def cuts_of_line(self, start: Point, end: Point) -> Iterator[float]:
        """Fractions of the line from start to end at which it crosses a side."""
        dn, de = end[0] - start[0], end[1] - start[1]
        for (n1, e1), (n2, e2) in self.sides():
            sn, se = n2 - n1, e2 - e1
            cross = dn * se - de * sn
            if abs(cross) < _ON_THE_LINE_M:
                continue
            along_side = ((n1 - start[0]) * de - (e1 - start[1]) * dn) / cross
            if -1e-9 <= along_side <= 1.0 + 1e-9:
                yield ((n1 - start[0]) * se - (e1 - start[1]) * sn) / cross

    def cuts_of_circle(self, centre: Point, radius: float) -> Iterator[float]:
        """Bearings [rad] at which a circle crosses a side."""
        circle = Disc(self.inclusion, centre, radius)
        for (n1, e1), (n2, e2) in self.sides():
            for share in circle.cuts_of_line((n1, e1), (n2, e2)):
                if 0.0 <= share <= 1.0:
                    north, east = n1 + share * (n2 - n1), e1 + share * (e2 - e1)
                    yield math.atan2(east - centre[1], north - centre[0])


Area: TypeAlias = Disc | Polygon


def _roots(a: float, half_b: float, c: float) -> tuple[float, ...]:
    """Solutions of a x^2 + 2 half_b x + c = 0."""
    discriminant = half_b * half_b - a * c
    if a < _ON_THE_LINE_M or discriminant < 0.0:
        return ()
    root = math.sqrt(discriminant)
    return ((-half_b - root) / a, (-half_b + root) / a)


def _distance_to_side(point: Point, start: Point, end: Point) -> float:
    dn, de = end[0] - start[0], end[1] - start[1]
    square = dn * dn + de * de
    share = 0.0
    if square > 0.0:
        share = ((point[0] - start[0]) * dn + (point[1] - start[1]) * de) / square
        share = max(0.0, min(1.0, share))
    return math.dist(point, (start[0] + share * dn, start[1] + share * de))


@dataclass(frozen=True, slots=True)
class Geofence:
    """All limits together; empty allows everything."""

    areas: tuple[Area, ...] = ()
    around_home: Disc | None = None  # GF_MAX_HOR_DIST
    height_max: float = math.inf  # [m] above home, GF_MAX_VER_DIST

    @property
    def sides(self) -> int:
        """How many sides all polygons have."""
        return sum(len(area.vertices) for area in self.areas if isinstance(area, Polygon))

    def allows(self, point: Point) -> bool:
        """Whether a place may be flown over."""
        included = [area.contains(point) for area in self.areas if area.inclusion]
        excluded = any(not area.inclusion and area.contains(point) for area in self.areas)
        near = self.around_home is None or self.around_home.contains(point)
        return near and not excluded and (not included or any(included))

    def margin(self, point: Point) -> float:
        """Distance [m] that is surely left to the boundary; negative beyond it, inf without."""
        margins = [self._least_of_exclusions(point), self._best_of_inclusions(point)]
        if self.around_home is not None:
            margins.append(_signed(self.around_home, point))
        return min(margins)

    def height_allowed(self, height: float) -> bool:
        """Whether a height above home [m] may be flown at."""
        return height <= self.height_max + _HEIGHT_SLACK_M

    def breach(self, point: Point, height: float) -> FenceBreach:
        """What a place and height break."""
        if not self.allows(point):
            return FenceBreach.BOUNDARY
        return FenceBreach.NONE if self.height_allowed(height) else FenceBreach.MAX_ALTITUDE

    def line_allowed(self, start: Point, end: Point) -> bool:
        """Whether the whole straight line is allowed."""

        def at(share: float) -> Point:
            return (
                start[0] + share * (end[0] - start[0]),
                start[1] + share * (end[1] - start[1]),
            )

        cuts = (cut for area in self._all_areas() for cut in area.cuts_of_line(start, end))
        inner = sorted({0.0, 1.0, *(cut for cut in cuts if 0.0 < cut < 1.0)})
        return self.allows(start) and self.allows(end) and self._middles_allowed(inner, at)

    def circle_allowed(self, centre: Point, radius: float) -> bool:
        """Whether a whole circle lies where the vehicle may be."""

        def at(bearing: float) -> Point:
            return (
                centre[0] + radius * math.cos(bearing),
                centre[1] + radius * math.sin(bearing),
            )

        cuts = (cut for area in self._all_areas() for cut in area.cuts_of_circle(centre, radius))
        bearings = sorted({math.fmod(cut + 2.0 * math.tau, math.tau) for cut in cuts})
        if not bearings:
            return self.allows(at(0.0))
        return self._middles_allowed([*bearings, bearings[0] + math.tau], at)

    def _middles_allowed(self, cuts: Sequence[float], at: Callable[[float], Point]) -> bool:
        return all(
            self.allows(at(0.5 * (before + after)))
            for before, after in itertools.pairwise(cuts)
            if after - before > _ON_THE_LINE_M
        )

    def _all_areas(self) -> Iterable[Area]:
        return self.areas if self.around_home is None else (*self.areas, self.around_home)

    def _least_of_exclusions(self, point: Point) -> float:
        return min(
            (-_signed(area, point) for area in self.areas if not area.inclusion), default=math.inf
        )

    def _best_of_inclusions(self, point: Point) -> float:
        return max(
            (_signed(area, point) for area in self.areas if area.inclusion), default=math.inf
        )


def _signed(area: Area, point: Point) -> float:
    """Distance [m] to the boundary, positive inside."""
    return area.distance(point) * (1.0 if area.contains(point) else -1.0)
