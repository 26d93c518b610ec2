"""Reads the simulator's true track and measures it against what was asked."""

import csv
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from tests.support.geodesy import LocalGround


class TruePosition(NamedTuple):
    """Where the vehicle truly was at one instant."""

    time_s: float
    latitude_deg: float
    longitude_deg: float
    height_above_home_m: float


def read_track(path: Path) -> list[TruePosition]:
    """Read a truth log, which may be in the middle of being written."""
    with path.open(newline="", encoding="utf-8") as log:
        whole = (line for line in log if line.endswith("\n"))
        return list(_positions(csv.DictReader(whole)))


def _positions(rows: Iterable[dict[str, str]]) -> Iterator[TruePosition]:
    for row in rows:
        yield TruePosition(
            float(row["time_s"]),
            float(row["latitude_deg"]),
            float(row["longitude_deg"]),
            float(row["height_above_home_m"]),
        )


def horizontal_distance_m(
    position: TruePosition, latitude_deg: float, longitude_deg: float
) -> float:
    """Distance over ground to a point on the ellipsoid."""
    ground = LocalGround(latitude_deg, longitude_deg)
    return math.hypot(*ground.north_east_m(position.latitude_deg, position.longitude_deg))


def closest_approach_m(
    track: list[TruePosition], latitude_deg: float, longitude_deg: float, height_m: float
) -> float:
    """Shortest distance of the track to a point in space."""
    return min(
        math.hypot(
            horizontal_distance_m(position, latitude_deg, longitude_deg),
            position.height_above_home_m - height_m,
        )
        for position in track
    )
