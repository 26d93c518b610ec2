"""What stands between a camera and a subject. Pure.

Buildings and trees hide; the ground does not, since it is level wherever subjects go, nor does one
subject another.
"""

import math
from collections.abc import Iterator
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.camera.scene.orchard import crowns
from sim.camera.scene.solids import Point, Solid
from sim.camera.scene.structures import standing
from sim.world.farm import Farm
from sim.world.subjects import Subject

_LEVELS: Final = (0.25, 0.6, 0.95)
"""Parts of a subject's height that are looked at."""
_ENDS: Final = (-0.4, 0.0, 0.4)
"""Parts of its length."""


def share_in_sight(farm: Farm, camera: Point, subject: Subject) -> float:
    """How much of a subject is seen from a place, 0 to 1, by nine points of it.

    `camera` is east, north [m] on the farm's map and height [m] above the level ground, as the
    places of solids are.
    """
    between = _between(farm, camera, subject)
    if not between:
        return 1.0
    points = np.array(tuple(_points(subject)), dtype=np.float32)
    directions = points - np.array(camera, dtype=np.float32)
    hidden = np.zeros(len(points), dtype=np.bool_)
    for solid in between:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            hidden |= (
                solid.hits(camera, (directions[:, 0], directions[:, 1], directions[:, 2])).depth
                < 1.0
            )
    return 1.0 - float(hidden.mean())


def _points(subject: Subject) -> Iterator[Point]:
    bearing = math.radians(subject.heading_deg)
    east, north = math.sin(bearing), math.cos(bearing)
    for level in _LEVELS:
        for end in _ENDS:
            along = end * subject.length_m
            yield (
                subject.place.east_m + along * east,
                subject.place.north_m + along * north,
                level * subject.height_m,
            )


class _Hiding(NamedTuple):
    """What stands on a farm, and the spheres about it."""

    solids: tuple[Solid, ...]
    middles: NDArray[np.float64]  # [m]
    radii: NDArray[np.float64]  # [m]


@cache
def _hiding(seed: int) -> _Hiding:
    solids = (*standing(), *crowns(seed))
    middles = np.array([solid.middle for solid in solids])
    return _Hiding(solids, middles, np.array([solid.radius_m for solid in solids]))


def _between(farm: Farm, camera: Point, subject: Subject) -> list[Solid]:
    """Those whose spheres come near the line of sight."""
    solids, middles, radii = _hiding(farm.seed)
    start = np.array(camera)
    line = np.array((*subject.place, 0.5 * subject.height_m)) - start
    towards = middles - start
    share = np.clip(towards @ line / max(float(line @ line), 1e-9), 0.0, 1.0)
    aside = np.linalg.norm(towards - share[:, np.newaxis] * line, axis=1)
    near = aside < radii + max(subject.length_m, subject.height_m)
    return [solids[number] for number in np.flatnonzero(near)]
