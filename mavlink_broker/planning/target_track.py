"""The way of a target that moves: places by time, from a file or from another vehicle. Pure.

TargetFileError  a file that tells no way, with the line and the reason
"""

import csv
import io
import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

from afarcloud.geodesy import offset
from mavlink_broker.planning.follow_target import STANDING, Vector

COLUMNS: Final = ("time_s", "latitude_deg", "longitude_deg")
STALE_S: Final = 1.0
"""How long a place is told on after its last confirmation."""
_MEMORY_S: Final = 2.0


class TargetFileError(ValueError):
    """A file that tells no way."""


class Sighting(NamedTuple):
    """Where a target is, and how it moves."""

    latitude_deg: float
    longitude_deg: float
    velocity_ned_m_s: Vector = STANDING


class Lead(Protocol):
    """A target that moves."""

    def at(self, elapsed_s: float, now: float) -> Sighting | None:
        """Where it is, some time after the follow began; None while nobody knows."""


class _Mark(NamedTuple):
    time_s: float
    latitude_deg: float
    longitude_deg: float


class TargetTrack:
    """A way from a file: straight from mark to mark, and standing before and behind them."""

    def __init__(self, marks: Sequence[tuple[float, float, float]]) -> None:
        self._marks = [_Mark(*mark) for mark in marks]
        self._times = [mark.time_s for mark in self._marks]

    def at(self, elapsed_s: float) -> Sighting:
        """Where the target is, some time after the follow began."""
        index = bisect_right(self._times, elapsed_s)
        if index == 0:
            return Sighting(*self._marks[0][1:])
        before = self._marks[index - 1]
        if index == len(self._marks):
            return Sighting(*before[1:])
        after = self._marks[index]
        span_s = after.time_s - before.time_s
        share = (elapsed_s - before.time_s) / span_s
        east_deg = math.remainder(after.longitude_deg - before.longitude_deg, 360.0)
        way = offset(*before[1:], *after[1:])
        return Sighting(
            before.latitude_deg + share * (after.latitude_deg - before.latitude_deg),
            math.remainder(before.longitude_deg + share * east_deg, 360.0),
            (way.north_m / span_s, way.east_m / span_s, 0.0),
        )


class LeadTrack:
    """The way of another vehicle, from the places that it tells."""

    def __init__(self) -> None:
        self._marks: list[_Mark] = []

    def take(self, time_s: float, latitude_deg: float, longitude_deg: float) -> None:
        """Take a place."""
        if self._marks and time_s < self._marks[-1].time_s:
            self._marks = []  # It was restarted: its time begins anew
        self._marks = [mark for mark in self._marks if time_s - mark.time_s <= _MEMORY_S]
        self._marks.append(_Mark(time_s, latitude_deg, longitude_deg))

    def at(self, time_s: float) -> Sighting | None:
        """Where it is now; None when it has not been heard for a second."""
        if not self._marks or time_s - self._marks[-1].time_s > STALE_S:
            return None
        first, last = self._marks[0], self._marks[-1]
        span_s = last.time_s - first.time_s
        if span_s <= 0.0:
            return Sighting(*last[1:])
        way = offset(*first[1:], *last[1:])
        return Sighting(*last[1:], (way.north_m / span_s, way.east_m / span_s, 0.0))


def read_track(text: str) -> TargetTrack:
    """Read `time_s,latitude_deg,longitude_deg`, times in seconds since the follow began.

    Raises:
        TargetFileError: if a line is not one, or times do not go on.
    """
    rows = csv.DictReader(io.StringIO(text))
    if tuple(rows.fieldnames or ())[:3] != COLUMNS:
        raise TargetFileError(f"its first line must be {','.join(COLUMNS)}")
    marks: list[_Mark] = []
    for number, row in enumerate(rows, 2):
        mark = _mark(number, row)
        if marks and mark.time_s <= marks[-1].time_s:
            raise TargetFileError(f"line {number}: time_s must go on")
        marks.append(mark)
    if not marks:
        raise TargetFileError("it names no place")
    return TargetTrack(marks)


def _mark(number: int, row: dict[str, str]) -> _Mark:
    try:
        mark = _Mark(*(float(row[column]) for column in COLUMNS))
    except (TypeError, ValueError):
        raise TargetFileError(f"line {number}: three numbers are wanted") from None
    if not (math.isfinite(mark.time_s) and abs(mark[1]) <= 90.0 and abs(mark[2]) <= 180.0):
        raise TargetFileError(f"line {number}: it is no place on earth")
    return mark
