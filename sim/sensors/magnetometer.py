"""Magnetometer: reading = Earth's field + hard iron + field of the supply current + white noise.

The noise, 3 mgauss (0.3 uT) rms, is that of an iSentek IST8310, the magnetometer of most GPS
pucks; the hard iron is what a good calibration leaves, 3 mgauss per axis, about half a degree
of heading at this latitude.

The current in the supply leads makes a field of its own in the body frame, in proportion to it:
0.4 mgauss/A per axis, 4 mgauss in hover. That is 10 % of the Earth's field at full throttle, a
compass on a mast away from the leads; ArduPilot's compassmot calls up to 30 % acceptable.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from sim.physics.noise import normal_vector, standard_normals
from sim.physics.truth import Truth, Vector3, body_from_ned
from sim.sensors.readings import MagReading

RATE_HZ: Final = 50
WHITE_SIGMA_GAUSS: Final = 3e-3
HARD_IRON_SIGMA_GAUSS: Final = 3e-3
CURRENT_SIGMA_GAUSS_A: Final = 0.4e-3


class Magnetometer:
    """`factor` scales every error alike; `supply_current_a` gives the current [A] of the pack.

    The Earth's field is taken as the same over the farm: a kilometre changes it by some
    thousandths of a degree of declination and hundredths of inclination.
    """

    def __init__(
        self,
        generator: np.random.Generator,
        *,
        factor: float,
        field_ned_gauss: Vector3,
        supply_current_a: Callable[[], float],
    ) -> None:
        self._field_ned_gauss = field_ned_gauss
        self._normals = standard_normals(generator)
        self._hard_iron_gauss = normal_vector(self._normals, HARD_IRON_SIGMA_GAUSS * factor)
        self._per_ampere = normal_vector(self._normals, CURRENT_SIGMA_GAUSS_A * factor)
        self._supply_current_a = supply_current_a
        self._white_gauss = WHITE_SIGMA_GAUSS * factor

    def read(self, truth: Truth) -> MagReading:
        """One sample."""
        x, y, z = body_from_ned(truth.q_ned_frd, self._field_ned_gauss)
        iron_x, iron_y, iron_z = self._hard_iron_gauss
        current_a = self._supply_current_a()
        lead_x, lead_y, lead_z = self._per_ampere
        noise_x, noise_y, noise_z = normal_vector(self._normals, self._white_gauss)
        return MagReading(
            truth.time_us,
            (
                x + iron_x + lead_x * current_a + noise_x,
                y + iron_y + lead_y * current_a + noise_y,
                z + iron_z + lead_z * current_a + noise_z,
            ),
        )
