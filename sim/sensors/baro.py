"""Barometer: reading = true pressure + turn-on offset + slow drift - suction + white noise.

TE Connectivity MS5611-01BA03 data sheet: resolution 0.012 mbar rms (1.2 Pa, 0.10 m) at the
highest oversampling; absolute accuracy +-1.5 mbar, of which a third is taken as one sigma of
the offset.

The drift is that of still air, 3 Pa (0.25 m) with a correlation time of 600 s. Half of it is
temperature: 0.6 Pa/K, which the Bosch BMP390 data sheet gives as typical, times a few kelvins of
a case that warms up on the ground and cools in its own draught. The rest is weather: in ten
minutes the pressure changes by 3 Pa when it falls by 0.2 hPa in an hour.

Moving air sucks at the case: a tenth of the dynamic pressure is missing inside, a calm figure for
vents on the sides (PX4's EKF2_PCOEF_XP and its likes correct up to half of it). That is 0.2 m of
height at 6 m/s, and gusts make it noise.
"""

from typing import Final

import numpy as np

from sim.physics.noise import GaussMarkov, standard_normals
from sim.physics.truth import Truth
from sim.physics.units import ZERO_CELSIUS_K
from sim.sensors.readings import BaroReading

RATE_HZ: Final = 50
WHITE_SIGMA_PA: Final = 1.2
OFFSET_SIGMA_PA: Final = 50.0
DRIFT_SIGMA_PA: Final = 3.0
DRIFT_CORRELATION_TIME_S: Final = 600.0
SUCTION_SHARE: Final = 0.1  # Of the dynamic pressure
_SELF_HEATING_C: Final = 8.0  # An autopilot's board is warmer than the air
_DRY_AIR_J_KG_K: Final = 287.05


class Barometer:
    """`factor` scales every error alike."""

    def __init__(self, generator: np.random.Generator, *, factor: float) -> None:
        self._normals = standard_normals(generator)
        self._offset_pa = OFFSET_SIGMA_PA * factor * next(self._normals)
        self._white_pa = WHITE_SIGMA_PA * factor
        self._suction = 0.5 * SUCTION_SHARE * factor
        self._drift = GaussMarkov(
            self._normals,
            sigma=DRIFT_SIGMA_PA * factor,
            correlation_time_s=DRIFT_CORRELATION_TIME_S,
            step_s=1.0 / RATE_HZ,
        )

    def read(self, truth: Truth) -> BaroReading:
        """One sample."""
        kelvin = truth.temperature_c + ZERO_CELSIUS_K
        density = truth.pressure_pa / (_DRY_AIR_J_KG_K * kelvin)
        suction_pa = self._suction * density * truth.airspeed_m_s * truth.airspeed_m_s
        noise_pa = self._drift.step() + self._white_pa * next(self._normals)
        error_pa = self._offset_pa + noise_pa - suction_pa
        return BaroReading(
            truth.time_us, truth.pressure_pa + error_pa, truth.temperature_c + _SELF_HEATING_C
        )
