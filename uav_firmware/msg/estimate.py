"""What the estimator believes. Written by estimator."""

from typing import NamedTuple

from uav_firmware.msg.vectors import Quaternion, Vector3


class VehicleAttitude(NamedTuple):
    """Attitude, at control rate; read by attitude_control, rate_control and mavlink."""

    time_us: int  # [us] Time of the IMU sample
    q_ned_frd: Quaternion  # [-] Body to NED
    rate_frd: Vector3  # [rad/s] Bias-corrected angular rate


class VehicleLocalPosition(NamedTuple):
    """Position about the local origin; read by position_control, navigator, mavlink."""

    time_us: int  # [us]
    position_ned: Vector3  # [m] About the origin; down is positive
    velocity_ned: Vector3  # [m/s]
    acceleration_ned: Vector3  # [m/s^2] Gravity removed
    heading: float  # [rad] Yaw of the body x axis from north, (-pi, pi]
    origin_latitude_deg: float  # [deg] Of position (0, 0, 0)
    origin_longitude_deg: float  # [deg]
    origin_altitude_amsl_m: float  # [m]
    horizontal_accuracy_m: float  # [m] One sigma
    vertical_accuracy_m: float  # [m] One sigma
    position_valid: bool  # Horizontal position observed
    altitude_valid: bool  # Vertical position observed
    velocity_valid: bool  # Velocity observed
    heading_valid: bool  # Heading observed


class VehicleGlobalPosition(NamedTuple):
    """Geodetic position, valid only once the origin is known; read by navigator, mavlink."""

    time_us: int  # [us]
    latitude_deg: float  # [deg] WGS-84
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m]
    horizontal_accuracy_m: float  # [m] One sigma
    vertical_accuracy_m: float  # [m] One sigma


class EstimatorStatus(NamedTuple):
    """Health of the estimate; read by commander and mavlink (ESTIMATOR_STATUS)."""

    time_us: int  # [us]
    flags: int  # [-] MAVLink ESTIMATOR_STATUS_FLAGS
    velocity_ratio: float  # [-] Innovation over gate; below 1 is good
    horizontal_position_ratio: float  # [-]
    vertical_position_ratio: float  # [-]
    mag_ratio: float  # [-]
    horizontal_accuracy_m: float  # [m] One sigma
    vertical_accuracy_m: float  # [m] One sigma
    gyro_bias_frd: Vector3  # [rad/s]
    aligned: bool  # Tilt and heading are initialised
    gyro_broken: bool = False  # Its bias is beyond EKF2_GYR_B_LIM
    gyro_jump_us: int | None = None  # [us] When its bias last jumped
    accel_bias_frd: Vector3 = (0.0, 0.0, 0.0)  # [m/s^2]
    accel_broken: bool = False  # Its bias has been beyond EKF2_ABL_LIM; until a restart


class HoverThrustEstimate(NamedTuple):
    """Thrust that carries the weight. Written by position_control; read by land_detector."""

    time_us: int  # [us]
    hover_thrust: float  # [-] Of full thrust
    valid: bool  # Learnt in this flight; else it is what MPC_THR_HOVER says


class WindEstimate(NamedTuple):
    """Horizontal wind. Written by commander in the air; read by mavlink (WIND_COV)."""

    time_us: int  # [us]
    velocity_north_m_s: float  # [m/s] Where the air goes to
    velocity_east_m_s: float  # [m/s]
    accuracy_m_s: float = 0.5  # [m/s] One sigma: half a degree of tilt is 0.3, the gusts' mean more
