"""Error-state extended Kalman filter with the attitude error in the world frame.

After Sola 2017, "Quaternion kinematics for the error-state Kalman filter" (arXiv:1711.02508),
sections 5 to 7, from which the equation numbers are.

The nominal state is integrated at the rate of the inertial sensor, in plain floats. The
covariance follows every COVARIANCE_STEPS samples with the impulse summed up in between: its
entries change little in 16 ms, and a 20 by 20 product is the dearest thing here. Measurements
are scalars, fused one after the other, so that nothing is ever inverted.

This file uses no clock, topic or parameter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from uav_firmware.compiled import is_installed
from uav_firmware.lib.rotation import rotate, to_matrix
from uav_firmware.modules.estimator.kalman_filter.covariance import (
    Array,
    Covariance,
    Measurement,
    Transition,
)
from uav_firmware.modules.estimator.kalman_filter.covariance_arrays import ArrayCovariance
from uav_firmware.modules.estimator.kalman_filter.state import ATTITUDE, NominalState
from uav_firmware.msg.vectors import Vector3

COVARIANCE_STEPS: Final = 4
_LARGEST_VARIANCE: Final = 1e8  # [SI^2] 10 km of uncertainty: beyond it numbers lose their meaning


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Noise of the inertial sensors and of slow quantities."""

    accel: float  # [m/s^2] White noise of one sample, one sigma
    gyro: float  # [rad/s] White noise of one sample, one sigma
    accel_bias_walk: float  # [m/s^2/sqrt(s)]
    gyro_bias_walk: float  # [rad/s/sqrt(s)]
    baro_bias_walk: float  # [m/sqrt(s)]
    heading_bias_walk: float  # [rad/sqrt(s)]
    gps_height_sigma: float  # [m] Slow error of GPS height, stationary, one sigma
    gps_height_time: float  # [s] Its correlation time
    wind_walk: float = 0.0  # [m/s/sqrt(s)]


class ErrorStateEkf:
    """State, covariance, and the two things that happen to them: prediction and fusion."""

    def __init__(self, state: NominalState, sigmas: Array, noise: Noise, gravity: float) -> None:
        self.state = state
        self.noise = noise
        self.gravity = gravity  # [m/s^2]
        self.acceleration_ned: Vector3 = (0.0, 0.0, 0.0)  # [m/s^2] Over the last step
        self.turned_ned: Vector3 = (0.0, 0.0, 0.0)  # [rad] Sum of what `fuse` has turned by
        self.restarts = 0  # [-] How often the covariance had to be set up anew
        self._initial = np.diag(sigmas * sigmas)
        self._covariance = new_covariance(sigmas.tolist())
        self._added_for: tuple[Noise, float, float] | None = None
        self._impulse: Vector3 = (0.0, 0.0, 0.0)
        self._elapsed = 0.0
        self._steps = 0

    def predict(self, rate_frd: Vector3, specific_force_frd: Vector3, dt: float) -> Vector3:
        """Step the nominal state by dt [s] and give the change of velocity [m/s, NED].

        Sola 2017, eq. 260, with the specific force turned by the attitude at mid-step.
        """
        state = self.state
        half = 0.5 * dt
        wx, wy, wz = rate_frd
        bx, by, bz = state.gyro_bias_frd
        hx, hy, hz = half * (wx - bx), half * (wy - by), half * (wz - bz)
        fx, fy, fz = specific_force_frd
        bx, by, bz = state.accel_bias_frd
        fx, fy, fz = fx - bx, fy - by, fz - bz
        force_ned = rotate(
            state.q_ned_frd,
            (fx + hy * fz - hz * fy, fy + hz * fx - hx * fz, fz + hx * fy - hy * fx),
        )
        ax, ay, az = force_ned[0], force_ned[1], force_ned[2] + self.gravity
        change = (ax * dt, ay * dt, az * dt)
        vx, vy, vz = state.velocity_ned
        px, py, pz = state.position_ned
        state.position_ned = (
            px + dt * (vx + half * ax),
            py + dt * (vy + half * ay),
            pz + dt * (vz + half * az),
        )
        state.velocity_ned = (vx + change[0], vy + change[1], vz + change[2])
        self.acceleration_ned = (ax, ay, az)
        self._turn(hx, hy, hz)
        ix, iy, iz = self._impulse
        self._impulse = (ix + force_ned[0] * dt, iy + force_ned[1] * dt, iz + force_ned[2] * dt)
        self._elapsed += dt
        self._steps += 1
        if self._steps >= COVARIANCE_STEPS:
            self._propagate_covariance()
        return change

    def _turn(self, hx: float, hy: float, hz: float) -> None:
        """Turn by twice (hx, hy, hz) [rad]: eq. 101 to third order, kept at unit length."""
        w, x, y, z = self.state.q_ned_frd
        square = hx * hx + hy * hy + hz * hz
        cosine, scale = 1.0 - 0.5 * square, 1.0 - square / 6.0
        hx, hy, hz = scale * hx, scale * hy, scale * hz
        w, x, y, z = (
            w * cosine - x * hx - y * hy - z * hz,
            x * cosine + w * hx + y * hz - z * hy,
            y * cosine + w * hy + z * hx - x * hz,
            z * cosine + w * hz + x * hy - y * hx,
        )
        unit = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        self.state.q_ned_frd = (w * unit, x * unit, y * unit, z * unit)

    def _propagate_covariance(self) -> None:
        """Bring the covariance to the present (Sola 2017, eq. 269, Jacobian of section 7.2)."""
        elapsed, kept = self._elapsed, self._kept(self._elapsed)
        self._set_noise(elapsed, elapsed / self._steps)
        rotation = to_matrix(self.state.q_ned_frd)
        self._covariance.predict(Transition(elapsed, self._impulse, rotation, kept))
        self._impulse, self._elapsed, self._steps = (0.0, 0.0, 0.0), 0.0, 0
        self.state.gps_height_bias_m *= kept
        self._guard()

    def _kept(self, elapsed: float) -> float:
        """Share of the slow error of GPS height that is left after `elapsed` [s]."""
        return math.exp(-elapsed / self.noise.gps_height_time)

    def _set_noise(self, elapsed: float, dt: float) -> None:
        """Set the process noise (Sola 2017, eq. 262 to 265) of several samples.

        As long as samples come evenly it is the same every time.
        """
        noise = self.noise
        if self._added_for == (noise, elapsed, dt):
            return
        self._added_for = (noise, elapsed, dt)
        by_accel = noise.accel * noise.accel * dt * elapsed
        by_gyro = noise.gyro * noise.gyro * dt * elapsed
        by_accel_walk = noise.accel_bias_walk**2 * elapsed
        by_gyro_walk = noise.gyro_bias_walk**2 * elapsed
        by_wind = noise.wind_walk**2 * elapsed
        self._covariance.set_noise(
            [
                *(0.0, 0.0, 0.0),
                *(by_accel, by_accel, by_accel),
                *(by_gyro, by_gyro, by_gyro),
                *(by_accel_walk, by_accel_walk, by_accel_walk),
                *(by_gyro_walk, by_gyro_walk, by_gyro_walk),
                noise.baro_bias_walk**2 * elapsed,
                noise.heading_bias_walk**2 * elapsed,
                noise.gps_height_sigma**2 * (1.0 - self._kept(elapsed) ** 2),
                *(by_wind, by_wind),
            ]
        )

    def _guard(self) -> None:
        """Set the covariance up anew if rounding or an overflow has broken it."""
        variances = self._covariance.variances()
        # Neither min nor max is sure to find a NaN.
        whole = math.isfinite(sum(variances))
        if not (whole and min(variances) > 0.0 and max(variances) < _LARGEST_VARIANCE):
            self._covariance.replace(self._initial)
            self.restarts += 1

    def deviation(self, measurement: Measurement) -> float:
        """Expected size of an innovation, one sigma: sqrt(H P H' + V)."""
        return math.sqrt(self._covariance.expected(measurement.jacobian) + measurement.variance)

    def fuse(self, measurements: Sequence[Measurement]) -> None:
        """Correct the estimate.

        The Jacobian of the reset (Sola 2017, section 6.3) is left out: corrections of attitude
        are of a milliradian, its effect a thousandth of the covariance.
        """
        errors = self._covariance.fuse(measurements)
        self.state.inject(errors)
        x, y, z = self.turned_ned
        turned_x, turned_y, turned_z = errors[ATTITUDE]
        self.turned_ned = (x + turned_x, y + turned_y, z + turned_z)

    @property
    def covariance(self) -> Array:
        """A copy of the covariance of the errors; to be set as a whole."""
        return self._covariance.matrix()

    @covariance.setter
    def covariance(self, matrix: Array) -> None:
        self._covariance.replace(matrix)

    def forget(self, part: slice | int, sigma: float) -> None:
        """Set a part's uncertainty [SI], with no correlation to the rest: after a reset."""
        matrix = self._covariance.matrix()
        matrix[part, :] = 0.0
        matrix[:, part] = 0.0
        np.einsum("ii->i", matrix)[part] = sigma * sigma
        self._covariance.replace(matrix)

    def widen(self, index: int, sigma: float) -> None:
        """Add an independent error [SI, one sigma] to one of the state."""
        matrix = self._covariance.matrix()
        matrix[index, index] += sigma * sigma
        self._covariance.replace(matrix)

    def sigma(self, index: int) -> float:
        """Standard deviation of one error."""
        return math.sqrt(self._covariance.variance(index))


def new_covariance(sigmas: Sequence[float]) -> Covariance:
    """The kernel where it is compiled, else the one that is faster in the interpreter."""
    if is_installed():
        from uav_firmware.modules.estimator.kalman_filter.covariance_kernel import (  # noqa: PLC0415
            KernelCovariance,
        )

        return KernelCovariance(sigmas)
    return ArrayCovariance(sigmas)
