"""Estimated state of the vehicle. Written by estimator."""

from enum import IntFlag
from typing import Final, NamedTuple

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.msg.vectors import Quaternion, Vector3


class AidSource(IntFlag):
    """Sources of aiding that the estimator accepts or stops one by one."""

    GPS_POSITION = 1
    GPS_VELOCITY = 2
    GPS_HEIGHT = 4
    BAROMETER = 8


class EstimateResets(NamedTuple):
    """Steps by which the estimate was moved since boot, as in PX4's vehicle_local_position.

    A reset moves the estimate, not the vehicle. Who keeps a setpoint moves it by the change of
    the totals since the last look, so that no reset is lost between two looks.
    """

    xy_count: int = 0
    z_count: int = 0
    velocity_xy_count: int = 0
    velocity_z_count: int = 0
    heading_count: int = 0
    position_delta_ned: Vector3 = (0.0, 0.0, 0.0)  # [m] Of the last reset of each part
    velocity_delta_ned: Vector3 = (0.0, 0.0, 0.0)  # [m/s]
    heading_delta: float = 0.0  # [rad]
    position_total_ned: Vector3 = (0.0, 0.0, 0.0)  # [m] Sum of all resets
    velocity_total_ned: Vector3 = (0.0, 0.0, 0.0)  # [m/s]
    heading_total: float = 0.0  # [rad]

    @property
    def number(self) -> int:
        """Number of resets in any dimension."""
        return (
            self.xy_count
            + self.z_count
            + self.velocity_xy_count
            + self.velocity_z_count
            + self.heading_count
        )


_NO_RESETS: Final = EstimateResets()


@mypyc_attr(acyclic=True, free_list_len=1)
class VehicleAttitude:
    """Attitude, at control rate; read by attitude_control, rate_control and mavlink."""

    __slots__ = ("q_ned_frd", "rate_frd", "time_us")

    def __init__(
        self,
        time_us: int,  # [us] Time of the IMU sample
        q_ned_frd: Quaternion,  # [-] Body to NED
        rate_frd: Vector3,  # [rad/s] Bias-corrected angular rate
    ) -> None:
        self.time_us: Final = time_us
        self.q_ned_frd: Final = q_ned_frd
        self.rate_frd: Final = rate_frd


@mypyc_attr(acyclic=True, free_list_len=1)
class VehicleLocalPosition:
    """Position about the local origin; read by position_control, navigator, mavlink."""

    __slots__ = (
        "acceleration_ned",
        "altitude_valid",
        "dead_reckoning",
        "heading",
        "heading_valid",
        "horizontal_accuracy_m",
        "origin_altitude_amsl_m",
        "origin_latitude_deg",
        "origin_longitude_deg",
        "position_ned",
        "position_valid",
        "resets",
        "sink_accuracy_m_s",
        "time_us",
        "velocity_ned",
        "velocity_valid",
        "vertical_accuracy_m",
    )

    def __init__(
        self,
        time_us: int,  # [us]
        position_ned: Vector3,  # [m] About the origin; down is positive
        velocity_ned: Vector3,  # [m/s]
        acceleration_ned: Vector3,  # [m/s^2] Gravity removed
        heading: float,  # [rad] Yaw of the body x axis from north, (-pi, pi]
        origin_latitude_deg: float,  # [deg] Of position (0, 0, 0)
        origin_longitude_deg: float,  # [deg]
        origin_altitude_amsl_m: float,  # [m]
        horizontal_accuracy_m: float,  # [m] One sigma
        vertical_accuracy_m: float,  # [m] One sigma
        position_valid: bool,  # Horizontal position observed
        altitude_valid: bool,  # Vertical position observed
        velocity_valid: bool,  # Velocity observed
        heading_valid: bool,  # Heading observed
        resets: EstimateResets = _NO_RESETS,
        dead_reckoning: bool = False,  # Neither GPS position nor GPS velocity aids it
        sink_accuracy_m_s: float = 0.0,  # [m/s] Of the vertical velocity, one sigma
    ) -> None:
        self.time_us: Final = time_us
        self.position_ned: Final = position_ned
        self.velocity_ned: Final = velocity_ned
        self.acceleration_ned: Final = acceleration_ned
        self.heading: Final = heading
        self.origin_latitude_deg: Final = origin_latitude_deg
        self.origin_longitude_deg: Final = origin_longitude_deg
        self.origin_altitude_amsl_m: Final = origin_altitude_amsl_m
        self.horizontal_accuracy_m: Final = horizontal_accuracy_m
        self.vertical_accuracy_m: Final = vertical_accuracy_m
        self.position_valid: Final = position_valid
        self.altitude_valid: Final = altitude_valid
        self.velocity_valid: Final = velocity_valid
        self.heading_valid: Final = heading_valid
        self.resets: Final = resets
        self.dead_reckoning: Final = dead_reckoning
        self.sink_accuracy_m_s: Final = sink_accuracy_m_s

    @property
    def origin(self) -> Vector3:
        """Latitude, longitude [deg] and altitude AMSL [m] of the origin; NaN while unknown."""
        return (
            self.origin_latitude_deg,
            self.origin_longitude_deg,
            self.origin_altitude_amsl_m,
        )


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
    stopped: AidSource = AidSource(0)  # Sources that disagree with the others and are not used
    heading_set_us: int | None = (
        None  # [us] When it was last set by the course, against the compass
    )


class HoverThrustEstimate(NamedTuple):
    """Thrust that carries the weight. Written by position_control; read by land_detector."""

    time_us: int  # [us]
    hover_thrust: float  # [-] Of full thrust
    valid: bool  # Learnt in this flight; else it is MPC_THR_HOVER


class TerrainEstimate(NamedTuple):
    """Ground under the vehicle, by the range finder; not published while that is unknown.

    Written by land_detector; read by navigator, manual_control and commander.
    """

    time_us: int  # [us] Of the newest sample
    ground_down: float  # [m] Down coordinate of the ground about the local origin
    has_failed: bool = False  # The range finder is stuck: the ground is not known (NaN)


class WindEstimate(NamedTuple):
    """Horizontal wind. Written by commander in the air; read by mavlink (WIND_COV)."""

    time_us: int  # [us]
    velocity_north_m_s: float  # [m/s] Where the air goes to
    velocity_east_m_s: float  # [m/s]
    accuracy_m_s: float = 0.5  # [m/s] One sigma: half a degree of tilt is 0.3, the gusts' mean more
