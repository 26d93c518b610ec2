"""The barometer: fast and smooth height between the slow, rough ones of GPS.

The measured quantity is the pressure altitude of the standard atmosphere above its mean while
the origin was set, [m]: h(x) = -p_down + baro_bias. Weather, and an air column warmer or colder
than the standard's, move it slowly; the state `baro_bias` follows that movement with the help of
GPS.

A barometer that disagrees is stopped (`gate.Aid`). With EKF2_HGT_REF 0, or without a receiver that
could replace it, the height is reset to it when no source of height has helped for RESET_AFTER_S
(PX4 `baro_height_control.cpp`).
"""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.lib.atmosphere import altitude_from_pressure
from uav_firmware.modules.estimator.ekf_core import AID_INTERVAL_US, RESET_AFTER_S, EkfCore
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement, jacobian
from uav_firmware.modules.estimator.kalman_filter.gate import Aid
from uav_firmware.modules.estimator.kalman_filter.state import BARO_BIAS, DOWN, NominalState
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.sensors import SensorBaro

_MEAN_HZ: Final = 0.2  # Averages about 40 samples at 25 Hz
_PRESSURE_PA: Final = (20_000.0, 115_000.0)  # [Pa] 11.8 km up to the Dead Sea in a high
_FROZEN_AFTER_S: Final = 2.0

_ROW: Final = jacobian(position=(0.0, 0.0, -1.0), baro_bias=1.0)


def pressure_altitude(pressure_pa: float) -> float | None:
    """Altitude in the standard atmosphere [m], None for what no barometer on Earth shows."""
    if not _PRESSURE_PA[0] <= pressure_pa <= _PRESSURE_PA[1]:
        return None
    return altitude_from_pressure(pressure_pa)


def height_measurement(state: NominalState, height_m: float, sigma: float) -> Sequence[Measurement]:
    """Barometric height above the origin [m]."""
    expected = state.baro_bias_m - state.position_ned[DOWN]
    return (Measurement(height_m - expected, _ROW, sigma * sigma),)


def _share(cutoff_hz: float, dt: float) -> float:
    """Share of the difference to the input that is covered in dt [s]; 1 without a cut-off."""
    if cutoff_hz <= 0.0:
        return 1.0
    return -math.expm1(-math.tau * cutoff_hz * dt)


class LowPass:
    """First-order low pass for a number. Starts at its first input; a cut-off of 0 passes all.

    y follows x with dy/dt = (x - y) / tau, tau = 1 / (2 pi f). The step is solved exactly for an
    input held constant over it, so the filter is stable for any dt and never overshoots.
    """

    __slots__ = ("_cutoff_hz", "_dt", "_gain", "value")

    def __init__(self, cutoff_hz: float, value: float | None = None) -> None:
        self._cutoff_hz = cutoff_hz
        self._dt = math.nan
        self._gain = 1.0
        self.value = value

    def update(self, sample: float, dt: float) -> float:
        """Filter a sample that holds since dt [s]; return the output."""
        if dt != self._dt:
            self._dt, self._gain = dt, _share(self._cutoff_hz, dt)
        held = sample if self.value is None else self.value
        self.value = held + self._gain * (sample - held)
        return self.value


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
        """Use a sample; true from 2 s of exact repetition on until it changes."""
        self.repeated = pressure_pa == self._value
        if not self.repeated:
            self._value, self._since_us = pressure_pa, time_us
        self.frozen = (time_us - self._since_us) * 1e-6 >= _FROZEN_AFTER_S
        return self.frozen


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

    def update(self, core: EkfCore, baro: SensorBaro, *, failed: bool) -> None:
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
            self.height.ready_us = baro.time_us + AID_INTERVAL_US
            self._fuse(core, altitude - self._reference_m, failed=failed)

    def _average(self, altitude: float, time_us: int) -> None:
        dt = 0.0 if self._last_us is None else (time_us - self._last_us) * 1e-6
        self._last_us = time_us
        self._mean.update(altitude, max(dt, 0.0))

    def _start(self, core: EkfCore, altitude: float) -> None:
        """Set the mean up to the origin as zero; without one, the present height."""
        if self._mean.value is None:
            self._reference_m = altitude + core.state.position_ned[DOWN]
            sigma = core.ekf.sigma(DOWN) + self._params.baro_noise
        else:
            self._reference_m = self._mean.value
            sigma = 0.25 * self._params.baro_noise
        core.state.baro_bias_m = 0.0
        core.ekf.forget(BARO_BIAS, sigma)

    def _fuse(self, core: EkfCore, height_m: float, *, failed: bool) -> None:
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
