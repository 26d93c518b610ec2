"""Where a plan may be flown: legs and circles against polygons on a plane. Pure.

Straight legs are checked exactly: they are cut wherever they cross an outline, and each piece
lies on one side of it. Circles are checked as polygons that deviate from them by 2 cm: chord by
chord where an outline comes near, and by one chord for each run of others. The plane keeps north,
east and straight lines of latitude and longitude, as the fences of autopilots do, and has its
origin in the fence: over a farm it is exact to centimetres, also at high latitude and across the
date line.

An outline belongs to both of its sides: TOLERANCE_M beyond it nothing is a violation.

TooManyComparisonsError  the plan takes more than `MOST_COMPARISONS` comparisons
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple, Self, TypeAlias

from afarcloud.geodesy import metres_per_degree
from afarcloud.plan import Geofence

TOLERANCE_M: Final = 0.1
"""Some ten times the last digit of MAVLink's positions; far below the accuracy of any receiver."""
_SAGITTA_M: Final = 0.02
_BAND_M: Final = 2.0 * (TOLERANCE_M + _SAGITTA_M)
"""Of a circle's line: an edge farther away is irrelevant for it."""
_CORNERS_PER_STRIP: Final = 4
_MOST_STRIPS: Final = 256

MOST_COMPARISONS: Final = 2_000_000
"""Of legs with sides of polygons, until the caller sets the count to 0: some seconds of a small
computer, and several times as many as the largest plans of farms need."""

Point: TypeAlias = tuple[float, float]
"""East and north of the plane's origin [m]."""
Edge: TypeAlias = tuple[Point, Point]
Vertex: TypeAlias = tuple[float, float]
"""Latitude and longitude [deg]."""


class TooManyComparisonsError(Exception):
    """The check takes more comparisons than `MOST_COMPARISONS`."""


class Plane(NamedTuple):
    """Metres round an origin."""

    latitude_deg: float
    longitude_deg: float

    def point(self, latitude_deg: float, longitude_deg: float) -> Point:
        """Give a place as metres, by the shorter direction round the globe."""
        per_north, per_east = metres_per_degree(self.latitude_deg)
        east_deg = _shorter(longitude_deg - self.longitude_deg)
        return east_deg * per_east, (latitude_deg - self.latitude_deg) * per_north

    def leg(self, start: Vertex, end: Vertex) -> Edge:
        """Give a straight leg, by the shorter direction round the globe."""
        per_north, per_east = metres_per_degree(self.latitude_deg)
        east, north = self.point(*start)
        to_east = east + _shorter(end[1] - start[1]) * per_east
        return (east, north), (to_east, north + (end[0] - start[0]) * per_north)

    @classmethod
    def amid(cls, vertices: Sequence[Vertex]) -> Self:
        """Put the origin into the middle of some places."""
        first = vertices[0][1]
        east = [_shorter(longitude - first) for _, longitude in vertices]
        north = [latitude for latitude, _ in vertices]
        return cls((min(north) + max(north)) / 2.0, first + (min(east) + max(east)) / 2.0)


class Polygon:
    """A closed outline; where it crosses itself, what it goes round twice lies outside."""

    def __init__(self, corners: Sequence[Point]) -> None:
        self.edges: tuple[Edge, ...] = tuple(zip(corners, (*corners[1:], corners[0]), strict=True))
        self._west = min(east for east, _ in corners)
        self._east = max(east for east, _ in corners)
        self._south = min(north for _, north in corners)
        self._north = max(north for _, north in corners)
        height = self._north - self._south
        number = max(1, min(_MOST_STRIPS, len(corners) // _CORNERS_PER_STRIP))
        self._strip_m = height / number or 1.0
        self._strips: list[list[Edge]] = [[] for _ in range(number)]
        for edge in self.edges:
            for strip in self._strips_of(edge[0][1], edge[1][1]):
                strip.append(edge)

    def is_beside(self, leg: Edge) -> bool:
        """Whether a box with this diagonal keeps clear of the polygon's own box."""
        (x1, y1), (x2, y2) = leg
        return (
            max(x1, x2) < self._west - TOLERANCE_M
            or min(x1, x2) > self._east + TOLERANCE_M
            or max(y1, y2) < self._south - TOLERANCE_M
            or min(y1, y2) > self._north + TOLERANCE_M
        )

    def contains(self, point: Point) -> bool:
        """Whether a point lies inside, by counting the edges to the east of it."""
        east, north = point
        inside = False
        for (x1, y1), (x2, y2) in next(self._strips_of(north, north), ()):
            if (y1 > north) != (y2 > north) and x1 + (north - y1) * (x2 - x1) / (y2 - y1) > east:
                inside = not inside
        return inside

    def edges_near(self, leg: Edge) -> list[Edge]:
        """Give the edges that a leg may touch."""
        (x1, y1), (x2, y2) = leg
        west, east = min(x1, x2) - TOLERANCE_M, max(x1, x2) + TOLERANCE_M
        south, north = min(y1, y2) - TOLERANCE_M, max(y1, y2) + TOLERANCE_M
        strips = list(self._strips_of(south, north))
        if sum(map(len, strips)) > len(self.edges):
            strips = [list(self.edges)]
        near = {
            edge: None
            for strip in strips
            for edge in strip
            if min(edge[0][0], edge[1][0]) <= east
            and max(edge[0][0], edge[1][0]) >= west
            and min(edge[0][1], edge[1][1]) <= north
            and max(edge[0][1], edge[1][1]) >= south
        }
        return list(near)

    def distance_m(self, point: Point) -> float:
        """Give the distance from a point to the outline."""
        return min(_distance_m(point, edge) for edge in self.edges)

    def _strips_of(self, one_north: float, other_north: float) -> Iterator[list[Edge]]:
        """Give the strips that a span of northings meets, the southernmost first."""
        last = len(self._strips) - 1
        low = math.floor((min(one_north, other_north) - self._south) / self._strip_m)
        high = math.floor((max(one_north, other_north) - self._south) / self._strip_m)
        if high < 0 or low > last + 1:  # The northern border lies in strip last + 1
            return
        for number in range(min(max(low, 0), last), min(high, last) + 1):
            yield self._strips[number]


class Circle(NamedTuple):
    """The line of a circle, as chords counted anticlockwise from the east."""

    centre: Point
    radius_m: float
    number: int  # Of chords

    @classmethod
    def of(cls, centre: Point, radius_m: float) -> Self:
        """Choose so many chords that they stay within the sagitta."""
        return cls(centre, radius_m, _corners_of_circle(radius_m))

    @property
    def box(self) -> Edge:
        """A diagonal of the circle's own box."""
        (east, north), r = self.centre, self.radius_m
        return (east - r, north - r), (east + r, north + r)

    def chord(self, number: int) -> Edge:
        """Give one of its chords."""
        return self._corner(number), self._corner(number + 1)

    def chords_to_judge(self, edges: Iterable[Edge]) -> list[int]:
        """Give the chords that an edge may touch, and one of each run of others between them."""
        near = sorted({chord for edge in edges for chord in self._chords_near(edge)})
        if not near:
            return [0]
        behind = [*near[1:], near[0] + self.number]
        between = [(a + 1) % self.number for a, b in zip(near, behind, strict=True) if b > a + 1]
        return [*near, *between]

    def _corner(self, number: int) -> Point:
        angle = math.tau * (number % self.number) / self.number
        (east, north), r = self.centre, self.radius_m
        return east + r * math.cos(angle), north + r * math.sin(angle)

    def _chords_near(self, edge: Edge) -> Iterator[int]:
        """Give the chords where the circle is within a band along an edge.

        Seen from the centre by the angle from the edge's normal, these are two arcs, or one where
        the edge touches the circle.
        """
        (x1, y1), (x2, y2) = edge
        r, length_m = self.radius_m, math.dist(*edge)
        if length_m == 0.0 or r == 0.0:
            return
        along_x, along_y = (x2 - x1) / length_m, (y2 - y1) / length_m
        to_x, to_y = x1 - self.centre[0], y1 - self.centre[1]
        away_m = along_x * to_y - along_y * to_x  # Of the edge's line, to the left of the edge
        if not -r - _BAND_M <= away_m <= r + _BAND_M:
            return
        first = math.acos(min(1.0, max(-1.0, (away_m + _BAND_M) / r)))
        last = math.acos(min(1.0, max(-1.0, (away_m - _BAND_M) / r)))
        begins_m = to_x * along_x + to_y * along_y - _BAND_M
        ends_m = begins_m + length_m + 2.0 * _BAND_M
        normal = math.atan2(along_x, -along_y)
        share = self.number / math.tau
        for side in (-1.0, 1.0):  # Ahead along the edge is a turn to the right of its normal
            spans_m = [-side * r * math.sin(first), -side * r * math.sin(last)]
            if first <= math.pi / 2.0 <= last:
                spans_m.append(-side * r)
            if max(spans_m) < begins_m or min(spans_m) > ends_m:
                continue
            low, high = sorted((normal + side * first, normal + side * last))
            for chord in range(math.floor(low * share) - 1, math.floor(high * share) + 2):
                yield chord % self.number


class Area:
    """The inclusion and exclusion areas of one geofence."""

    def __init__(self, geofence: Geofence) -> None:
        outlines = (*geofence.inclusion, *geofence.exclusion)
        vertices = [vertex for outline in outlines for vertex in outline]
        self.plane = Plane.amid(vertices) if vertices else Plane(0.0, 0.0)
        self.inclusion = [self._polygon(outline) for outline in geofence.inclusion]
        self.exclusion = [self._polygon(outline) for outline in geofence.exclusion]
        self.comparisons = 0
        """So far, since the caller has set it to 0."""

    def fault_at(self, place: Vertex) -> str | None:
        """Return what forbids a place, or None."""
        point = self.plane.point(*place)
        fault = self._fault((point, point))
        if fault is None:
            return None
        if fault < 0:
            distance_m = min(polygon.distance_m(point) for polygon in self.inclusion)
            return f"lies {distance_m:.1f} m outside geofence.inclusion"
        return f"lies in geofence.exclusion.{fault}"

    def fault_on_leg(self, start: Vertex, end: Vertex) -> str | None:
        """Return what a straight leg violates, or None."""
        return _text(self._fault(self.plane.leg(start, end)))

    def fault_on_circle(self, centre: Vertex, radius_m: float) -> str | None:
        """Return what the line of a circle violates, or None; what lies inside does not matter."""
        circle = Circle.of(self.plane.point(*centre), radius_m)
        self._spend(len(self.exclusion) + len(self.inclusion))
        for number, polygon in enumerate(self.exclusion):
            if not polygon.is_beside(circle.box) and self._goes_round_into(circle, polygon):
                return _text(number)
        if not self.inclusion:
            return None
        near = [one for one in self.inclusion if not one.is_beside(circle.box)]
        edges = [edge for polygon in near for edge in polygon.edges_near(circle.box)]
        self._spend(len(edges))
        chords = circle.chords_to_judge(edges)
        return _text(-1 if any(self._leaves(circle.chord(one), near) for one in chords) else None)

    def _goes_round_into(self, circle: Circle, polygon: Polygon) -> bool:
        edges = polygon.edges_near(circle.box)
        self._spend(len(edges))
        return any(
            self._enters(circle.chord(one), polygon) for one in circle.chords_to_judge(edges)
        )

    def _polygon(self, outline: Sequence[Vertex]) -> Polygon:
        return Polygon([self.plane.point(*vertex) for vertex in outline])

    def _fault(self, leg: Edge) -> int | None:
        """Give the number of the exclusion that a leg enters, -1 if it leaves the inclusion."""
        self._spend(len(self.exclusion) + len(self.inclusion))
        for number, polygon in enumerate(self.exclusion):
            if self._enters(leg, polygon):
                return number
        return -1 if self.inclusion and self._leaves(leg, self.inclusion) else None

    def _enters(self, leg: Edge, polygon: Polygon) -> bool:
        if polygon.is_beside(leg):
            return False
        near = polygon.edges_near(leg)
        self._spend(1 + len(near))
        for piece in _pieces(leg, near):
            self._spend(1 + len(near))
            if polygon.contains(_middle(piece)) and not _keeps_to_one(piece, near):
                return True
        return False

    def _leaves(self, leg: Edge, inclusion: Sequence[Polygon]) -> bool:
        polygons = [polygon for polygon in inclusion if not polygon.is_beside(leg)]
        near = [edge for polygon in polygons for edge in polygon.edges_near(leg)]
        self._spend(1 + len(near))
        for piece in _pieces(leg, near):
            self._spend(len(polygons) + len(near))
            middle = _middle(piece)
            inside = any(polygon.contains(middle) for polygon in polygons)
            if not inside and not _keeps_to_one(piece, near):
                return True
        return False

    def _spend(self, comparisons: int) -> None:
        self.comparisons += comparisons
        if self.comparisons > MOST_COMPARISONS:
            raise TooManyComparisonsError


def _text(fault: int | None) -> str | None:
    if fault is None:
        return None
    return "leaves geofence.inclusion" if fault < 0 else f"enters geofence.exclusion.{fault}"


def _corners_of_circle(radius_m: float) -> int:
    """Give how many chords stay within the sagitta."""
    share = min(_SAGITTA_M / radius_m, 1.0) if radius_m > 0.0 else 1.0
    return max(8, math.ceil(math.pi / math.acos(1.0 - share)))


def _pieces(leg: Edge, edges: Iterable[Edge]) -> Iterator[Edge]:
    """Cut a leg where it crosses edges, and beside the corners that it almost touches."""
    cuts = {0.0, 1.0}
    for edge in edges:
        crossing = _crossing(leg, edge)
        if crossing is not None:
            cuts.add(crossing)
        for corner in edge:
            share = _share(corner, leg)
            if math.dist(corner, _at(leg, share)) <= 2.0 * TOLERANCE_M:
                cuts.add(share)
    shares = sorted(cuts)
    for first, second in itertools.pairwise(shares):
        yield _at(leg, first), _at(leg, second)


def _keeps_to_one(piece: Edge, edges: Iterable[Edge]) -> bool:
    """Whether a piece runs along one edge: then all of it does, distances being convex."""
    start, end = piece
    return any(
        _distance_m(start, edge) <= TOLERANCE_M and _distance_m(end, edge) <= TOLERANCE_M
        for edge in edges
    )


def _crossing(leg: Edge, edge: Edge) -> float | None:
    """Give the share of a leg at which it crosses an edge, or None."""
    (ax, ay), (bx, by) = leg
    (cx, cy), (dx, dy) = edge
    along_x, along_y = bx - ax, by - ay
    edge_x, edge_y = dx - cx, dy - cy
    area = along_x * edge_y - along_y * edge_x
    if area == 0.0:
        return None
    share = ((cx - ax) * edge_y - (cy - ay) * edge_x) / area
    of_edge = ((cx - ax) * along_y - (cy - ay) * along_x) / area
    return share if 0.0 <= share <= 1.0 and 0.0 <= of_edge <= 1.0 else None


def _share(point: Point, leg: Edge) -> float:
    """Give the share of a leg that is nearest to a point."""
    (ax, ay), (bx, by) = leg
    squared = (bx - ax) ** 2 + (by - ay) ** 2
    if squared == 0.0:
        return 0.0
    share = ((point[0] - ax) * (bx - ax) + (point[1] - ay) * (by - ay)) / squared
    return max(0.0, min(1.0, share))


def _at(leg: Edge, share: float) -> Point:
    (ax, ay), (bx, by) = leg
    return ax + share * (bx - ax), ay + share * (by - ay)


def _middle(leg: Edge) -> Point:
    return _at(leg, 0.5)


def _distance_m(point: Point, edge: Edge) -> float:
    return math.dist(point, _at(edge, _share(point, edge)))


def _shorter(degrees: float) -> float:
    """Return an angle in -180 to 180 degrees."""
    return (degrees + 180.0) % 360.0 - 180.0
