"""The order in which lines are flown, and the paths between them that stay in the area. Pure."""

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from edge_server.survey.lines import Line
from edge_server.survey.plane import Area, Point

ROUNDING_M: Final = 0.005
"""A path that passes a corner more closely might cut it once a plan has rounded its places."""


@dataclass(frozen=True, slots=True)
class Stop:
    """A point of the route; at a `work` point something is done, others only lead round."""

    point: Point
    is_work: bool


class NoPathError(Exception):
    """Parts of the area are not connected by any path inside it."""


def order(rows: Sequence[Sequence[Line]], start: Point | None = None) -> list[tuple[Point, ...]]:
    """Put lines in the order of flight: block by block, each line in the other direction.

    A block is a run of lines of neighbouring rows, each beside exactly one of the next row
    (boustrophedon cells; Choset and Pignon, 1997). The next block is the nearest one; the first
    is the one that begins nearest to `start`, if there is any.
    """
    blocks = _blocks(rows)
    flown: list[tuple[Point, ...]] = []
    here = start
    while blocks:
        index, block = min(
            ((index, lines) for index, block in enumerate(blocks) for lines in _directions(block)),
            key=lambda choice: 0.0 if here is None else math.dist(here, choice[1][0][0]),
        )
        del blocks[index]
        flown += block
        here = block[-1][-1]
    return flown


def _blocks(rows: Sequence[Sequence[Line]]) -> list[list[Line]]:
    blocks: list[list[Line]] = []
    growing: list[list[Line]] = []
    for row in rows:
        fresh: list[list[Line]] = []
        for line in row:
            behind = [block for block in growing if _beside(block[-1], line)]
            alone = len(behind) == 1 and sum(_beside(behind[0][-1], one) for one in row) == 1
            block = behind[0] if alone else []
            if not block:
                blocks.append(block)
            block.append(line)
            fresh.append(block)
        growing = fresh
    return blocks


def _beside(first: Line, second: Line) -> bool:
    return first.span[0] < second.span[1] and second.span[0] < first.span[1]


def _directions(block: Sequence[Line]) -> Iterator[list[tuple[Point, ...]]]:
    """A block from either end, beginning to the right or to the left."""
    for lines in (block, block[::-1]):
        for first in (0, 1):
            yield [
                line.places if (index + first) % 2 == 0 else line.places[::-1]
                for index, line in enumerate(lines)
            ]


class Navigator:
    """Finds paths inside an area round its holes and inlets."""

    def __init__(self, area: Area, clearance_m: float) -> None:
        self._area = area
        self._corners = list(area.corners(clearance_m))
        self._seen: dict[Point, list[Point]] = {}

    def path(self, start: Point, end: Point) -> list[Point]:
        """Points between two places, neither of them included; shortest over the corners.

        Raises:
            NoPathError: if there is none.
        """
        if self._area.is_free(start, end, ROUNDING_M):
            return []
        queue: list[tuple[float, float, Point, tuple[Point, ...]]] = [(0.0, 0.0, start, ())]
        done: set[Point] = set()
        while queue:
            _, flown, here, path = heapq.heappop(queue)
            if here == end:
                return list(path[:-1])
            if here in done:
                continue
            done.add(here)
            for there in self._visible(here, end):
                if there not in done:
                    length = flown + math.dist(here, there)
                    bound = length + math.dist(there, end)
                    heapq.heappush(queue, (bound, length, there, (*path, there)))
        raise NoPathError("the area falls into parts that no path inside it connects")

    def _visible(self, here: Point, end: Point) -> list[Point]:
        if here not in self._seen:
            self._seen[here] = [
                corner
                for corner in self._corners
                if corner != here and self._area.is_free(here, corner, ROUNDING_M)
            ]
        return (
            [*self._seen[here], end]
            if self._area.is_free(here, end, ROUNDING_M)
            else self._seen[here]
        )


def route(area: Area, lines: Sequence[tuple[Point, ...]], clearance_m: float) -> list[Stop]:
    """Join lines into one route inside the area.

    Raises:
        NoPathError: if parts of the area are not connected.
    """
    navigator = Navigator(area, clearance_m)
    stops: list[Stop] = []
    for place in (place for line in lines for place in line):
        if stops:
            around = navigator.path(stops[-1].point, place)
            stops += [Stop(point, is_work=False) for point in around]
        stops.append(Stop(place, is_work=True))
    return stops
