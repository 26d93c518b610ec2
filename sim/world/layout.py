"""What lies where on the farm, in metres east and north of its origin. Data.

The origin is home: the vehicles stand on the yard between the north field and the track. The
field boundaries are convex and run counter-clockwise, seen from above.
"""

import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

from sim.world.plane import Place


class Cover(Enum):
    """What grows or lies on a piece of ground."""

    MAIZE = "maize"
    VINES = "vines"
    BARLEY = "barley"
    OLIVES = "olives"
    PASTURE = "pasture"


@dataclass(frozen=True)
class Field:
    """A piece of land under one crop."""

    number: int  # [-] From 1
    name: str
    cover: Cover
    boundary: tuple[Place, ...]  # [m] Convex, counter-clockwise
    row_bearing_deg: float  # [deg] Where the rows run to, from true north
    row_spacing_m: float  # [m] 0: not sown in rows
    plant_spacing_m: float  # [m] Along the row
    crop_height_m: float  # [m]
    drip_every: int  # [-] A drip line along every so many rows; 0: not irrigated
    vigour: float  # [-] NDVI of leaves and gaps together where the ground is average
    gap_vigour: float  # [-] NDVI of the ground between the plants
    moisture: float  # [m^3/m^3] Of the soil, on average

    @cached_property
    def across(self) -> tuple[float, float]:
        """Unit vector (east, north) across the rows, to the right of their bearing."""
        bearing = math.radians(self.row_bearing_deg)
        return math.cos(bearing), -math.sin(bearing)

    @cached_property
    def along(self) -> tuple[float, float]:
        """Unit vector (east, north) along the rows."""
        bearing = math.radians(self.row_bearing_deg)
        return math.sin(bearing), math.cos(bearing)

    @cached_property
    def area_m2(self) -> float:
        """Area of the field [m^2], by the shoelace formula."""
        pairs = pairwise([*self.boundary, self.boundary[0]])
        return 0.5 * sum(a.east_m * b.north_m - b.east_m * a.north_m for a, b in pairs)


class Track(NamedTuple):
    """A dirt road."""

    name: str
    centre_line: tuple[Place, ...]  # [m]
    width_m: float  # [m]


class Building(NamedTuple):
    """A box on the ground, visible to the camera; vehicles do not collide with it."""

    name: str
    middle: Place  # [m]
    length_m: float  # [m] Along its bearing
    width_m: float  # [m]
    height_m: float  # [m]
    bearing_deg: float  # [deg]
    colour: tuple[float, float, float]  # [-] Reflectance: red, green, blue


class Tree(NamedTuple):
    """A tree with a round crown."""

    middle: Place  # [m]
    radius_m: float  # [m] Of the crown
    height_m: float  # [m] Of the crown's top


def _corners(*places: tuple[float, float]) -> tuple[Place, ...]:
    return tuple(Place(*place) for place in places)


FIELDS: Final = (
    Field(
        1, "North field", Cover.MAIZE,
        _corners((-70.0, 9.0), (95.0, 9.0), (99.0, 136.0), (-62.0, 141.0)),
        row_bearing_deg=4.0, row_spacing_m=0.75, plant_spacing_m=0.2,
        crop_height_m=0.7, drip_every=2, vigour=0.62, gap_vigour=0.08, moisture=0.26,
    ),
    Field(
        2, "South vineyard", Cover.VINES,
        _corners((-72.0, -112.0), (58.0, -106.0), (64.0, -17.0), (-70.0, -17.0)),
        row_bearing_deg=87.0, row_spacing_m=2.6, plant_spacing_m=1.2,
        crop_height_m=1.7, drip_every=1, vigour=0.44, gap_vigour=0.22, moisture=0.19,
    ),
    Field(
        3, "East pasture", Cover.PASTURE,
        _corners((113.0, -66.0), (226.0, -72.0), (232.0, 120.0), (116.0, 132.0)),
        row_bearing_deg=0.0, row_spacing_m=0.0, plant_spacing_m=0.0,
        crop_height_m=0.12, drip_every=0, vigour=0.50, gap_vigour=0.12, moisture=0.22,
    ),
    Field(
        4, "West olive grove", Cover.OLIVES,
        _corners((-205.0, -96.0), (-86.0, -104.0), (-82.0, 132.0), (-198.0, 124.0)),
        row_bearing_deg=12.0, row_spacing_m=7.0, plant_spacing_m=7.0,
        crop_height_m=4.0, drip_every=0, vigour=0.36, gap_vigour=0.15, moisture=0.15,
    ),
    Field(
        5, "South-east barley", Cover.BARLEY,
        _corners((76.0, -168.0), (218.0, -160.0), (222.0, -84.0), (78.0, -78.0)),
        row_bearing_deg=96.0, row_spacing_m=0.15, plant_spacing_m=0.03,
        crop_height_m=0.6, drip_every=0, vigour=0.55, gap_vigour=0.10, moisture=0.17,
    ),
)  # fmt: skip

TRACKS: Final = (
    Track("Main track", _corners((-240.0, -11.0), (109.0, -11.0)), 4.0),
    Track("East track", _corners((109.0, -180.0), (105.0, 0.0), (108.0, 150.0)), 3.6),
    Track("Headland", _corners((-76.0, 5.5), (101.0, 5.5)), 3.0),
    Track("West track", _corners((-76.0, -11.0), (-77.0, 146.0), (108.0, 141.0)), 3.0),
)

BUILDINGS: Final = (
    Building("Barn", Place(-46.0, -2.5), 18.0, 9.0, 5.0, 90.0, (0.52, 0.22, 0.16)),
    Building("Pump house", Place(-63.0, -3.0), 4.0, 3.0, 2.6, 90.0, (0.60, 0.58, 0.54)),
    Building("Water tank", Place(-68.5, -2.0), 3.0, 3.0, 3.4, 90.0, (0.30, 0.42, 0.55)),
)

TREES: Final = (
    Tree(Place(-30.5, -6.5), 2.4, 5.0),
    Tree(Place(-24.5, -7.5), 1.8, 3.8),
    *(
        Tree(Place(112.0 + 0.02 * north, float(north)), 2.2 + 0.3 * math.sin(north), 5.5)
        for north in range(-60, 130, 13)
    ),
)

PAD_HALF_M: Final = 0.6
"""Half the side of the concrete slab that a vehicle stands on [m]."""
PADS: Final = tuple(Place(3.0 * number, 0.0) for number in range(20))
YARD: Final = _corners((-72.0, -9.0), (70.0, -9.0), (70.0, 7.0), (-72.0, 7.0))
"""Trodden ground around home."""
