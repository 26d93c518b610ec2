"""Measurement model of the barometer: h(x) = -p_down + baro_bias.

The measured quantity is the pressure altitude of the standard atmosphere above its mean while
the origin was set, [m]. Weather, and an air column warmer or colder than the standard's, move
it slowly; the state `baro_bias` follows that movement with the help of GPS.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from uav_firmware.lib.atmosphere import altitude_from_pressure
from uav_firmware.modules.estimator.ekf import Measurement
from uav_firmware.modules.estimator.state import BARO_BIAS, DOWN, SIZE, NominalState

_PRESSURE_PA: Final = (20_000.0, 115_000.0)  # [Pa] 11.8 km up to the Dead Sea in a high
_FROZEN_AFTER_S: Final = 2.0

_ROW: Final = np.zeros(SIZE)
_ROW[DOWN] = -1.0
_ROW[BARO_BIAS] = 1.0


def pressure_altitude(pressure_pa: float) -> float | None:
    """Altitude in the standard atmosphere [m], None for what no barometer on Earth shows."""
    if not _PRESSURE_PA[0] <= pressure_pa <= _PRESSURE_PA[1]:
        return None
    return altitude_from_pressure(pressure_pa)


def height_measurement(state: NominalState, height_m: float, sigma: float) -> Sequence[Measurement]:
    """Barometric height above the origin [m]."""
    expected = state.baro_bias_m - state.position_ned[DOWN]
    return (Measurement(height_m - expected, _ROW, sigma * sigma),)


class FrozenDetector:
    """Notices a barometer that repeats itself to the last digit, as a live one never does for long.

    A repeated value is not used at all: until it is known to be frozen, a barometer that stops in
    a climb would teach the filter a vertical velocity of none.
    """

    def __init__(self) -> None:
        self.frozen = False  # At the last sample
        self.repeated = False  # The last sample equals the one before
        self._value = math.nan
        self._since_us = 0

    def is_frozen(self, pressure_pa: float, time_us: int) -> bool:
        """Take a sample; true from 2 s of exact repetition on until it changes."""
        self.repeated = pressure_pa == self._value
        if not self.repeated:
            self._value, self._since_us = pressure_pa, time_us
        self.frozen = (time_us - self._since_us) * 1e-6 >= _FROZEN_AFTER_S
        return self.frozen
