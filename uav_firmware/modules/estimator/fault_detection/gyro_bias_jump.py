"""Watches GPS velocity and compass for a jump of the gyroscope bias, and lets the filter follow.

The bias is known to thousandths of a degree a second after a minute. When it jumps, by a knock,
a cold solder joint or a supply that fails, the filter would reject every other source rather than
correct the bias. The size of the jump that explains the innovations is computed; twice
that is the deviation that the filter gets (`bias_jump`), and it estimates the rest.

Several gyroscopes that agree are believed (`EkfCore.gyros_agree`), and so are accelerometers:
then it is the receiver or the compass that is wrong, and the attitude is not opened to it. PX4
keeps its attitude as well, and rejects the source or resets velocity and heading. Only a drift
that nothing else can make proves that all have jumped alike (`common_gyro_jump`).

A velocity that drifts has other causes too. A wrong heading while the vehicle accelerates: what
0.2 rad of it would do to the latest change of velocity counts as noise here. Scale factor and
misalignment of the gyroscope, while the vehicle turns: what 2 % of the latest angle of rotation
tilts counts as noise as well. An accelerometer whose bias jumps: `lateral_force` sees it, and the
jump is then expected there (`accel_bias_jump`). Only the horizontal velocity is watched here: a
vertical one that drifts is never a matter of tilt.
"""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.fault_detection.accel_bias_jump import expect_accel_jump
from uav_firmware.modules.estimator.fault_detection.common_gyro_jump import CommonJumpProof
from uav_firmware.modules.estimator.fault_detection.heading_by_course import Pair
from uav_firmware.modules.estimator.fault_detection.innovation_cusum import InnovationCusum
from uav_firmware.modules.estimator.kalman_filter.bias_jump import (
    EVERY_AXIS,
    TURNING,
    jump_covariance,
)
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf
from uav_firmware.msg.vectors import Vector3

_LARGEST_JUMP: Final = 0.2  # [rad/s] 11 deg/s, one sigma
_SHORTEST_S: Final = 0.5  # A jump is not reported sooner
_LONGEST_S: Final = 4.0  # An older jump has been reported
_DOUBT: Final = 2.0  # [-] Sigma over the size that explains the innovations
_WINDOW: Final = 1.5  # [-] Longest time since the jump over the likely one
_HEADING_ERROR_RAD: Final = 0.2
_TILTED_US: Final = 1_000_000  # A tilt that is wrong has been found after that
_RECENT_S: Final = 1.5  # Changes of velocity longer ago than that are forgotten
_SCALE_ERROR: Final = 0.02  # [-] Of the angle turned through: scale factor and misalignment
_LOAD_ERROR_RAD: Final = 0.1  # Of the heading by compass, for 1 g of thrust more or less


class HorizontalVelocityMonitor:
    """Detects a jump about the roll or pitch axis: the velocity grows with the square of the time.

    Detected within 1.3 s when it is of 3 deg/s. What has struck one axis may have struck them all:
    the yaw axis is opened too, for the compass to correct, before an error of the heading disturbs
    the tilt through the velocity.
    """

    def __init__(self) -> None:
        self._drift = InnovationCusum(slack=1.0, limit=8.0, leap=4.0, ramps=True)
        self._slow: Vector3 | None = None
        self._last_us = 0

    def update(self, core: EkfCore, group: Sequence[Measurement]) -> None:
        """Add the velocity of a fix, north, east and down, before it is fused."""
        ekf, now_us = core.ekf, core.time_us
        horizontal = group[:2]
        if core.impact.is_recent(now_us):
            self._drift.restart()
            return
        noise = math.hypot(
            _HEADING_ERROR_RAD * self._change(ekf.state.velocity_ned, now_us),
            _scale_doubt(core),
        )
        drift = self._drift.update(
            [m.innovation / math.hypot(ekf.deviation(m), noise) for m in horizontal], now_us
        )
        if drift is None:
            return
        # As long again as the innovations have exceeded the slack they grew unseen below it
        since_s = min(max(2.0 * drift.age_s, _SHORTEST_S), _LONGEST_S)
        feigned = max(abs(m.innovation) for m in horizontal)
        if core.lateral.stepped and not core.accels_agree:
            expect_accel_jump(core, EVERY_AXIS, feigned / since_s, since_s)
            return
        if core.gyros_agree:
            return
        _expect_tilt_jump(core, 2.0 * feigned / (STANDARD_GRAVITY_M_S2 * since_s**2), since_s)

    def _change(self, velocity: Vector3, now_us: int) -> float:
        """How much the velocity has changed recently [m/s]."""
        slow = self._slow or velocity
        share = min(1.0, (now_us - self._last_us) * 1e-6 / _RECENT_S)
        north, east = velocity[0] - slow[0], velocity[1] - slow[1]
        self._slow = (slow[0] + share * north, slow[1] + share * east, 0.0)
        self._last_us = now_us
        return math.hypot(north, east)


class CommonJumpMonitor:
    """Detects a jump that several gyroscopes show alike, and lets the filter follow it too."""

    def __init__(self) -> None:
        self._proof = CommonJumpProof()

    def update(self, core: EkfCore, pair: Pair | None, contradiction_m_s: float) -> None:
        """Add a fix; `contradiction_m_s` is by which its position runs away from its velocity."""
        now_us = core.time_us
        believed = core.gyros_agree and core.accels_agree and not core.force_modelled
        flying = core.on_ground is False and not core.impact.is_recent(now_us)
        if pair is None or not believed or not flying:
            self._proof.restart()
            return
        jump = self._proof.update(
            pair,
            core.ekf.turned_ned,
            contradiction_m_s,
            _scale_doubt(core),
            force_stepped=core.lateral.stepped,
        )
        if jump is not None:
            _expect_tilt_jump(core, jump.rate, min(jump.since_s, _LONGEST_S))


class HeadingMonitor:
    """Detects a jump about the yaw axis: the heading runs away from the compass, steadily.

    A magnet nearby is a step: what has not grown is no jump, and a compass that has leapt is not
    used against the gyroscope any more, until it is aligned anew. The motors are such a magnet,
    and rise as fast as they spin up: the current of full throttle turns the field by tens of
    degrees (ArduPilot's compassmot accepts 30 %). Thrust that differs from that of hover is noise
    of the heading here.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Trust the compass, which has just been aligned."""
        self._drift = _drift_of_headings()
        self._leapt = False

    def update(self, core: EkfCore, measured: Measurement) -> None:
        """Add a heading before it is fused.

        While the tilt is found anew, the heading by compass leaps with it: a field that dips by
        55 degrees turns it by more than the tilt changes.
        """
        ekf, now_us, tilted_us = core.ekf, core.time_us, core.tilt_jump_us
        if tilted_us is not None and now_us - tilted_us < _TILTED_US:
            self._drift = _drift_of_headings()
            return
        ax, ay, az = ekf.acceleration_ned
        thrust_g = math.hypot(ax, ay, az - ekf.gravity) / STANDARD_GRAVITY_M_S2
        deviation = math.hypot(ekf.deviation(measured), _LOAD_ERROR_RAD * (thrust_g - 1.0))
        drift = self._drift.update([measured.innovation / deviation], now_us)
        self._leapt = self._leapt or self._drift.leapt
        if drift is None or self._leapt or core.gyros_agree:
            return
        jump = drift.growth * deviation / max(drift.age_s, _SHORTEST_S)
        if jump <= 0.0:
            return
        _add_jump(ekf, TURNING, jump, min(abs(measured.innovation) / jump, _LONGEST_S))
        core.gyro_jump.expect(ekf.state.gyro_bias_frd, now_us)
        core.turn_jump_us = now_us


def _scale_doubt(core: EkfCore) -> float:
    """Velocity [m/s] that the scale errors of the gyroscope may have made by tilting."""
    angle_rad = core.recent_rotation.angle_rad
    return _SCALE_ERROR * STANDARD_GRAVITY_M_S2 * _RECENT_S * angle_rad


def _expect_tilt_jump(core: EkfCore, jump: float, since_s: float) -> None:
    """Let the filter reckon with a jump [rad/s] some time ago."""
    _add_jump(core.ekf, EVERY_AXIS, jump, since_s)
    core.gyro_jump.expect(core.state.gyro_bias_frd, core.time_us)
    core.tilt_jump_us = core.time_us


def _drift_of_headings() -> InnovationCusum:
    return InnovationCusum(slack=2.0, limit=28.0, leap=2.0)


def _add_jump(ekf: ErrorStateEkf, axes: Vector3, jump: float, since_s: float) -> None:
    sigma = min(_DOUBT * jump, _LARGEST_JUMP)
    ekf.covariance += jump_covariance(ekf, axes, sigma, _WINDOW * since_s)
