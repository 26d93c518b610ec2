"""The filter in operation: clock, history, origin, process noise; what the aid sources share.

As ArduPilot's `NavEKF3_core`: one filter with what belongs to it.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2, LocalFrame, gravity_m_s2
from uav_firmware.lib.rotation import from_euler, multiply, normalise
from uav_firmware.modules.estimator.declination import declination
from uav_firmware.modules.estimator.fault_detection.gyro_jump_confirmation import (
    GyroJumpConfirmation,
)
from uav_firmware.modules.estimator.fault_detection.heading_by_course import InertialCourse
from uav_firmware.modules.estimator.fault_detection.lateral_force import LateralForce
from uav_firmware.modules.estimator.fault_detection.motion import (
    UNSEEN_M_S,
    Impact,
    RecentRotation,
    RestDetector,
    SpinScale,
)
from uav_firmware.modules.estimator.kalman_filter.alignment import TiltAlignment
from uav_firmware.modules.estimator.kalman_filter.bias_jump import velocity_jump_covariance
from uav_firmware.modules.estimator.kalman_filter.covariance import Array
from uav_firmware.modules.estimator.kalman_filter.delay import InertialHistory, Past
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf, Noise
from uav_firmware.modules.estimator.kalman_filter.resets import ResetLog
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_BIAS,
    GPS_HEIGHT_BIAS,
    GYRO_BIAS,
    HEADING,
    HEADING_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
    WIND,
    NominalState,
)
from uav_firmware.modules.estimator.params import EstimatorParams, HeightReference
from uav_firmware.msg.status import LandDetected
from uav_firmware.msg.vectors import Vector3

RESET_AFTER_S: Final = 5.0
"""When nothing has aided a quantity for so long, it is reset to the source that delivers."""

UNKNOWN_HEADING_SIGMA_RAD: Final = 1.8
"""[rad] That of an even spread over the circle."""

AID_INTERVAL_US: Final = 36_000
"""[us] Barometer and magnetometer: 25 Hz are enough, with room for a clock a little fast."""

START_WIND_SIGMA_M_S: Final = 5.0
"""[m/s] One sigma of the wind before the drag in flight has shown it."""

_HISTORY_SAMPLES: Final = 256  # One second at 250 Hz: a GPS that is later than that is useless
_MODELLED_FORCE_NOISE_M_S2: Final = 10.0  # Of a sample: 1 m/s^2 that lasts half a second
_START_POSITION_SIGMA_M: Final = 10.0
_START_VELOCITY_SIGMA_M_S: Final = 0.3
_FREE_GPS_HEIGHT_SIGMA_M: Final = 10.0  # Where the barometer is the datum: weather over hours
_TURNED_BACK_SIGMA_RAD: Final = 0.05
_TURNED_BACK_SIGMA_RAD_S: Final = 0.001
_TURNED_TILT_SIGMA_RAD: Final = 0.03
_TURNED_HEADING_SIGMA_RAD: Final = 0.2
_YAW_BIAS: Final = GYRO_BIAS.stop - 1


class EarlierEstimate(NamedTuple):
    """An earlier estimate, which the gyroscope still stands for."""

    turned_ned: Vector3  # [rad] By which measurements have turned the attitude since
    gyro_bias_frd: Vector3  # [rad/s]
    wind_ne: tuple[float, float]  # [m/s]


class EkfCore:
    """The filter in operation, from alignment on."""

    def __init__(self, alignment: TiltAlignment, time_us: int, params: EstimatorParams) -> None:
        state = NominalState(alignment.q_ned_frd)
        state.gyro_bias_frd = alignment.gyro_bias_frd
        self.params = params
        self._gps_height_sigma = 0.0  # [m] Of the receiver's slow error
        self.time_us = time_us
        self.origin: LocalFrame | None = None
        self.declination: float | None = None  # [rad] At the origin
        self.on_ground: bool | None = None  # None while unknown
        self._has_low_throttle = True
        # Several measure the same: their bias has not jumped
        self.gyros_agree = self.accels_agree = False
        # When a jump of the bias of roll or pitch rate was last suspected, and of the yaw rate
        self.tilt_jump_us: int | None = None
        self.turn_jump_us: int | None = None
        self.gyro_jump = GyroJumpConfirmation()
        self.force_modelled = False  # For want of an accelerometer
        self.accel_jump_us: int | None = None  # When one of the accelerometer was
        self.rest = RestDetector()
        self.lateral = LateralForce()
        self.course = InertialCourse()
        self.heading_set_us: int | None = None  # [us] When the course by GPS last turned it
        self.recent_rotation = RecentRotation()
        self._spin_scale = SpinScale()
        self.impact = Impact()
        self.reset_log = ResetLog()
        self.history = InertialHistory(time_us, _HISTORY_SAMPLES)
        self.ekf = ErrorStateEkf(
            state, _initial_sigmas(alignment, params), _noise(params, 0.0), STANDARD_GRAVITY_M_S2
        )
        self.state = state
        """The best estimate, the filter's own: read five times in a step, so no property."""

    def update_landed(self, land: LandDetected) -> None:
        """Apply the report of the land detector."""
        self.on_ground = land.landed
        self._has_low_throttle = land.has_low_throttle

    @property
    def grounded(self) -> bool:
        """No rotor lifts it: landed, disarmed, or never yet flown for want of an origin.

        Rotors that may carry the vehicle end it: one that rises slowly has not risen far enough
        for the land detector.
        """
        on_ground = self.origin is None if self.on_ground is None else self.on_ground
        return on_ground and self._has_low_throttle

    @property
    def standing(self) -> bool:
        """At rest on the ground; a vehicle that was disarmed in the air falls and is not."""
        return self.grounded and self.rest.at_rest

    def configure(self, params: EstimatorParams) -> None:
        """Work with changed parameters from now on."""
        self.params = params
        self._set_noise()

    def expect_gps_height_error(self, sigma: float) -> None:
        """Let the slow error of GPS height be of `sigma` [m] from now on."""
        if sigma != self._gps_height_sigma:
            self._gps_height_sigma = sigma
            self._set_noise()

    def model_force(self, *, modelled: bool) -> None:
        """Reckon with a specific force that is modelled instead of measured, or measured again."""
        if modelled == self.force_modelled:
            return
        self.force_modelled = modelled
        self._set_noise()
        self.state.accel_bias_frd = (0.0, 0.0, 0.0)
        # A model has no bias that walks; of a sensor that comes back none is known
        self.ekf.forget(ACCEL_BIAS, 1e-4 if modelled else self.params.accel_bias_limit)

    def turn_back(self, former: EarlierEstimate) -> None:
        """Undo what an accelerometer that has drifted has done to tilt, gyroscope bias and wind."""
        state = self.state
        x, y, _ = former.turned_ned
        half = (1.0, -0.5 * x, -0.5 * y, 0.0)
        state.q_ned_frd = normalise(multiply(half, state.q_ned_frd))
        state.gyro_bias_frd, state.wind_ne = former.gyro_bias_frd, former.wind_ne
        self.gyro_jump.forget()
        self.ekf.forget(ATTITUDE.start, _TURNED_BACK_SIGMA_RAD)
        self.ekf.forget(ATTITUDE.start + 1, _TURNED_BACK_SIGMA_RAD)
        self.ekf.forget(GYRO_BIAS, _TURNED_BACK_SIGMA_RAD_S)

    def turn_heading(self, angle: float) -> None:
        """Turn the estimate by an angle [rad] that the compass had it wrong by.

        What the filter has made of the disagreement goes with it: the wind, the accelerometer's
        bias along x and y, what was thought to be known of the tilt.
        """
        state, ekf = self.state, self.ekf
        state.q_ned_frd = normalise(multiply(from_euler(0.0, 0.0, angle), state.q_ned_frd))
        state.accel_bias_frd = (0.0, 0.0, state.accel_bias_frd[2])
        state.wind_ne = (0.0, 0.0)
        self.history.turn(angle)
        self.reset_log.note_turn(angle)
        self.gyro_jump.forget()
        ekf.forget(ATTITUDE, _TURNED_TILT_SIGMA_RAD)
        ekf.forget(HEADING, _TURNED_HEADING_SIGMA_RAD)
        ekf.forget(slice(ACCEL_BIAS.start, ACCEL_BIAS.start + 2), self.params.accel_bias_sigma)
        ekf.forget(WIND, START_WIND_SIGMA_M_S)
        self.heading_set_us = self.time_us

    def add_impact_uncertainty(self, fix_us: int) -> None:
        """Let a fix at `fix_us` find what an impact beyond the accelerometer's range changed."""
        since_s = self.impact.unseen_s(fix_us, self.time_us)
        if since_s is not None:
            self.ekf.covariance += velocity_jump_covariance(UNSEEN_M_S, since_s)

    def _set_noise(self) -> None:
        noise = _noise(self.params, self._gps_height_sigma)
        if self.force_modelled:
            noise = replace(noise, accel=_MODELLED_FORCE_NOISE_M_S2)
        self.ekf.noise = noise

    def step(self, time_us: int, rate_frd: Vector3, force_frd: Vector3, dt: float) -> None:
        """Advance to `time_us` over dt [s]."""
        ekf = self.ekf
        change = ekf.predict(rate_frd, force_frd, dt)
        self.history.push(time_us, change, dt)
        self.rest.update(rate_frd, ekf.acceleration_ned)
        state = ekf.state
        self.course.add(time_us, change, state.q_ned_frd, state.accel_bias_frd, dt)
        north, east, down = state.velocity_ned
        wind_north, wind_east = state.wind_ne
        airspeed_ned = (north - wind_north, east - wind_east, down)
        self.lateral.update(force_frd, airspeed_ned, state.q_ned_frd, dt)
        self.recent_rotation.update(rate_frd, dt)
        doubt = self._spin_scale.update(rate_frd[2])
        if doubt > 0.0:
            ekf.widen(_YAW_BIAS, doubt)
        self.impact.update(force_frd, time_us)
        self.time_us = time_us

    def recall(self, time_us: int) -> Past | None:
        """The state as it was at `time_us`, None when that is not kept."""
        return self.history.recall(self.ekf.state, time_us, self.ekf.gravity)

    def set_origin(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        """Call the present place (0, 0, 0); the caller states its uncertainty."""
        self.origin = LocalFrame(latitude_deg, longitude_deg, altitude_m)
        self.declination = declination(latitude_deg, longitude_deg)
        self.ekf.gravity = gravity_m_s2(latitude_deg, altitude_m)
        self.state.position_ned = (0.0, 0.0, 0.0)


def _noise(params: EstimatorParams, gps_height_sigma: float) -> Noise:
    """Process noise; the source that EKF2_HGT_REF names is the one whose datum does not wander."""
    by_gps = params.height_reference == HeightReference.GPS
    return Noise(
        accel=params.accel_noise,
        gyro=params.gyro_noise,
        accel_bias_walk=params.accel_bias_walk,
        gyro_bias_walk=params.gyro_bias_walk,
        baro_bias_walk=params.baro_walk if by_gps else 0.0,
        heading_bias_walk=params.heading_bias_walk,
        wind_walk=params.wind_walk,
        gps_height_sigma=gps_height_sigma if by_gps else _FREE_GPS_HEIGHT_SIGMA_M,
        gps_height_time=2.0 * params.gps_height_time,  # Of what has changed since the origin
    )


def _initial_sigmas(alignment: TiltAlignment, params: EstimatorParams) -> Array:
    sigmas = np.empty(SIZE)
    sigmas[POSITION] = _START_POSITION_SIGMA_M
    sigmas[VELOCITY] = _START_VELOCITY_SIGMA_M_S
    sigmas[ATTITUDE] = params.angle_sigma
    sigmas[HEADING] = UNKNOWN_HEADING_SIGMA_RAD
    sigmas[ACCEL_BIAS] = max(params.accel_bias_sigma, 1e-3)
    sigmas[GYRO_BIAS] = max(alignment.gyro_bias_sigma, 1e-4)
    sigmas[BARO_BIAS] = max(params.baro_noise, 1e-3)
    sigmas[GPS_HEIGHT_BIAS] = max(params.gps_position_noise, 1e-3)
    sigmas[WIND] = START_WIND_SIGMA_M_S
    sigmas[HEADING_BIAS] = max(params.heading_bias_sigma, 1e-4)
    return sigmas
