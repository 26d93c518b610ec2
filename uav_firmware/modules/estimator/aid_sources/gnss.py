"""GPS at work: it gives the origin, then position, height and velocity.

It has three sources, each with its own gate (`gate.Aid`): one that disagrees is stopped, while the
others are used. The estimate is reset to a fix only when nothing else holds it (PX4
`gnss_height_control.cpp`, `gps_control.cpp` with EKF2_GPS_MODE 1):

    velocity and position  nothing has aided either for EKF2_NOAID_TOUT, or both are rejected
                           for RESET_AFTER_S; on the ground one of them is enough
    height                 barometer, GPS height and vertical velocity have not helped for
                           RESET_AFTER_S; on the ground, GPS height rejected for as long
"""

import math
from typing import Final

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.vector import norm
from uav_firmware.modules.estimator.aid_sources.gnss_consistency import GpsConsistency
from uav_firmware.modules.estimator.aid_sources.gnss_fusion import (
    GpsRequirements,
    VelocityPlausibility,
    is_good,
    position_measurements,
    velocity_measurements,
)
from uav_firmware.modules.estimator.ekf_core import RESET_AFTER_S, EkfCore
from uav_firmware.modules.estimator.fault_detection.accel_bias_jump import VerticalVelocityMonitor
from uav_firmware.modules.estimator.fault_detection.gyro_bias_jump import (
    CommonJumpMonitor,
    HorizontalVelocityMonitor,
)
from uav_firmware.modules.estimator.fault_detection.heading_by_course import HeadingByCourse, Pair
from uav_firmware.modules.estimator.kalman_filter.alignment import OriginAverage
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.delay import Past
from uav_firmware.modules.estimator.kalman_filter.gate import RECEIVER_GAP_US, Aid
from uav_firmware.modules.estimator.kalman_filter.state import (
    BARO_BIAS,
    DOWN,
    GPS_HEIGHT_BIAS,
    POSITION,
    VELOCITY,
)
from uav_firmware.modules.estimator.params import (
    EstimatorParams,
    GpsCheck,
    GpsMode,
    HeightReference,
)
from uav_firmware.msg.sensors import SensorGps
from uav_firmware.msg.vectors import Vector3

_HORIZONTAL: Final = slice(0, 2)
_HORIZONTAL_VELOCITY: Final = slice(VELOCITY.start, VELOCITY.start + 2)
_SINK: Final = VELOCITY.start + 2
_HELPS_S: Final = 1.0  # A barometer fused longer ago holds no height
_SQRT_2: Final = math.sqrt(2.0)  # Two errors of height, now and at the origin, are apart by this
_WHITE_SHARE: Final = 0.4  # Of the error of height: what changes from fix to fix
_STANDS_M_S: Final = 1.0  # [m/s] More than the noise of a receiver that stands
_FALLS_M_S: Final = 3.0  # [m/s] No vehicle lands so fast
_STANDS_S: Final = 0.15  # Three fixes on end
_FALLEN_S: Final = 0.5  # Since the impact, at most: those fixes and their delay
_STEADY_US: Final = 1_000_000  # Good fixes on end before the estimate is reset to one after a loss


class GpsAiding:
    """Three aids in one receiver, gated apart: a bad altitude does not cost the rest."""

    def __init__(self, params: EstimatorParams) -> None:
        self.horizontal = Aid(params.gps_position_gate)
        self.vertical = Aid(params.gps_position_gate)
        self.velocity = Aid(params.gps_velocity_gate)
        self._origin = OriginAverage(params.origin_time)
        self._plausibility = VelocityPlausibility()
        self._monitor = HorizontalVelocityMonitor()
        self._common_monitor = CommonJumpMonitor()
        self._vertical_monitor = VerticalVelocityMonitor()
        self._heading = HeadingByCourse()
        self._consistency = GpsConsistency()
        self._last_us = -1
        self._good_since_us: int | None = None  # Time of the first fix of the present series
        self._last: tuple[float, float, float, Vector3] | None = None
        self.accuracy_m = (math.nan, math.nan)  # Horizontal, vertical of the last fix used
        self.configure(params)

    def configure(self, params: EstimatorParams) -> None:
        """Work with changed parameters from now on."""
        self._params = params
        self.horizontal.gate = self.vertical.gate = params.gps_position_gate
        self.velocity.gate = params.gps_velocity_gate
        checks = GpsCheck(params.gps_checks)

        def at_most(check: GpsCheck, limit: float) -> float:
            return limit if check in checks else math.inf

        self._required = GpsRequirements(
            satellites=params.required_satellites if GpsCheck.SATELLITES in checks else 0,
            horizontal_accuracy_m=at_most(
                GpsCheck.HORIZONTAL_ACCURACY, params.required_horizontal_accuracy
            ),
            vertical_accuracy_m=at_most(
                GpsCheck.VERTICAL_ACCURACY, params.required_vertical_accuracy
            ),
            speed_accuracy_m_s=at_most(GpsCheck.SPEED_ACCURACY, params.required_speed_accuracy),
        )

    def update(self, core: EkfCore, gps: SensorGps, baro: Aid) -> None:
        """Use a fix, if it is good, new and of a time that is remembered.

        `baro` is the other source of height: a reset of the height asks whether it helps.
        """
        if not is_good(gps, self._required):
            self._origin.restart()
            self._good_since_us = None
            return
        if gps.time_us <= self._last_us or core.recall(gps.time_us) is None:
            return
        gap_us, self._last_us = gps.time_us - self._last_us, gps.time_us
        if self._good_since_us is None or gap_us > RECEIVER_GAP_US:
            self._good_since_us = gps.time_us
        if self._repeats(gps) and not core.standing:
            return
        if core.origin is None:
            self._find_origin(core, gps)
        else:
            self._aid(core, gps, baro)
        self.accuracy_m = (gps.horizontal_accuracy_m, gps.vertical_accuracy_m)

    def _aid(self, core: EkfCore, gps: SensorGps, baro: Aid) -> None:
        """Fuse a fix, or reset to it what nothing else has been able to hold."""
        height_failed = self.height_failed(core, baro)
        # A vertical velocity that is reset holds no height; then the barometer does, or nothing
        without_baro = baro.age_s(core.time_us) > _HELPS_S
        core.add_impact_uncertainty(gps.time_us)
        self._end_fall(core, gps)
        self._compare(core, gps)
        pair = _pair_of(core, gps)
        self._common_monitor.update(core, pair, self._consistency.apart_m_s)
        if self._turns(core, pair):
            self._reset_horizontal(core, gps, vertically=False)
        elif not self._is_stale(core):
            self._fuse_velocity(core, gps)
            self._fuse_position(core, gps)
            if self._horizontal_failed(core):
                self._reset_horizontal(core, gps, vertically=without_baro)
                height_failed = height_failed or without_baro
        elif gps.time_us - (self._good_since_us or 0) >= _STEADY_US:
            self._reset_horizontal(core, gps, vertically=without_baro)
        self._fuse_height(core, gps, failed=height_failed)

    def _end_fall(self, core: EkfCore, gps: SensorGps) -> None:
        """Let a fix find a fall that has ended on the ground, unseen by the accelerometer.

        The impact is shorter than a sample. A vehicle that no rotor lifts and that stands by GPS
        does not fall, whatever the inertial sensors have added up; GPS would be rejected for
        RESET_AFTER_S, while the height runs on through the ground.
        """
        rejected_s = self.velocity.rejected_s(core.time_us)
        if not core.grounded or rejected_s < _STANDS_S or norm(gps.velocity_ned) > _STANDS_M_S:
            return
        north, east, down = self._velocity_group(core, gps)
        error = norm((north.innovation, east.innovation, down.innovation))
        if error > _FALLS_M_S:
            core.ekf.forget(VELOCITY, error)
            core.ekf.forget(POSITION, error * _FALLEN_S)

    def _compare(self, core: EkfCore, gps: SensorGps) -> None:
        """Compare position and velocity of a fix with those before."""
        north_m, east_m, _ = _frame_of(core).to_ned(
            gps.latitude_deg, gps.longitude_deg, gps.altitude_amsl_m
        )
        north_m_s, east_m_s, _ = gps.velocity_ned
        self._consistency.update(gps.time_us, (north_m, east_m), (north_m_s, east_m_s))

    def _turns(self, core: EkfCore, pair: Pair | None) -> bool:
        """Set a heading by which the vehicle would fly away to what the course proves.

        The compass, which has misled it, is then rejected, and its bias learnt anew in flight.
        """
        steady = core.gyros_agree and not core.force_modelled
        if core.on_ground is not False or not steady or pair is None:
            self._heading.restart()
            return False
        angle = self._heading.update(pair)
        if angle is None:
            return False
        core.turn_heading(angle)
        self._heading.restart()
        return True

    def _repeats(self, gps: SensorGps) -> bool:
        """Whether a fix says in every digit what the one before said.

        Noise forbids that: the receiver is stuck, and what it repeats is no measurement of a
        vehicle that moves.
        """
        former = self._last
        self._last = (gps.latitude_deg, gps.longitude_deg, gps.altitude_amsl_m, gps.velocity_ned)
        return self._last == former

    def _find_origin(self, core: EkfCore, gps: SensorGps) -> None:
        """Average fixes while the vehicle stands still; then the estimate begins."""
        if not core.rest.at_rest:
            self._origin.restart()
            return
        place = self._origin.add(gps)
        if place is None:
            return
        core.set_origin(*place)
        shrink = self._origin.count**-0.5
        core.ekf.forget(_HORIZONTAL, shrink * self._horizontal_sigma(gps))
        core.ekf.forget(DOWN, shrink * self._vertical_sigma(gps))
        core.state.gps_height_bias_m = 0.0
        core.ekf.forget(GPS_HEIGHT_BIAS, shrink * self._vertical_sigma(gps))
        for aid in (self.horizontal, self.vertical, self.velocity):
            aid.accept(core.time_us)

    def _fuse_velocity(self, core: EkfCore, gps: SensorGps) -> None:
        group = self._velocity_group(core, gps)
        is_plausible = self._plausibility.update(group, gps.time_us)
        # One that disagrees with the rest, or leaps, proves nothing of them
        if is_plausible and not self.velocity.stopped:
            self._monitor.update(core, group)
            self._vertical_monitor.update(core, group)
        doubted = self._consistency.contradicts
        self.velocity.fuse(core.ekf, group, core.time_us, doubted=doubted)

    def _fuse_position(self, core: EkfCore, gps: SensorGps) -> None:
        group, doubted = self._position_group(core, gps)[:2], self._consistency.contradicts
        self.horizontal.fuse(core.ekf, group, core.time_us, doubted=doubted)

    def _fuse_height(self, core: EkfCore, gps: SensorGps, *, failed: bool) -> None:
        now_us = core.time_us
        core.expect_gps_height_error(_SQRT_2 * self._vertical_sigma(gps))
        group = self._position_group(core, gps)[2:]
        if self.vertical.fuse(core.ekf, group, now_us):
            return
        at_rest = core.standing and self.vertical.rejected_s(now_us) > RESET_AFTER_S
        if self._params.height_reference == HeightReference.GPS and (failed or at_rest):
            self._reset_height(core, gps)

    def _horizontal_failed(self, core: EkfCore) -> bool:
        """Whether every source of horizontal motion has been rejected for too long.

        In flight one that agrees with the inertial sensors is enough to hold on to; on the ground
        there is nothing to lose, and the receiver is right about where the vehicle stands. With
        EKF2_GPS_MODE 0 the position is accepted in flight too.
        """
        rejected = (
            self.horizontal.rejected_s(core.time_us) > RESET_AFTER_S,
            self.velocity.rejected_s(core.time_us) > RESET_AFTER_S,
        )
        if core.standing:
            return any(rejected)
        return rejected[0] if self._params.gps_mode == GpsMode.AUTOMATIC else all(rejected)

    def height_failed(self, core: EkfCore, baro: Aid) -> bool:
        """Whether no source of height or vertical velocity has helped for too long."""
        aids = (self.vertical, self.velocity, baro)
        return min(aid.age_s(core.time_us) for aid in aids) > RESET_AFTER_S

    def _reset_horizontal(self, core: EkfCore, gps: SensorGps, *, vertically: bool) -> None:
        """Set position and velocity to those of a fix; the vertical velocity if requested."""
        north, east, down = (m.innovation for m in self._velocity_group(core, gps))
        core.reset_log.change_speed(core.state, north, east)
        core.ekf.forget(_HORIZONTAL_VELOCITY, self._velocity_sigma(gps))
        if vertically:
            core.reset_log.change_sink(core.state, down)
            core.ekf.forget(_SINK, self._velocity_sigma(gps))
        north, east, _ = (m.innovation for m in self._position_group(core, gps))
        core.reset_log.move_horizontally(core.state, north, east)
        core.ekf.forget(_HORIZONTAL, self._horizontal_sigma(gps))
        self.velocity.accept(core.time_us)
        self.horizontal.accept(core.time_us)

    def _reset_height(self, core: EkfCore, gps: SensorGps) -> None:
        """Set the height to that of a fix, free of bias; what the barometer says stays right."""
        state, sigma = core.state, self._vertical_sigma(gps)
        down = self._position_group(core, gps)[DOWN].innovation - state.gps_height_bias_m
        state.gps_height_bias_m = 0.0
        core.ekf.forget(GPS_HEIGHT_BIAS, sigma)
        core.reset_log.move_vertically(state, down)
        state.baro_bias_m += down
        core.ekf.forget(DOWN, sigma)
        core.ekf.forget(BARO_BIAS, sigma)
        self.vertical.accept(core.time_us)

    def _velocity_group(
        self, core: EkfCore, gps: SensorGps
    ) -> tuple[Measurement, Measurement, Measurement]:
        return velocity_measurements(
            _recalled(core, gps), gps.velocity_ned, self._velocity_sigma(gps)
        )

    def _position_group(
        self, core: EkfCore, gps: SensorGps
    ) -> tuple[Measurement, Measurement, Measurement]:
        return position_measurements(
            _recalled(core, gps),
            _frame_of(core).to_ned(gps.latitude_deg, gps.longitude_deg, gps.altitude_amsl_m),
            core.state.gps_height_bias_m,
            self._horizontal_sigma(gps),
            max(_WHITE_SHARE * gps.vertical_accuracy_m, self._params.gps_position_noise),
        )

    def _is_stale(self, core: EkfCore) -> bool:
        """Whether the dead reckoning has gone on for too long to argue with a good fix."""
        age_s = min(self.horizontal.age_s(core.time_us), self.velocity.age_s(core.time_us))
        return age_s * 1e6 > self._params.no_aid_timeout_us

    def _velocity_sigma(self, gps: SensorGps) -> float:
        return max(gps.speed_accuracy_m_s, self._params.gps_velocity_noise)

    def _horizontal_sigma(self, gps: SensorGps) -> float:
        return max(gps.horizontal_accuracy_m, self._params.gps_position_noise)

    def _vertical_sigma(self, gps: SensorGps) -> float:
        return max(gps.vertical_accuracy_m, self._params.gps_position_noise)


def _recalled(core: EkfCore, gps: SensorGps) -> Past:
    """The present belief about the time of a fix whose time is known to be kept."""
    past = core.recall(gps.time_us)
    if past is None:
        raise ValueError(f"time_us: {gps.time_us} is not in the history")
    return past


def _pair_of(core: EkfCore, gps: SensorGps) -> Pair | None:
    """Both velocities at the time of a fix; None if that by the inertial sensors is not kept."""
    inertial = core.course.at(gps.time_us)
    north, east, _ = gps.velocity_ned
    return None if inertial is None else Pair(gps.time_us, *inertial, north, east)


def _frame_of(core: EkfCore) -> LocalFrame:
    """The local frame of an estimate that is known to have its origin."""
    if core.origin is None:
        raise ValueError("origin: the estimator has none yet")
    return core.origin
