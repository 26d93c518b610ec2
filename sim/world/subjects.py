"""What moves on the farm: a tractor round the north field, cows in the pasture. Pure in time."""

import math
from collections.abc import Sequence
from enum import Enum
from typing import Final, NamedTuple

from sim.world.layout import FIELDS, Cover
from sim.world.plane import Place

TRACTOR_SPEED_M_S: Final = 2.5
COWS: Final = 5
_HEADLAND: Final = (
    Place(-74.0, 5.5),
    Place(97.5, 5.5),
    Place(102.0, 138.5),
    Place(-65.0, 144.0),
)
_COW_RANGE_M: Final = 16.0
_COW_PERIODS_S: Final = (410.0, 623.0)  # East and north: no two rounds are the same


class Kind(Enum):
    """What a subject is."""

    TRACTOR = "tractor"
    COW = "cow"


class Subject(NamedTuple):
    """Something that moves, at one instant. Its place is the middle of its footprint."""

    name: str
    kind: Kind
    place: Place  # [m] On the farm's map
    heading_deg: float  # [deg] From true north, 0 to 360
    speed_m_s: float  # [m/s] Over the ground
    length_m: float  # [m]
    width_m: float  # [m]
    height_m: float  # [m]


def subjects_at(seed: int, time_utc_s: float) -> tuple[Subject, ...]:
    """Everything that moves, at a time [s since 1970]; always in the same order."""
    return (_tractor(time_utc_s), *(_cow(seed, number, time_utc_s) for number in range(COWS)))


def _tractor(time_utc_s: float) -> Subject:
    """Round and round the headland, at one speed."""
    place, heading_deg = _along(_HEADLAND, TRACTOR_SPEED_M_S * time_utc_s)
    return Subject("tractor", Kind.TRACTOR, place, heading_deg, TRACTOR_SPEED_M_S, 4.2, 2.0, 2.7)


def _along(corners: Sequence[Place], distance_m: float) -> tuple[Place, float]:
    """Place and heading [deg] that far along a closed path."""
    legs = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    lengths = [math.dist(start, end) for start, end in legs]
    rest = distance_m % sum(lengths)
    for (start, end), length in zip(legs, lengths, strict=True):
        if rest < length:
            share = rest / length
            east, north = end.east_m - start.east_m, end.north_m - start.north_m
            place = Place(start.east_m + share * east, start.north_m + share * north)
            return place, math.degrees(math.atan2(east, north)) % 360.0
        rest -= length
    return corners[0], 0.0  # Rounding at the very end of the path


def _cow(seed: int, number: int, time_utc_s: float) -> Subject:
    """A slow closed curve around a place of its own in the pasture."""
    pasture = next(field for field in FIELDS if field.cover is Cover.PASTURE)
    corner, opposite = pasture.boundary[0], pasture.boundary[2]
    share = (number + 0.5 + 0.31 * math.sin(7.0 * seed + 3.0 * number)) / COWS
    sideways = 0.5 + 0.22 * math.sin(5.0 * seed + 2.0 * number)
    middle = Place(
        corner.east_m + sideways * (opposite.east_m - corner.east_m),
        corner.north_m + 20.0 + share * (opposite.north_m - corner.north_m - 40.0),
    )
    east_rate, north_rate = (2.0 * math.pi / period for period in _COW_PERIODS_S)
    east_angle = east_rate * time_utc_s + 1.7 * number + 0.1 * seed
    north_angle = north_rate * time_utc_s + 2.9 * number
    velocity = (
        _COW_RANGE_M * east_rate * math.cos(east_angle),
        _COW_RANGE_M * north_rate * math.cos(north_angle),
    )
    place = Place(
        middle.east_m + _COW_RANGE_M * math.sin(east_angle),
        middle.north_m + _COW_RANGE_M * math.sin(north_angle),
    )
    heading_deg = math.degrees(math.atan2(*velocity)) % 360.0
    return Subject(
        f"cow-{number + 1}", Kind.COW, place, heading_deg, math.hypot(*velocity), 2.3, 0.8, 1.4
    )
