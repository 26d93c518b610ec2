"""Detects a bad vertical acceleration, and lets the filter find the accelerometer's new bias.

A vertical velocity that drifts from GPS is the accelerometer's: a bias that has jumped, vibration
that it rectifies, a range that clips. PX4 calls it bad_acc_vertical, raises the noise of the
accelerometer and lets the innovations through clipped (EKF2, height_control.cpp). Here the jump is
found: velocity and height are opened as far as a jump of the bias would have led them, together
with the bias (`bias_jump`), and the next fixes and pressures settle all three. A gyroscope has no
part in it.
"""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.fault_detection.innovation_cusum import InnovationCusum
from uav_firmware.modules.estimator.kalman_filter.bias_jump import accel_jump_covariance
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.msg.vectors import Vector3

_ALONG_Z: Final[Vector3] = (0.0, 0.0, 1.0)
_DOWN: Final = slice(2, 3)
_LEAST_M_S2: Final = 0.3  # One sigma of a jump that is expected
_LARGEST_M_S2: Final = 20.0
_DOUBT: Final = 1.5  # [-] Sigma over the size that explains the innovations
_WINDOW: Final = 1.5  # [-] Longest time since the jump over the likely one
_SHORTEST_S: Final = 0.3
_LONGEST_S: Final = 3.0
_SCALE_ERROR: Final = 0.01  # [-] Of a velocity gained recently: the accelerometer's scale factor


class VerticalVelocityMonitor:
    """Watches the innovations of the velocity down."""

    def __init__(self) -> None:
        self._drift = InnovationCusum(slack=1.0, limit=6.0, leap=4.0, ramps=True)

    def update(self, core: EkfCore, group: Sequence[Measurement]) -> None:
        """Add the velocity of a fix, north, east and down, before it is fused."""
        if core.force_modelled or core.impact.is_recent(core.time_us):
            self._drift.restart()
            return
        (down,) = group[_DOWN]
        noise = _SCALE_ERROR * abs(core.ekf.state.velocity_ned[2])
        deviation = math.hypot(core.ekf.deviation(down), noise)
        drift = self._drift.update([down.innovation / deviation], core.time_us)
        if drift is None:
            return
        since_s = min(max(1.5 * drift.age_s, _SHORTEST_S), _LONGEST_S)
        expect_accel_jump(core, _ALONG_Z, abs(down.innovation) / since_s, since_s)


def expect_accel_jump(core: EkfCore, axes: Vector3, jump_m_s2: float, since_s: float) -> None:
    """Let the filter reckon with a jump along `axes` [FRD] some time ago."""
    sigma = min(max(_DOUBT * jump_m_s2, _LEAST_M_S2), _LARGEST_M_S2)
    core.ekf.covariance += accel_jump_covariance(core.ekf, axes, sigma, _WINDOW * since_s)
    core.accel_jump_us = core.time_us
