"""Barometer: reading = true pressure + turn-on offset + slow drift + white noise.

TE Connectivity MS5611-01BA03 data sheet: resolution 0.012 mbar rms (1.2 Pa, 0.10 m) at the
highest oversampling; absolute accuracy +-1.5 mbar, of which a third is taken as one sigma of
the offset. The drift, 6 Pa (0.5 m) with a correlation time of 600 s, stands for temperature
and for gusts that reach the case.
"""

from typing import Final

import numpy as np

from sim.sensors.noise import GaussMarkov, standard_normals
from sim.sensors.readings import BaroReading
from sim.truth import Truth

RATE_HZ: Final = 50
WHITE_SIGMA_PA: Final = 1.2
OFFSET_SIGMA_PA: Final = 50.0
DRIFT_SIGMA_PA: Final = 6.0
DRIFT_CORRELATION_TIME_S: Final = 600.0
_SELF_HEATING_C: Final = 8.0  # An autopilot's board is warmer than the air


class Barometer:
    """`factor` scales every error alike."""

    def __init__(self, generator: np.random.Generator, *, factor: float) -> None:
        self._normals = standard_normals(generator)
        self._offset_pa = OFFSET_SIGMA_PA * factor * next(self._normals)
        self._white_pa = WHITE_SIGMA_PA * factor
        self._drift = GaussMarkov(
            self._normals,
            sigma=DRIFT_SIGMA_PA * factor,
            correlation_time_s=DRIFT_CORRELATION_TIME_S,
            step_s=1.0 / RATE_HZ,
        )

    def read(self, truth: Truth) -> BaroReading:
        """One sample."""
        error_pa = self._offset_pa + self._drift.step() + self._white_pa * next(self._normals)
        return BaroReading(
            truth.time_us, truth.pressure_pa + error_pa, truth.temperature_c + _SELF_HEATING_C
        )
