"""What a jump of an inertial bias some time ago has done to the estimate, as a covariance.

With tau the time since the jump w, R the attitude and f the specific force in NED (the
transition of `ekf`, integrated):

    dtheta = -R tau w        dv = [f]x R tau^2/2 w        dp = [f]x R tau^3/6 w        dw = w

and of a jump a of the accelerometer bias

    dv = -R tau a            dp = -R tau^2/2 a            da = a

When it jumped is not known better than to within the last T, and its sign not at all: the
covariance is the mean of these products over tau from 0 to T, times the variance of w. Added to
that of the filter it makes the next measurements correct bias, tilt and velocity together, as
they are correlated (A. S. Willsky and H. L. Jones, "A generalized likelihood ratio approach to the
detection and estimation of jumps in linear systems", IEEE Trans. Automatic Control 21, 1976).
"""

from typing import Final

import numpy as np

from uav_firmware.lib.rotation import to_matrix
from uav_firmware.modules.estimator.kalman_filter.covariance import Array
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
)
from uav_firmware.msg.vectors import Vector3

EVERY_AXIS: Final[Vector3] = (1.0, 1.0, 1.0)
TURNING: Final[Vector3] = (0.0, 0.0, 1.0)
"""The axis [FRD] whose bias turns the estimate and does not tilt it."""

_MOMENTS: Final = 8  # Of the mean over tau


def jump_covariance(ekf: ErrorStateEkf, axes: Vector3, sigma: float, longest_s: float) -> Array:
    """Covariance of a jump of `sigma` [rad/s] about each of `axes` within the last `longest_s`."""
    rotation = np.array(to_matrix(ekf.state.q_ned_frd)) * axes
    fx, fy, fz = ekf.acceleration_ned
    fz -= ekf.gravity
    pushed = np.array([[0.0, -fz, fy], [fz, 0.0, -fx], [-fy, fx, 0.0]]) @ rotation
    effect, total = np.zeros((SIZE, 3)), np.zeros((SIZE, SIZE))
    effect[GYRO_BIAS] = np.diag(axes)
    for moment in range(_MOMENTS):
        tau = longest_s * (moment + 0.5) / _MOMENTS
        effect[ATTITUDE] = -tau * rotation
        effect[VELOCITY] = tau**2 / 2.0 * pushed
        effect[POSITION] = tau**3 / 6.0 * pushed
        total += effect @ effect.T
    return total * (sigma * sigma / _MOMENTS)


def accel_jump_covariance(
    ekf: ErrorStateEkf, axes: Vector3, sigma: float, longest_s: float
) -> Array:
    """Covariance of an accelerometer jump of `sigma` [m/s^2] along each of `axes` [FRD]."""
    rotation = np.array(to_matrix(ekf.state.q_ned_frd)) * axes
    effect, total = np.zeros((SIZE, 3)), np.zeros((SIZE, SIZE))
    effect[ACCEL_BIAS] = np.diag(axes)
    for moment in range(_MOMENTS):
        tau = longest_s * (moment + 0.5) / _MOMENTS
        effect[VELOCITY] = -tau * rotation
        effect[POSITION] = -(tau**2) / 2.0 * rotation
        total += effect @ effect.T
    return total * (sigma * sigma / _MOMENTS)


def velocity_jump_covariance(sigma: float, since_s: float) -> Array:
    """Covariance of a change of velocity of `sigma` [m/s] on each axis, unseen, some time ago."""
    effect = np.zeros((SIZE, 3))
    effect[VELOCITY] = np.eye(3)
    effect[POSITION] = since_s * np.eye(3)
    return sigma * sigma * (effect @ effect.T)
