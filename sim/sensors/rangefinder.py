"""Laser range finder that looks along the body's down axis onto level ground.

A small single-point lidar such as drones carry for landing: 0.1 to 40 m, one sigma 2 cm and half
a percent of the distance (the class of the LightWare SF11/C and the Benewake TF03, whose data
sheets give 2 to 10 cm). Beyond its reach, or tilted to the sky, nothing comes back. The ground
is the level plane of home, the one that the vehicle lands on.
"""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from sim.physics.noise import standard_normals
from sim.physics.truth import Truth
from sim.sensors.readings import RangeReading

RATE_HZ: Final = 20
MINIMUM_M: Final = 0.1
MAXIMUM_M: Final = 40.0
WHITE_SIGMA_M: Final = 0.02
SCALE_SIGMA: Final = 0.005
_MOUNTED_M: Final = 0.1  # Above the feet: it never sees nothing on the ground


class RangeFinder:
    """`factor` scales every error alike."""

    def __init__(self, generator: np.random.Generator, *, factor: float) -> None:
        self._normals: Iterator[float] = standard_normals(generator)
        self._factor = factor

    def read(self, truth: Truth) -> RangeReading:
        """One sample; NaN when nothing comes back."""
        noise = next(self._normals)
        distance = slant_distance_m(truth)
        distance += self._factor * noise * (WHITE_SIGMA_M + SCALE_SIGMA * distance)
        is_in_range = MINIMUM_M <= distance <= MAXIMUM_M
        return RangeReading(truth.time_us, distance if is_in_range else math.nan)


def slant_distance_m(truth: Truth) -> float:
    """True distance [m] along the body's down axis; infinite when that points up."""
    _, x, y, _ = truth.q_ned_frd
    down = 1.0 - 2.0 * (x * x + y * y)  # Cosine of the tilt
    return (truth.height_above_home_m + _MOUNTED_M) / down if down > 0.0 else math.inf
