"""Telemetry as a table: message, default rates, builder.

The ground station's rates are PX4's on UDP 14550. PX4's onboard rates (ATTITUDE 100 Hz and so
on, some 400 messages a second) serve companion computers that close control loops; ours serve
a broker that reports once a second, and SET_MESSAGE_INTERVAL raises them.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.modules.mavlink.builders import guidance, pose, sensors, status, targets
from uav_firmware.modules.mavlink.builders.context import Context
from uav_firmware.modules.mavlink.dialect import Message, mavlink
from uav_firmware.modules.mavlink.peers import Profile

Builder: TypeAlias = Callable[[Context], Message | None]
"""Makes a message, or None while the vehicle does not know its contents."""

MIN_INTERVAL_US: Final = 4000
"""Shortest interval that a peer may ask for: one control step."""


class Stream(NamedTuple):
    """One kind of telemetry message."""

    message_id: int
    ground_station_hz: float  # [Hz] 0: only on request
    onboard_hz: float  # [Hz]
    builder: Builder

    def rate_hz(self, profile: Profile) -> float:
        """Default rate [Hz] for a kind of peer."""
        return self.onboard_hz if profile is Profile.ONBOARD else self.ground_station_hz


STREAMS: Final[tuple[Stream, ...]] = (
    Stream(mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1, 1, status.heartbeat),
    Stream(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1, 1, status.sys_status),
    Stream(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 1, 1, status.system_time),
    Stream(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 5, 1, sensors.gps_raw_int),
    Stream(mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE, 1, 0, sensors.scaled_pressure),
    Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE, 15, 10, pose.attitude),
    Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 10, 2, pose.attitude_quaternion),
    Stream(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 1, 2, pose.local_position_ned),
    Stream(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5, 10, pose.global_position_int),
    Stream(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 1, 0, guidance.servo_output_raw),
    Stream(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 1, 1, guidance.mission_current),
    Stream(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1, 0, pose.gps_global_origin),
    Stream(mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT, 1, 0, guidance.nav_controller_output),
    Stream(mavlink.MAVLINK_MSG_ID_VFR_HUD, 4, 1, pose.vfr_hud),
    Stream(
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        1.5,
        0,
        targets.position_target_local_ned,
    ),
    Stream(
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
        1,
        0,
        targets.position_target_global_int,
    ),
    Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET, 2, 0, targets.attitude_target),
    Stream(mavlink.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS, 3, 3, guidance.orbit_execution_status),
    Stream(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, 1, 1, guidance.fence_status),
    Stream(mavlink.MAVLINK_MSG_ID_WIND_COV, 0.5, 0, targets.wind_cov),
    Stream(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, 0, 0, sensors.highres_imu),
    Stream(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 0, 0, sensors.hil_state_quaternion),
    Stream(mavlink.MAVLINK_MSG_ID_ALTITUDE, 1, 1, pose.altitude),
    Stream(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 0.5, 1, status.battery_status),
    Stream(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 0.5, 1, status.estimator_status),
    Stream(mavlink.MAVLINK_MSG_ID_VIBRATION, 0.1, 0, sensors.vibration),
    Stream(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.5, 1, pose.home_position),
    Stream(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 1, 2, status.extended_sys_state),
    Stream(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 0.5, 0.5, status.current_mode),
    Stream(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR, 0.3, 0, status.available_modes_monitor),
)

BUILDERS: Final[Mapping[int, Builder]] = {s.message_id: s.builder for s in STREAMS}

DEFAULT_INTERVALS_US: Final[Mapping[Profile, Mapping[int, int]]] = {
    profile: {
        stream.message_id: round(1e6 / stream.rate_hz(profile))
        for stream in STREAMS
        if stream.rate_hz(profile) > 0
    }
    for profile in Profile
}
"""Default interval [us] of each message that a kind of peer gets unasked."""
