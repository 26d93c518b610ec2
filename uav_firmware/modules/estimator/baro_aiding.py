"""The barometer at work: fast and smooth height between the slow, rough ones of GPS.

One that disagrees is stopped (`gate.Aid`). With EKF2_HGT_REF 0, or without a receiver that could
take the part, the height is reset to it when no source of height has helped for RESET_AFTER_S.
"""

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

    @property
    def frozen(self) -> bool:
        """Whether it repeats itself and is therefore not used."""
        return self._frozen.frozen

    def take(self, core: Core, baro: SensorBaro, *, failed: bool) -> None:
        """Use a sample, if it is one that a working barometer could give.

        `failed` says that no source of height helps: then the height is reset to this one.
        """
        altitude = pressure_altitude(baro.pressure_pa)
        if altitude is None or self._frozen.is_frozen(baro.pressure_pa, baro.time_us):
            return
        if core.origin is None:
            self._average(altitude, baro.time_us)
        elif self._reference_m is None:
            self._start(core, altitude)
        elif baro.time_us >= self.height.ready_us and not self._frozen.repeated:
            self.height.ready_us = baro.time_us + _INTERVAL_US
            self._fuse(core, altitude - self._reference_m, failed=failed)

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

    def _fuse(self, core: Core, height_m: float, *, failed: bool) -> None:
        sigma, aid, now_us = self._params.baro_noise, self.height, core.time_us
        measured = height_measurement(core.state, height_m, sigma)
        if aid.fuse(core.ekf, measured, now_us):
            return
        if failed:
            core.reset_log.move_vertically(core.state, -measured[0].innovation)
            core.ekf.forget(DOWN, core.ekf.sigma(BARO_BIAS) + sigma)
            aid.accept(now_us)
        elif core.standing and aid.rejected_s(now_us) > RESET_AFTER_S:
            core.state.baro_bias_m += measured[0].innovation
            core.ekf.forget(BARO_BIAS, core.ekf.sigma(DOWN) + sigma)
            aid.accept(now_us)
