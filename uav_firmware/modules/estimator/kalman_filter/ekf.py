"""Error-state extended Kalman filter with the attitude error in the world frame.

After Sola 2017, "Quaternion kinematics for the error-state Kalman filter" (arXiv:1711.02508),
sections 5 to 7, from which the equation numbers are.

The nominal state is integrated at the rate of the inertial sensor, in plain floats. The
covariance follows every COVARIANCE_STEPS samples with the impulse summed up in between: its
entries change little in 16 ms, and a 20 by 20 product is the dearest thing here. Measurements
are scalars, fused one after the other, so that nothing is ever inverted. Each call of numpy costs
more than what it computes here; so they are few, and work in place.

This file uses no clock, topic or parameter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_firmware.lib.rotation import rotate, to_matrix
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_BIAS,
    GPS_HEIGHT_BIAS,
    GYRO_BIAS,
    HEADING_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
    WIND,
    NominalState,
    places,
)
from uav_firmware.msg.vectors import Vector3

Array = NDArray[np.float64]

COVARIANCE_STEPS: Final = 4
_HALF: Final = np.array(0.5)  # A number of Python's would be converted in every call
_LARGEST_VARIANCE: Final = 1e8  # [SI^2] 10 km of uncertainty: beyond it numbers lose their meaning
_COUPLINGS: Final = np.array(
    [
        *places(POSITION, VELOCITY)[::4],  # Its diagonal
        *places(VELOCITY, ATTITUDE),
        *places(POSITION, ATTITUDE),
        *places(VELOCITY, ACCEL_BIAS),
        *places(POSITION, ACCEL_BIAS),
        *places(ATTITUDE, GYRO_BIAS),
        GPS_HEIGHT_BIAS * SIZE + GPS_HEIGHT_BIAS,
    ]
)
"""Where the transition differs from the identity."""


class Measurement(NamedTuple):
    """One scalar measurement, linearised at the present estimate."""

    innovation: float  # Measured minus expected
    jacobian: Array  # Row H of length SIZE: change of the expectation per error
    variance: float  # Of the measurement noise


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
        self.covariance = self._initial.copy()  # Changed in place, never replaced
        self._variances = self.covariance.reshape(-1)[:: SIZE + 1]  # Its diagonal
        self._transition = np.eye(SIZE)
        self._transition_transposed = self._transition.T  # Views, made once
        self._product = np.empty((SIZE, SIZE))
        # While a measurement is fused: its covariance with each error and the gain, each as a
        # vector and as the matrix that BLAS takes for an outer product.
        self._shared, self._gain = np.empty(SIZE), np.empty(SIZE)
        self._shared_row, self._gain_column = self._shared.reshape(1, -1), self._gain.reshape(-1, 1)
        self._spread = np.empty((SIZE, SIZE))
        self._spread_transposed = self._spread.T
        self._added = np.zeros(SIZE)
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
        elapsed, covariance, spread = self._elapsed, self.covariance, self._spread
        self._transition.put(_COUPLINGS, self._couplings(elapsed))
        self._transition.dot(covariance, self._product).dot(self._transition_transposed, spread)
        np.add(spread, self._spread_transposed, covariance)
        np.multiply(covariance, _HALF, covariance)
        self._variances += self._added_variance(elapsed, elapsed / self._steps)
        self._impulse, self._elapsed, self._steps = (0.0, 0.0, 0.0), 0.0, 0
        self.state.gps_height_bias_m *= self._kept(elapsed)
        self._guard()

    def _kept(self, elapsed: float) -> float:
        """Share of the slow error of GPS height that is left after `elapsed` [s]."""
        return math.exp(-elapsed / self.noise.gps_height_time)

    def _couplings(self, elapsed: float) -> list[float]:
        """Entries of the transition over `elapsed` [s], in the order of `_COUPLINGS`.

        A tilt turns the impulse, velocity by its vector product; biases enter in body axes.
        """
        ix, iy, iz = self._impulse
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = to_matrix(self.state.q_ned_frd)
        xx, xy, xz = -elapsed * xx, -elapsed * xy, -elapsed * xz
        yx, yy, yz = -elapsed * yx, -elapsed * yy, -elapsed * yz
        zx, zy, zz = -elapsed * zx, -elapsed * zy, -elapsed * zz
        half = 0.5 * elapsed
        jx, jy, jz = half * ix, half * iy, half * iz
        turned = (xx, xy, xz, yx, yy, yz, zx, zy, zz)
        return [
            *(elapsed, elapsed, elapsed),
            *(0.0, iz, -iy, -iz, 0.0, ix, iy, -ix, 0.0),
            *(0.0, jz, -jy, -jz, 0.0, jx, jy, -jx, 0.0),
            *turned,
            *(half * xx, half * xy, half * xz),
            *(half * yx, half * yy, half * yz),
            *(half * zx, half * zy, half * zz),
            *turned,
            self._kept(elapsed),
        ]

    def _added_variance(self, elapsed: float, dt: float) -> Array:
        """Diagonal of the process noise (Sola 2017, eq. 262 to 265) of several samples.

        As long as samples come evenly it is the same every time.
        """
        noise, added = self.noise, self._added
        if self._added_for != (noise, elapsed, dt):
            self._added_for = (noise, elapsed, dt)
            added[VELOCITY] = noise.accel * noise.accel * dt * elapsed
            added[ATTITUDE] = noise.gyro * noise.gyro * dt * elapsed
            added[ACCEL_BIAS] = noise.accel_bias_walk**2 * elapsed
            added[GYRO_BIAS] = noise.gyro_bias_walk**2 * elapsed
            added[BARO_BIAS] = noise.baro_bias_walk**2 * elapsed
            added[WIND] = noise.wind_walk**2 * elapsed
            added[HEADING_BIAS] = noise.heading_bias_walk**2 * elapsed
            added[GPS_HEIGHT_BIAS] = noise.gps_height_sigma**2 * (1.0 - self._kept(elapsed) ** 2)
        return added

    def _guard(self) -> None:
        """Set the covariance up anew if rounding or an overflow has broken it."""
        variances: list[float] = self._variances.tolist()
        # Neither min nor max is sure to find a NaN.
        whole = math.isfinite(sum(variances))
        if not (whole and min(variances) > 0.0 and max(variances) < _LARGEST_VARIANCE):
            self.covariance[:] = self._initial
            self.restarts += 1

    def deviation(self, measurement: Measurement) -> float:
        """Expected size of an innovation, one sigma: sqrt(H P H' + V)."""
        row = measurement.jacobian
        return math.sqrt(float(self.covariance.dot(row).dot(row)) + measurement.variance)

    def fuse(self, measurements: Sequence[Measurement]) -> None:
        """Correct the estimate (Sola 2017, eq. 274 to 276), one scalar after the other.

        The Jacobian of the reset (section 6.3) is left out: corrections of attitude are of a
        milliradian, its effect a thousandth of the covariance.
        """
        error = np.zeros(SIZE)
        covariance, product = self.covariance, self._product
        gain, shared = self._gain, self._shared
        for innovation, row, variance in measurements:
            covariance.dot(row, shared)
            np.divide(shared, float(row.dot(shared)) + variance, gain)
            error += gain * (innovation - float(row.dot(error)))
            self._gain_column.dot(self._shared_row, product)
            np.subtract(covariance, product, covariance)
        errors: list[float] = error.tolist()
        self.state.inject(errors)
        x, y, z = self.turned_ned
        turned_x, turned_y, turned_z = errors[ATTITUDE]
        self.turned_ned = (x + turned_x, y + turned_y, z + turned_z)

    def forget(self, part: slice | int, sigma: float) -> None:
        """Set a part's uncertainty [SI], with no correlation to the rest: after a reset."""
        self.covariance[part, :] = 0.0
        self.covariance[:, part] = 0.0
        self._variances[part] = sigma * sigma

    def sigma(self, index: int) -> float:
        """Standard deviation of one error."""
        return math.sqrt(self.covariance.item(index, index))
