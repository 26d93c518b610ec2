"""What stands on the farm at one instant, built of solids."""

import math
from collections.abc import Iterator
from functools import cache

from sim.camera.scene.solids import Point, Solid
from sim.world.farm import Farm
from sim.world.layout import BUILDINGS, TREES, Building
from sim.world.plane import Place
from sim.world.subjects import Kind, Subject

Colour = tuple[float, float, float, float]

_ROOF: Colour = (0.44, 0.17, 0.11, 0.45)
_CROWN: Colour = (0.05, 0.11, 0.04, 0.50)
_TRUNK: Colour = (0.16, 0.12, 0.09, 0.25)
_TRACTOR: Colour = (0.10, 0.30, 0.09, 0.35)
_CABIN: Colour = (0.62, 0.63, 0.60, 0.60)
_TYRE: Colour = (0.045, 0.045, 0.045, 0.06)
_RIM: Colour = (0.75, 0.62, 0.10, 0.70)
_HIDES: tuple[Colour, ...] = (
    (0.28, 0.15, 0.08, 0.40),
    (0.36, 0.22, 0.13, 0.45),
    (0.10, 0.08, 0.07, 0.2),
)


def solids(farm: Farm, time_utc_s: float) -> tuple[Solid, ...]:
    """Everything that stands or moves on the farm at a time [s since 1970]."""
    return (*standing(), *(part for each in farm.subjects(time_utc_s) for part in _moving(each)))


@cache
def standing() -> tuple[Solid, ...]:
    """Buildings and trees: what always stands where it is."""
    return tuple(_standing())


def _standing() -> Iterator[Solid]:
    for building in BUILDINGS:
        yield from _building(building)
    for tree in TREES:
        crown = 0.5 * (tree.height_m - 1.2)
        height = tree.height_m - crown
        place = (*tree.middle, height)
        half = (tree.radius_m, tree.radius_m, crown)
        yield Solid(place, half, 0.0, _CROWN, is_round=True, is_leafy=True)
        yield Solid((*tree.middle, 0.8), (0.18, 0.18, 0.8), 0.0, _TRUNK)


def _building(building: Building) -> Iterator[Solid]:
    """Walls, and a flat roof that stands over them by a hand's breadth."""
    half = (0.5 * building.length_m, 0.5 * building.width_m, 0.5 * building.height_m)
    walls = (*building.colour, 0.5)
    yield Solid((*building.middle, half[2]), half, building.bearing_deg, walls)
    roof = (half[0] + 0.3, half[1] + 0.3, 0.12)
    yield Solid((*building.middle, building.height_m), roof, building.bearing_deg, _ROOF)


def _moving(subject: Subject) -> Iterator[Solid]:
    if subject.kind is Kind.TRACTOR:
        yield from _tractor(subject)
    else:
        yield from _cow(subject)


def _tractor(subject: Subject) -> Iterator[Solid]:
    """Bonnet in front, cabin behind, large wheels under the cabin."""
    yield _part(subject, (0.95, 0.0, 1.05), (1.0, 0.42, 0.45), _TRACTOR)
    yield _part(subject, (-0.75, 0.0, 1.75), (0.75, 0.72, 0.85), _TRACTOR)
    yield _part(subject, (-0.75, 0.0, 2.62), (0.80, 0.80, 0.08), _CABIN)
    for side in (-1.0, 1.0):
        yield _part(subject, (-0.95, 0.82 * side, 0.85), (0.85, 0.20, 0.85), _TYRE, is_round=True)
        yield _part(subject, (-0.95, 1.0 * side, 0.85), (0.35, 0.05, 0.35), _RIM, is_round=True)
        yield _part(subject, (1.35, 0.75 * side, 0.55), (0.55, 0.16, 0.55), _TYRE, is_round=True)


def _cow(subject: Subject) -> Iterator[Solid]:
    hide = _HIDES[sum(map(ord, subject.name)) % len(_HIDES)]
    yield _part(subject, (-0.15, 0.0, 0.95), (0.95, 0.36, 0.42), hide, is_round=True)
    yield _part(subject, (0.95, 0.0, 1.1), (0.32, 0.16, 0.2), hide, is_round=True)
    for along in (-0.75, 0.45):
        for side in (-0.2, 0.2):
            yield _part(subject, (along, side, 0.35), (0.08, 0.08, 0.35), hide)


def _part(
    subject: Subject, ahead: Point, half: Point, colour: Colour, *, is_round: bool = False
) -> Solid:
    """A part of a subject: where it is from the middle, ahead, right and up [m]."""
    bearing = math.radians(subject.heading_deg)
    sine, cosine = math.sin(bearing), math.cos(bearing)
    place = Place(
        subject.place.east_m + ahead[0] * sine + ahead[1] * cosine,
        subject.place.north_m + ahead[0] * cosine - ahead[1] * sine,
    )
    return Solid((*place, ahead[2]), half, subject.heading_deg, colour, is_round=is_round)
