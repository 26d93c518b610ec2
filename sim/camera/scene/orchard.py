"""The crowns of an orchard: each tree stands where its row says, as wide as the farm's map says.

They are drawn as they stand, with sides and a top, and so lean outward in a picture taken straight
down. Their shadows are the ground's (`ground.py`), which leaves out the crowns themselves.
"""

import math
from collections.abc import Iterator
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim.camera.scene.ground import TREES_FROM_EDGE_M, cover_share, quality
from sim.camera.scene.lens import Lens, Pixels, rotation
from sim.camera.scene.reflectance import LEAF
from sim.camera.scene.solids import Hits, Point, Solid
from sim.camera.scene.texture import grain
from sim.physics.truth import Quaternion, Vector3
from sim.world.farm import Farm
from sim.world.geometry import edge_distance_m
from sim.world.layout import FIELDS, Cover, Field
from sim.world.plane import Place
from sim.world.smooth_map import Layer, SmoothMap

_TRUNK_M: Final = 0.9
"""From the ground to the lowest leaves [m]."""
_RAGGED, _UNEVEN = 0.30, 0.22  # The rim and the brightness of crowns
_SLANTS: Final = ((0.6, -1.0), (-0.9, -0.7))
"""Two mappings of the ground's texture on a crown: where one draws streaks the other does not."""
_WIDEST_M: Final = 4.0
"""No crown reaches farther from its middle."""
_COARSEST_M: Final = 2.5
"""Where pixels are larger than this on the ground, no crown is drawn."""


@cache
def crowns(seed: int) -> tuple[Solid, ...]:
    """Every tree of the orchards of a seed's farm."""
    return tuple(
        crown for field in FIELDS if field.cover is Cover.OLIVES for crown in _of_field(field, seed)
    )


def crowns_ahead(
    farm: Farm,
    lens: Lens,
    q_ned_camera: Quaternion,
    camera: Point,
    stretch: tuple[float, float],
) -> Iterator[tuple[Solid, Vector3]]:
    """Crowns before the camera and how far off they are, north, east, down [m]; nearest first.

    `camera` is its place on the map and its height [m], `stretch` metres of the map in a metre east
    and north. Where a pixel is as large as a crown there are none: the ground is evenly green.
    """
    middles = _middles(farm.seed)
    away = middles - np.array(camera)
    offsets = np.stack((away[:, 1] / stretch[1], away[:, 0] / stretch[0], -away[:, 2]), axis=1)
    forward = offsets @ rotation(q_ned_camera)[:, 0]
    distance = np.linalg.norm(offsets, axis=1)
    seen = (forward > -_WIDEST_M) & (distance * lens.pixel < _COARSEST_M)
    for number in np.flatnonzero(seen)[np.argsort(distance[seen])]:
        north, east, down = offsets[number]
        yield crowns(farm.seed)[number], (float(north), float(east), float(down))


def leaves(
    seed: int,
    camera: Point,
    direction: tuple[Pixels, Pixels, Pixels],
    hits: Hits,
    shown: NDArray[np.bool_],
    pixel: float,
) -> Pixels:
    """How bright a crown's leaves are where it is shown; its ragged rim is taken out of `shown`."""
    depth, directions = hits.depth[shown], [part[shown] for part in direction]
    east, north, up = (np.float32(a) + depth * b for a, b in zip(camera, directions, strict=True))
    size = float(np.median(depth)) * pixel
    texture = np.zeros(depth.shape, dtype=np.float32)
    for lean, rise in _SLANTS:
        slanted = east + np.float32(lean) * up, north + np.float32(rise) * up
        texture += np.float32(0.7) * grain(seed, *slanted, size)
    facing = -(
        hits.normal_east[shown] * directions[0]
        + hits.normal_north[shown] * directions[1]
        + hits.normal_up[shown] * directions[2]
    )
    facing /= np.sqrt(directions[0] ** 2 + directions[1] ** 2 + directions[2] ** 2)
    kept = facing > np.float32(_RAGGED) * (1.0 + texture)
    shown[shown] = kept
    brightness: Pixels = 1.0 + np.float32(_UNEVEN) * texture[kept]
    return brightness


@cache
def _middles(seed: int) -> NDArray[np.float64]:
    return np.array([crown.middle for crown in crowns(seed)])


def _of_field(field: Field, seed: int) -> list[Solid]:
    places = _places(field)
    east, north = (np.array(part) for part in zip(*places, strict=True))
    good = quality(
        SmoothMap(seed, Layer.MOISTURE).over(east, north).astype(np.float32),
        SmoothMap(seed, Layer.VIGOUR).over(east, north).astype(np.float32),
    )
    shares = cover_share(good, field.vigour, field.gap_vigour)
    radii = np.sqrt(shares * field.row_spacing_m * field.plant_spacing_m / math.pi)
    half_m = 0.5 * (field.crop_height_m - _TRUNK_M)
    colour = (float(LEAF.red), float(LEAF.green), float(LEAF.blue), float(LEAF.near_infrared))
    return [
        Solid(
            (place.east_m, place.north_m, _TRUNK_M + half_m),
            (float(radius), float(radius), half_m),
            0.0,
            colour,
            is_round=True,
            is_leafy=True,
        )
        for place, radius in zip(places, radii, strict=True)
    ]


def _places(field: Field) -> list[Place]:
    """Where the trees of a field stand: whole spacings along and across from the map's origin."""
    (east_x, north_x), (east_y, north_y) = field.across, field.along
    reach = max(math.hypot(*corner) for corner in field.boundary)
    rows, plants = reach / field.row_spacing_m, reach / field.plant_spacing_m
    found = []
    for row in range(-math.ceil(rows), math.ceil(rows) + 1):
        for plant in range(-math.ceil(plants), math.ceil(plants) + 1):
            across, along = row * field.row_spacing_m, plant * field.plant_spacing_m
            place = Place(across * east_x + along * east_y, across * north_x + along * north_y)
            if edge_distance_m(field.boundary, place) > TREES_FROM_EDGE_M:
                found.append(place)
    return found
