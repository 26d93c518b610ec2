"""The estimator without the bus: sensor messages in, estimate and its validity out.

Order within a step: the inertial sample first, then whatever else has arrived; each source is
optional and may come, go and come back at any time.
"""

import math

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.vector import add
from uav_firmware.modules.estimator.aid_sources.barometer import BaroAiding
from uav_firmware.modules.estimator.aid_sources.drag import DragAiding
from uav_firmware.modules.estimator.aid_sources.gnss import GpsAiding
from uav_firmware.modules.estimator.aid_sources.magnetometer import CompassAiding
from uav_firmware.modules.estimator.aid_sources.rest import RestAiding
from uav_firmware.modules.estimator.ekf_core import RESET_AFTER_S, EkfCore
from uav_firmware.modules.estimator.fault_detection.accel_bias_drift import AccelDriftDetector
from uav_firmware.modules.estimator.fault_detection.imu_checks import ImuChecks
from uav_firmware.modules.estimator.health import Validity
from uav_firmware.modules.estimator.kalman_filter.alignment import RestAverage
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    ATTITUDE,
    DOWN,
    GYRO_BIAS,
    HEADING,
    VELOCITY,
)
from uav_firmware.modules.estimator.params import EstimatorParams, HeightReference
from uav_firmware.msg.estimate import AidSource
from uav_firmware.msg.sensors import (
    ImuShift,
    SensorBaro,
    SensorGps,
    SensorImu,
    SensorMag,
    SensorsStatus,
)
from uav_firmware.msg.status import LandDetected
from uav_firmware.msg.vectors import Vector3

_LARGEST_TILT_SIGMA_RAD = 0.1
_LARGEST_HEADING_SIGMA_RAD = 0.35
_SCALE_ERROR = 0.01  # [1/s] Of the angle turned through recently, taken for a bias
_SHIFT_DOUBT = 0.3  # [-] Of a change of bias, one sigma
_AIDED_S = 1.0  # A velocity that was fused longer ago does not hold the position any more
_RECKONING_S = 1.5  # Without a fix for longer, the estimate is dead reckoning
_LARGEST_SPEED_M_S = 1.5  # One sigma of a velocity that can be controlled
_WIND_SHARE = 0.3  # [-] Likewise, of the wind: a vehicle that is kept level goes with all of it
_LARGEST_DRIFT_M = 5.0  # One sigma; PX4's COM_POS_FS_EPH
_JUMP_SETTLES_US = 2_000_000  # A bias that has jumped is found within that
_STAYS_M_S2 = 0.5  # By which a bias that has jumped, and was found, may still be wrong
_CERTAIN = 3.0  # [SD] By which a bias must be beyond its limit, as in PX4's check
_BROKEN_GYRO_LIMIT = 2.0  # [-] Of EKF2_GYR_B_LIM; a bias up to there is followed, to land with
_BROKEN_ACCEL_LIMIT_M_S2 = 8.0  # Likewise, once a jump has been suspected


class Estimator:
    """Alignment, then the Kalman filter with its four kinds of aiding."""

    def __init__(self, params: EstimatorParams, drag: DragModel | None = None) -> None:
        self.core: EkfCore | None = None  # None until aligned
        self.imu_checks = ImuChecks()
        self.gps = GpsAiding(params)
        self.baro = BaroAiding(params)
        self.compass = CompassAiding(params)
        self.rest = RestAiding()
        self.drag = DragAiding(drag)
        self._accel_drift = AccelDriftDetector()
        self.rate_frd: Vector3 = (0.0, 0.0, 0.0)  # [rad/s] Of the last good sample, bias removed
        self._params = params
        self._average = RestAverage()
        self._land: LandDetected | None = None
        self._sensors: SensorsStatus | None = None
        # Biased for certain as no healthy sensor is; found once, it stays so until a restart
        self.gyro_broken = False
        self.accel_broken = False
        # When the accelerometer was last seen not to be, and its bias soon after
        self._broken_us = 0
        self._broken_bias: Vector3 = (0.0, 0.0, 0.0)

    def configure(self, params: EstimatorParams, drag: DragModel | None = None) -> None:
        """Work with changed parameters from now on."""
        self._params = params
        self.drag.drag = drag
        self.gps.configure(params)
        self.baro.configure(params)
        self.compass.configure(params)
        if self.core is not None:
            self.core.configure(params)
            self.core.lateral.set_drag(drag)

    def update_imu(self, imu: SensorImu) -> bool:
        """Advance to an inertial sample; false while there is no estimate to advance."""
        admitted = self.imu_checks.admit(imu)
        if admitted is None:
            return self.core is not None
        rate, force, dt = admitted.rate_frd, admitted.specific_force_frd, admitted.dt
        core = self.core
        if core is None:
            self._align(SensorImu(imu.time_us, rate, force))
            return self.core is not None
        core.model_force(modelled=self.imu_checks.force_lost)
        if core.force_modelled:
            force = self.drag.model(core, force)
        core.step(imu.time_us, rate, force, dt)
        if not core.force_modelled:
            self.drag.update(core, force, rate[2] * dt, self._params)
        bias = core.state.gyro_bias_frd
        self.rate_frd = (rate[0] - bias[0], rate[1] - bias[1], rate[2] - bias[2])
        return True

    def shift_biases(self, shift: ImuShift) -> None:
        """Follow a change of the inertial sensors in use: their biases are others from now on.

        A failure of the former ones is then reported by the sensors module.
        """
        core = self.core
        if core is None:
            return
        state, covariance = core.state, core.ekf.covariance
        state.gyro_bias_frd = add(state.gyro_bias_frd, shift.gyro_bias_frd)
        state.accel_bias_frd = add(state.accel_bias_frd, shift.accel_bias_frd)
        for axis, change in enumerate((*shift.accel_bias_frd, *shift.gyro_bias_frd)):
            place = ACCEL_BIAS.start + axis
            covariance[place, place] += (_SHIFT_DOUBT * change) ** 2
        core.ekf.covariance = covariance
        if any(shift.accel_bias_frd):
            self.accel_broken = False
            self.imu_checks.use_force()
            self._accel_drift.restart()
        if any(shift.gyro_bias_frd):
            self.gyro_broken = False
            core.gyro_jump.forget()

    def _align(self, imu: SensorImu) -> None:
        alignment = self._average.add(imu)
        if alignment is not None:
            self.core = EkfCore(alignment, imu.time_us, self._params)
            if self._land is not None:
                self.core.update_landed(self._land)
            if self._sensors is not None:
                self.update_sensors(self._sensors)
            self.core.lateral.set_drag(self.drag.drag)

    def update_gps(self, gps: SensorGps) -> None:
        """Use a fix."""
        if self.core is not None:
            self.gps.update(self.core, gps, self.baro.height)

    def update_baro(self, baro: SensorBaro) -> None:
        """Use a pressure."""
        if self.core is not None:
            self.baro.update(self.core, baro, failed=self._barometer_is_last(self.core))

    def _barometer_is_last(self, core: EkfCore) -> bool:
        """Whether the height has no aid left and the barometer is the one to reset it to."""
        by_gps = self._params.height_reference == HeightReference.GPS
        receiver = self.gps.horizontal.age_s(core.time_us) <= RESET_AFTER_S
        return not (by_gps and receiver) and self.gps.height_failed(core, self.baro.height)

    def update_mag(self, mag: SensorMag) -> None:
        """Use a magnetic field."""
        if self.core is not None:
            self.compass.update(self.core, mag)

    def update_landed(self, land: LandDetected) -> None:
        """Apply the report of the land detector: on the ground, carried by something."""
        self._land = land
        self.drag.carried = land.ground_contact
        if self.core is not None:
            self.core.update_landed(land)

    def update_sensors(self, sensors: SensorsStatus) -> None:
        """Apply the vote over the inertial sensors: whether several agree."""
        self._sensors = sensors
        if self.core is not None:
            self.core.gyros_agree = sensors.gyros_agree
            self.core.accels_agree = sensors.accels_agree

    def finish_step(self) -> None:
        """After all sensors of a step: the aids without a sensor, and the limits."""
        core, params = self.core, self._params
        if core is None or not self.rest.is_due(core):
            return
        validity = self.validity()
        self.drag.reckoning = validity.dead_reckoning
        self.rest.update(
            core,
            horizontal_lost=not (validity.position or validity.velocity),
            height_lost=not validity.altitude,
        )
        core.state.limit_biases(
            params.accel_bias_limit if core.accel_jump_us is None else _BROKEN_ACCEL_LIMIT_M_S2,
            _BROKEN_GYRO_LIMIT * params.gyro_bias_limit,
        )
        self._check_biases(core)
        self._detect_drift(core)

    def _detect_drift(self, core: EkfCore) -> None:
        """Give up an accelerometer that has drifted; what it has led the estimate to is undone."""
        flying = core.on_ground is False and not self.drag.carried
        if not flying or core.origin is None or core.force_modelled:
            self._accel_drift.restart()
            return
        former = self._accel_drift.update(core)
        if former is None and not self._goes_on_drifting(core):
            return
        self.accel_broken = True
        self.imu_checks.give_up_force()
        core.turn_back(former or self._accel_drift.former)

    def _goes_on_drifting(self, core: EkfCore) -> bool:
        """Whether a bias that is beyond its limit has been found, and does not stay there."""
        bias = core.state.accel_bias_frd
        if not self.accel_broken:
            self._broken_us = core.time_us
        if core.time_us - self._broken_us < _JUMP_SETTLES_US:
            self._broken_bias = bias
        suspected_us = core.accel_jump_us
        again = suspected_us is not None and suspected_us - self._broken_us > _JUMP_SETTLES_US
        return again or any(
            abs(new - old) > _STAYS_M_S2 + _CERTAIN * core.ekf.sigma(axis)
            for axis, (new, old) in enumerate(
                zip(bias, self._broken_bias, strict=True), start=ACCEL_BIAS.start
            )
        )

    def _check_biases(self, core: EkfCore) -> None:
        """Which inertial sensor is biased as no healthy one is; what is found stays so."""
        if self.imu_checks.force_lost or not self.imu_checks.healthy:
            return  # What is not measured is not biased
        ekf, state, params = core.ekf, core.state, self._params
        x, y, z = (ekf.sigma(axis) for axis in range(GYRO_BIAS.start, GYRO_BIAS.stop))
        turning = _SCALE_ERROR * core.recent_rotation.angle_rad
        core.gyro_jump.update(state.gyro_bias_frd, (x, y, z), turning, core.time_us)
        self.accel_broken = self.accel_broken or any(
            abs(bias) > params.accel_bias_limit + _CERTAIN * ekf.sigma(axis)
            for axis, bias in enumerate(state.accel_bias_frd, start=ACCEL_BIAS.start)
        )
        self.gyro_broken = self.gyro_broken or any(
            abs(bias) > params.gyro_bias_limit + _CERTAIN * ekf.sigma(axis)
            for axis, bias in enumerate(state.gyro_bias_frd, start=GYRO_BIAS.start)
        )

    def accuracy_m(self) -> tuple[float, float]:
        """Horizontal and vertical accuracy [m], one sigma; NaN before the origin.

        The covariance takes the errors of GPS for white and averages them out. They are not:
        most of them drift over minutes, and no filter can observe that. So the accuracy that the
        receiver reports is added to that of the covariance.
        """
        core = self.core
        if core is None:
            return math.nan, math.nan
        horizontal, vertical = self.gps.accuracy_m
        return (
            math.hypot(max(core.ekf.sigma(0), core.ekf.sigma(1)), horizontal),
            math.hypot(core.ekf.sigma(DOWN), vertical),
        )

    @property
    def gyro_jump_us(self) -> int | None:
        """When the gyroscope bias was last seen to have jumped [us]; None if never."""
        return None if self.core is None else self.core.gyro_jump.jumped_us

    @property
    def stopped(self) -> AidSource:
        """Sources that are delivered and not used, since they disagree or repeat themselves."""
        stopped = AidSource(0)
        for source, aid in (
            (AidSource.GPS_POSITION, self.gps.horizontal),
            (AidSource.GPS_VELOCITY, self.gps.velocity),
            (AidSource.GPS_HEIGHT, self.gps.vertical),
            (AidSource.BAROMETER, self.baro.height),
        ):
            if aid.stopped:
                stopped |= source
        return stopped | AidSource.BAROMETER if self.baro.frozen else stopped

    def validity(self) -> Validity:
        """What of the estimate may be used."""
        core = self.core
        if core is None:
            return Validity()
        now_us, limit_s, ekf = core.time_us, self._params.no_aid_timeout_us * 1e-6, core.ekf
        healthy = self.imu_checks.healthy and core.state.is_finite()
        located = healthy and core.origin is not None
        moving_s = min(self.gps.velocity.age_s(now_us), self.rest.velocity.age_s(now_us))
        position_s = self.gps.horizontal.age_s(now_us)
        height_s = min(self.gps.vertical.age_s(now_us), self.baro.height.age_s(now_us))
        # A source that is stopped is done without, as long as the velocity is seen to be right
        steady = moving_s <= _AIDED_S
        certain = max(ekf.sigma(0), ekf.sigma(1)) < _LARGEST_DRIFT_M
        position = located and certain and min(position_s, moving_s) <= limit_s
        altitude = located and (
            height_s <= limit_s or (steady and ekf.sigma(DOWN) < _LARGEST_DRIFT_M)
        )
        # The drag holds the velocity as well as the wind is known; without it the tilt does not
        limit_m_s = max(_LARGEST_SPEED_M_S, _WIND_SHARE * math.hypot(*core.state.wind_ne))
        slow = max(ekf.sigma(VELOCITY.start), ekf.sigma(VELOCITY.start + 1)) < limit_m_s
        dragged = self.drag.force.age_s(now_us) <= _AIDED_S and slow
        velocity = located and (moving_s <= limit_s or dragged)
        upright = (
            ekf.sigma(ATTITUDE.start) < _LARGEST_TILT_SIGMA_RAD
            and ekf.sigma(ATTITUDE.start + 1) < _LARGEST_TILT_SIGMA_RAD
        )
        turned = self.compass.is_current(core) and ekf.sigma(HEADING) < _LARGEST_HEADING_SIGMA_RAD
        return Validity(
            healthy and upright,
            healthy and turned,
            velocity,
            position,
            altitude,
            any(
                aid.rejecting for aid in (self.gps.horizontal, self.gps.velocity, self.gps.vertical)
            ),
            self.accel_broken or self.imu_checks.force_lost or not self.imu_checks.healthy,
            located and min(moving_s, position_s) > _RECKONING_S,
        )
