"""Lawn-mower lines over an area, and the places on them where something is done. Pure.

Lines lie exactly one spacing apart, so that the side overlap is that of the request. Each line
covers its strip, half a spacing to either side: where a slanted edge lets the strip reach
further than the line itself, the last places are moved sideways within the strip to get there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from edge_server.survey.plane import Area, Interval, Point

ROWS_PER_STRIP: Final = 13
"""Rows at which a strip is looked at; odd, so that the line itself is one of them."""
TOLERANCE_M: Final = 0.01
"""A strip this narrow needs no line of its own."""
WORTH_A_STOP_M: Final = 0.1
"""A strip that reaches less far beyond its line needs no stop of its own there."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """What one place covers [m]: `across_m` the line, `along_m` it (0 for a towed swath)."""

    across_m: float
    along_m: float
    line_spacing_m: float
    place_spacing_m: float


class Line(NamedTuple):
    """One line: its row, how far its own row reaches, and its places from left to right."""

    y: float
    span: Interval
    places: tuple[Point, ...]


def rows_of(area: Area, spacing_m: float) -> list[float]:
    """Rows one spacing apart, with the same margin on either side."""
    low = min(point[1] for point in area.outer)
    high = max(point[1] for point in area.outer)
    count = max(1, math.ceil((high - low - TOLERANCE_M) / spacing_m))
    first = (low + high) / 2.0 - (count - 1) * spacing_m / 2.0
    return [first + index * spacing_m for index in range(count)]


def count_lines(area: Area, spacing_m: float) -> int:
    """How many lines there would be: each costs a turn."""
    return sum(len(area.row(y)) for y in rows_of(area, spacing_m))


def lines_of(area: Area, footprint: Footprint, margin_m: float) -> list[list[Line]]:
    """The lines of each row; places keep a margin from the edge where there is room for it."""
    found = []
    for y in rows_of(area, footprint.line_spacing_m):
        strip = _strip(area, y, footprint.line_spacing_m, margin_m)
        spans = _joined(strip)
        found.append([_line(y, span, strip, footprint) for span in spans])
    return found


_Strip = Sequence[tuple[float, list[Interval]]]


def _strip(area: Area, y: float, spacing_m: float, margin_m: float) -> _Strip:
    """Rows across a strip, nearest to its line first, and where each may be flown."""
    half = (ROWS_PER_STRIP - 1) // 2
    offsets = sorted(
        (spacing_m / 2.0 * 0.999 * index / half for index in range(-half, half + 1)), key=abs
    )
    corners = [
        point[1] - y
        for ring in (area.outer, *area.holes)
        for point in ring
        if abs(point[1] - y) < spacing_m / 2.0
    ]
    rows = offsets + [corner - math.copysign(margin_m, corner) for corner in corners]
    strip = []
    for offset in rows:
        intervals = area.row(y + offset)
        if offset:  # A place beside the line keeps its distance from edges along the line too
            intervals = _common(intervals, area.row(y + offset + math.copysign(margin_m, offset)))
        strip.append((y + offset, [_shrunk(interval, margin_m) for interval in intervals]))
    return strip


def _common(first: Sequence[Interval], second: Sequence[Interval]) -> list[Interval]:
    """Where two rows both lie in the area."""
    return [
        (max(a[0], b[0]), min(a[1], b[1]))
        for a in first
        for b in second
        if max(a[0], b[0]) < min(a[1], b[1])
    ]


def _shrunk(interval: Interval, margin_m: float) -> Interval:
    low, high = interval
    if high - low <= 2.0 * margin_m:
        return ((low + high) / 2.0, (low + high) / 2.0)
    return low + margin_m, high - margin_m


def _joined(strip: _Strip) -> list[Interval]:
    """How far the strip reaches: its intervals, those that touch in one."""
    joined: list[Interval] = []
    for low, high in sorted(interval for _, row in strip for interval in row):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], high))
        else:
            joined.append((low, high))
    return joined


def _line(y: float, span: Interval, strip: _Strip, footprint: Footprint) -> Line:
    wanted = _stations(span, strip[0][1], footprint)
    places = tuple(dict.fromkeys(_reachable(x, strip) for x in wanted))
    return Line(y, span, places)


def _stations(span: Interval, row: Sequence[Interval], footprint: Footprint) -> list[float]:
    """Where along a line something is done: at every end of a swath, or picture by picture."""
    low, high = span
    if footprint.along_m == 0.0:
        ends = [x for interval in row for x in interval if low <= x <= high]
        if not ends or low < ends[0] - WORTH_A_STOP_M:
            ends.insert(0, low)
        if high > ends[-1] + WORTH_A_STOP_M:
            ends.append(high)
        return ends
    gaps = max(0, math.ceil((high - low - footprint.along_m) / footprint.place_spacing_m - 1e-9))
    first = (low + high) / 2.0 - gaps * footprint.place_spacing_m / 2.0
    return [first + index * footprint.place_spacing_m for index in range(gaps + 1)]


def _reachable(x: float, strip: _Strip) -> Point:
    """The place nearest to the line at which the strip can be flown at `x`."""
    for y, row in strip:
        for low, high in row:
            if low <= x <= high:
                return x, y
    return min(
        ((min(max(x, low), high), y) for y, row in strip for low, high in row),
        key=lambda point: abs(point[0] - x),
    )
