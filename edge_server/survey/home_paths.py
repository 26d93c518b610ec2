"""The paths between home and the ends of a flight, round every no-fly area. Pure.

Home may lie outside of the field, and so may these paths: only the rings of holes and exclusions
are in their way. Each place is reached over bends, as in the visibility graph of the rings
(Lozano-Perez and Wesley, 1979); a bend costs time too, so that few are preferred.
"""

import heapq
import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from afarcloud.geometry import crosses
from edge_server.survey.plane import Area, Point, Ring, distance_to_side, passes, signed

BEND_AT: Final = 1.1
"""A bend lies so many clearances from a ring: a leg from a place beside it needs room to turn."""
ROOM_AT: Final = 1.06
"""Least room of a bend [clearances]: less would weaken what its legs keep."""
REACH: Final = 1.6
"""No bend lies farther from its corner than so many clearances."""
OWN_SHARE: Final = 0.9
SLOPE: Final = 0.05
"""A leg from a place that is near a ring keeps this share of the place's distance, and leads away
from the ring by so many metres a metre, until it has its clearance."""
OUTLINE_SIDES: Final = 8
"""A ring with more corners has an outline with so many besides: a round pond takes few bends."""
SHARPEST_RAD: Final = math.pi / 2.0 + 1e-6
PARALLEL: Final = 1e-6


class _Bend(NamedTuple):
    """Where a path may bend, and the directions of the outline before and behind it."""

    point: Point
    before: Point
    behind: Point


class _Obstacle(NamedTuple):
    """The inside of a ring, with its least and greatest x and y."""

    inside: Area
    extent: tuple[float, float, float, float]

    def holds(self, place: Point) -> bool:
        """Whether a place lies inside."""
        left, right, low, high = self.extent
        is_near = left <= place[0] <= right and low <= place[1] <= high
        return is_near and self.inside.holds(place)


class HomePaths:
    """Finds the path from home to any place, and keeps it: the way back is the same."""

    def __init__(
        self, home: Point, rings: Sequence[Ring], clearances_m: Sequence[float], bend_m: float
    ) -> None:
        """Clearances from the widest, which is tried first; a bend costs as `bend_m` of path."""
        self.home = home
        obstacles = [_Obstacle(Area(ring), _extent(ring)) for ring in rings]
        self._networks = [
            _Network(home, obstacles, clearance_m, bend_m)
            for clearance_m in clearances_m
            if obstacles
        ]
        self._found: dict[Point, tuple[Point, ...] | None] = {}

    def straight(self) -> "HomePaths":
        """As if there were no rings: no path is shorter."""
        return HomePaths(self.home, (), (), 0.0)

    def bends(self, place: Point) -> tuple[Point, ...]:
        """Between home and a place, from home on; none if the straight line is free.

        None either where no path leads round: home lies in a ring, or rings enclose it.
        """
        return self._path(place) or ()

    def leads_to(self, place: Point) -> bool:
        """Whether a path to a place crosses no ring."""
        return self._path(place) is not None

    def _path(self, place: Point) -> tuple[Point, ...] | None:
        if not self._networks:
            return ()
        if place not in self._found:
            paths = (network.path(place) for network in self._networks)
            self._found[place] = next((path for path in paths if path is not None), None)
        return self._found[place]


class _Network:
    """The bends round all rings at one clearance, and the shortest paths from home to them."""

    def __init__(
        self, home: Point, obstacles: Sequence[_Obstacle], clearance_m: float, bend_m: float
    ) -> None:
        self._home = home
        self._obstacles = [*obstacles]
        self._clearance_m = clearance_m
        self._bend_m = bend_m
        self._rooms: dict[Point, float] = {}
        self._reached: list[tuple[float, _Bend, tuple[Point, ...]]] = []
        self._unreached: dict[Point, _Bend] | None = None
        self._queue: list[tuple[float, Point, tuple[Point, ...]]] = []

    def path(self, place: Point) -> tuple[Point, ...] | None:
        """Bends from home to a place, none if it is straight; None if there is no path."""
        if self._is_clear(self._home, place):
            return ()
        best, least_m = None, math.inf
        for from_home_m, bend, path in self._from_home():
            if from_home_m >= least_m:
                break
            length_m = from_home_m + math.dist(bend.point, place)
            if length_m < least_m and self._is_leg(place, bend):
                best, least_m = path, length_m
        return best

    def _from_home(self) -> Iterator[tuple[float, _Bend, tuple[Point, ...]]]:
        """Bends in the order of their distance from home, found as far as they are needed."""
        number = 0
        while number < len(self._reached) or self._reach_next():
            yield self._reached[number]
            number += 1

    def _reach_next(self) -> bool:
        """Find the next bend (Dijkstra's algorithm); False if there is none."""
        if self._unreached is None:
            self._unreached = {bend.point: bend for bend in self._bends()}
            self._push(self._home, 0.0, ())
        while self._queue:
            length_m, point, path = heapq.heappop(self._queue)
            bend = self._unreached.pop(point, None)
            if bend is not None:
                self._reached.append((length_m, bend, path))
                self._push(point, length_m, path, bend)
                return True
        return False

    def _push(
        self, here: Point, length_m: float, path: tuple[Point, ...], bend: _Bend | None = None
    ) -> None:
        for there in (self._unreached or {}).values():
            if bend is not None and not _is_taut(bend, there.point):
                continue
            if self._is_leg(here, there):
                whole_m = length_m + math.dist(here, there.point) + self._bend_m
                heapq.heappush(self._queue, (whole_m, there.point, (*path, there.point)))

    def _bends(self) -> Iterator[_Bend]:
        distance_m = BEND_AT * self._clearance_m
        for obstacle in self._obstacles:
            ring = obstacle.inside.outer
            bends = [*_at_corners(ring, distance_m)]
            if len(ring) > OUTLINE_SIDES:
                bends += _of_outline(ring, distance_m)
            for bend in bends:
                if self._room_m(bend.point) >= ROOM_AT * self._clearance_m:
                    yield bend

    def _is_leg(self, start: Point, bend: _Bend) -> bool:
        """Whether a leg leads to a bend; no shortest path has one that would cut the ring there."""
        is_beside = self._room_m(start) < REACH * self._clearance_m
        return (is_beside or _is_taut(bend, start)) and self._is_clear(start, bend.point)

    def _is_clear(self, start: Point, end: Point) -> bool:
        """Whether a leg crosses no ring and keeps the clearance, as far as its ends have it."""
        for number, obstacle in enumerate(self._obstacles):
            if self._is_near(start, end, obstacle) and self._is_in_the_way(start, end, obstacle):
                # The next leg is often a neighbour of this one, with the same ring in its way
                self._obstacles.insert(0, self._obstacles.pop(number))
                return False
        return True

    def _is_near(self, start: Point, end: Point, obstacle: _Obstacle) -> bool:
        """Whether a ring may be in the way of a leg: most are not, and this costs little."""
        margin_m = self._clearance_m
        left, right, low, high = obstacle.extent
        if max(start[0], end[0]) + margin_m < left or min(start[0], end[0]) - margin_m > right:
            return False
        if max(start[1], end[1]) + margin_m < low or min(start[1], end[1]) - margin_m > high:
            return False
        x, y = end[0] - start[0], end[1] - start[1]
        beside = [
            x * (corner[1] - start[1]) - y * (corner[0] - start[0])
            for corner in obstacle.inside.outer
        ]
        margin = margin_m * math.hypot(x, y)
        return min(beside) <= margin and max(beside) >= -margin

    def _is_in_the_way(self, start: Point, end: Point, obstacle: _Obstacle) -> bool:
        margin_m = self._clearance_m
        left, right = min(start[0], end[0]) - margin_m, max(start[0], end[0]) + margin_m
        low, high = min(start[1], end[1]) - margin_m, max(start[1], end[1]) + margin_m
        for side_left, side_right, side_low, side_high, corner, other in obstacle.inside.boxes:
            if side_left > right or side_right < left or side_low > high or side_high < low:
                continue
            if crosses(start, end, corner, other) or self._is_close(start, end, corner):
                return True
        return obstacle.holds(((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0))

    def _is_close(self, start: Point, end: Point, corner: Point) -> bool:
        """Whether a leg passes a corner within what it has to keep there."""
        if not passes(start, end, corner, self._clearance_m):
            return False
        kept_m = (
            OWN_SHARE * self._room_m(place) + SLOPE * math.dist(place, corner)
            for place in (start, end)
        )
        return passes(start, end, corner, min(self._clearance_m, *kept_m))

    def _room_m(self, place: Point) -> float:
        """Distance from a place to the nearest ring, at most that of any bend; 0 inside of one."""
        if place not in self._rooms:
            self._rooms[place] = self._measured_room_m(place)
        return self._rooms[place]

    def _measured_room_m(self, place: Point) -> float:
        room_m = REACH * self._clearance_m
        x, y = place
        for obstacle in self._obstacles:
            left, right, low, high = obstacle.extent
            if not (left - room_m < x < right + room_m and low - room_m < y < high + room_m):
                continue
            if obstacle.holds(place):
                return 0.0
            sides = obstacle.inside.edges
            room_m = min(room_m, *(distance_to_side(place, *side) for side in sides))
        return room_m


def _extent(ring: Ring) -> tuple[float, float, float, float]:
    xs, ys = zip(*ring, strict=True)
    return min(xs), max(xs), min(ys), max(ys)


def _is_taut(bend: _Bend, place: Point) -> bool:
    """Whether the line from a place through a bend leaves the outline there on one side."""
    x, y = bend.point[0] - place[0], bend.point[1] - place[1]
    before = bend.before[0] * y - bend.before[1] * x
    behind = x * bend.behind[1] - y * bend.behind[0]
    return before * behind >= -PARALLEL * (x * x + y * y)


def _at_corners(ring: Ring, distance_m: float) -> Iterator[_Bend]:
    """Bends round each corner that juts out, so that legs between them keep a distance."""
    corners = [*ring] if signed(ring) > 0.0 else [*reversed(ring)]
    for before, corner, after in zip(
        [corners[-1], *corners], corners, [*corners[1:], corners[0]], strict=False
    ):
        x, y = corner[0] - before[0], corner[1] - before[1]
        next_x, next_y = after[0] - corner[0], after[1] - corner[1]
        turn = math.atan2(x * next_y - y * next_x, x * next_x + y * next_y)
        if turn <= 0.0:
            continue
        number = 1 if turn <= SHARPEST_RAD else 2
        step = turn / number
        for index in range(number):
            angle = math.atan2(y, x) + index * step
            middle = _direction(angle + step / 2.0 - math.pi / 2.0)
            length_m = distance_m / math.cos(step / 2.0)
            point = corner[0] + middle[0] * length_m, corner[1] + middle[1] * length_m
            yield _Bend(point, _direction(angle), _direction(angle + step))


def _of_outline(ring: Ring, distance_m: float) -> Iterator[_Bend]:
    """Corners of a polygon round a ring, whose sides have evenly spread directions."""
    step = 2.0 * math.pi / OUTLINE_SIDES
    directions = [_direction(index * step) for index in range(OUTLINE_SIDES)]
    reaches = [max(x * dx + y * dy for x, y in ring) + distance_m for dx, dy in directions]
    for index, (x, y) in enumerate(directions):
        reach, after = reaches[index], reaches[(index + 1) % OUTLINE_SIDES]
        along = (after - reach * math.cos(step)) / math.sin(step)
        angle = index * step + math.pi / 2.0
        point = x * reach - y * along, y * reach + x * along
        yield _Bend(point, _direction(angle), _direction(angle + step))


def _direction(angle_rad: float) -> Point:
    return math.cos(angle_rad), math.sin(angle_rad)
