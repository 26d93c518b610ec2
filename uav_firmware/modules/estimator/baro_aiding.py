"""The barometer at work: fast and smooth height between the slow, rough ones of GPS."""

from typing import Final

from uav_firmware.lib.filters import LowPass
from uav_firmware.modules.estimator.core import RESET_AFTER_S, Core
from uav_firmware.modules.estimator.fuse_baro import (
    FrozenDetector,
    height_measurement,
    pressure_altitude,
)
from uav_firmware.modules.estimator.gate import Aid
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.modules.estimator.state import BARO_BIAS, DOWN
from uav_firmware.msg.sensors import SensorBaro

_MEAN_HZ: Final = 0.2  # Averages about 40 samples at 25 Hz
_INTERVAL_US: Final = 36_000  # 25 Hz are enough, with room for a clock that is a little fast


class BaroAiding:
    """Keeps the pressure altitude of the origin, then fuses heights above it."""

    def __init__(self, params: EstimatorParams) -> None:
        self.height = Aid(params.baro_gate)
        self._params = params
        self._mean = LowPass(_MEAN_HZ)
        self._reference_m: float | None = None
        self._frozen = FrozenDetector()
        self._last_us: int | None = None

    def configure(self, params: EstimatorParams) -> None:
        """Work with changed parameters from now on."""
        self._params = params
        self.height.gate = params.baro_gate

    def take(self, core: Core, baro: SensorBaro) -> None:
        """Use a sample, if it is one that a working barometer could give."""
        altitude = pressure_altitude(baro.pressure_pa)
        if altitude is None or self._frozen.is_frozen(baro.pressure_pa, baro.time_us):
            return
        if core.origin is None:
            self._average(altitude, baro.time_us)
        elif self._reference_m is None:
            self._start(core, altitude)
        elif baro.time_us >= self.height.ready_us:
            self.height.ready_us = baro.time_us + _INTERVAL_US
            self._fuse(core, altitude - self._reference_m)

    def _average(self, altitude: float, time_us: int) -> None:
        dt = 0.0 if self._last_us is None else (time_us - self._last_us) * 1e-6
        self._last_us = time_us
        self._mean.update(altitude, max(dt, 0.0))

    def _start(self, core: Core, altitude: float) -> None:
        """Take the mean up to the origin as zero; without one, the present height."""
        if self._mean.value is None:
            self._reference_m = altitude + core.state.position_ned[DOWN]
            sigma = core.ekf.sigma(DOWN) + self._params.baro_noise
        else:
            self._reference_m = self._mean.value
            sigma = 0.25 * self._params.baro_noise
        core.state.baro_bias_m = 0.0
        core.ekf.forget(BARO_BIAS, sigma)

    def _fuse(self, core: Core, height_m: float) -> None:
        sigma, aid, now_us = self._params.baro_noise, self.height, core.time_us
        measured = height_measurement(core.state, height_m, sigma)
        if aid.fuse(core.ekf, measured, now_us) or aid.rejected_s(now_us) <= RESET_AFTER_S:
            return
        core.state.baro_bias_m += measured[0].innovation
        core.ekf.forget(BARO_BIAS, core.ekf.sigma(DOWN) + sigma)
        aid.accept(now_us)
