"""Table of streams: message, default rates, builder.

The rates are PX4's: those of its normal mode for a ground station (UDP 14550), and those of
its onboard mode for a companion computer or the broker (UDP 14540), some 450 messages a second.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.modules.mavlink.telemetry import (
    camera,
    controls,
    gimbal,
    guidance,
    link,
    pose,
    sensors,
    status,
)
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.wire.addressing import (
    AUTOPILOT_COMPONENT,
    CAMERA_COMPONENT,
    SECOND_CAMERA_COMPONENT,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import ProtocolVersion
from uav_firmware.modules.mavlink.wire.peers import Profile
from uav_firmware.parameters import param

Builder: TypeAlias = Callable[[Context], Message | tuple[Message, ...] | None]
"""Builds one or more messages of a type; None while the contents are unknown."""
MIN_INTERVAL_US: Final = 4000
"""Shortest interval that a peer may request: one control step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkParams:
    """Modes of the links; read at the start, as in PX4."""

    ground_station_mode: int = param(
        "MAV_0_MODE", 0, unit="1", minimum=0, maximum=2,
        short="Streams to the ground station from the next start on", read_at_start=True,
        values={0: "normal", 1: "heartbeat only", 2: "onboard"},
    )  # fmt: skip
    onboard_mode: int = param(
        "MAV_1_MODE", 2, unit="1", minimum=0, maximum=2,
        short="Streams to the broker or companion from the next start on", read_at_start=True,
        values={0: "normal", 1: "heartbeat only", 2: "onboard"},
    )  # fmt: skip


def build(builder: Builder, context: Context) -> tuple[Message, ...]:
    """Messages of a builder; empty while the contents are unknown."""
    result = builder(context)
    if result is None:
        return ()
    return result if isinstance(result, tuple) else (result,)


def stream_key(component: int, message_id: int) -> int:
    """Key of a stream in schedules; two components may send the same message."""
    return message_id if component == AUTOPILOT_COMPONENT else component << 24 | message_id


def component_of(key: int) -> int:
    """Component that sends a stream."""
    return key >> 24 or AUTOPILOT_COMPONENT


def message_of(key: int) -> int:
    """Message id of a stream."""
    return key & 0xFFFFFF


class LinkMode(IntEnum):
    """Values of MAV_0_MODE and MAV_1_MODE, as in PX4."""

    NORMAL = 0
    CUSTOM = 1  # HEARTBEAT only; other messages on request
    ONBOARD = 2


class Stream(NamedTuple):
    """One telemetry message."""

    message_id: int
    ground_station_hz: float  # [Hz] 0: only on request
    onboard_hz: float  # [Hz]
    builder: Builder
    component: int = AUTOPILOT_COMPONENT

    @property
    def key(self) -> int:
        """Key in schedules."""
        return stream_key(self.component, self.message_id)

    def rate_hz(self, mode: LinkMode) -> float:
        """Default rate [Hz] on a link of this mode."""
        if mode is LinkMode.CUSTOM and self.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return 0.0
        return self.onboard_hz if mode is LinkMode.ONBOARD else self.ground_station_hz


STREAMS: Final[tuple[Stream, ...]] = (
    Stream(mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1, 1, status.heartbeat),
    Stream(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1, 5, status.sys_status),
    Stream(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 1, 1, status.system_time),
    Stream(
        mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION,
        0,
        0,
        gimbal.gimbal_manager_information,
    ),
    Stream(
        mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS,
        0.5,
        0.5,
        gimbal.gimbal_manager_status,
    ),
    Stream(
        mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
        5,
        10,
        gimbal.gimbal_device_attitude_status,
    ),
    Stream(mavlink.MAVLINK_MSG_ID_PING, 0.1, 1, link.ping),
    Stream(mavlink.MAVLINK_MSG_ID_TIMESYNC, 0, 10, link.timesync),
    Stream(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 5, 10, sensors.gps_raw_int),
    Stream(mavlink.MAVLINK_MSG_ID_SCALED_IMU, 0, 0, sensors.scaled_imu),
    Stream(mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE, 1, 1, sensors.scaled_pressure),
    Stream(mavlink.MAVLINK_MSG_ID_HYGROMETER_SENSOR, 0.2, 1, sensors.hygrometer_sensor),
    Stream(mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, 0.2, 1, sensors.named_values),
    Stream(mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, 0.5, 10, sensors.distance_sensor),
    Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE, 15, 100, pose.attitude),
    Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 10, 50, pose.attitude_quaternion),
    Stream(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 1, 30, pose.local_position_ned),
    Stream(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5, 50, pose.global_position_int),
    Stream(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 1, 10, controls.servo_output_raw),
    Stream(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 1, 1, guidance.mission_current),
    Stream(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1, 1, pose.gps_global_origin),
    Stream(mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT, 1, 10, guidance.nav_controller_output),
    Stream(mavlink.MAVLINK_MSG_ID_RC_CHANNELS, 5, 20, controls.rc_channels),
    Stream(mavlink.MAVLINK_MSG_ID_VFR_HUD, 4, 10, pose.vfr_hud),
    Stream(
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        1.5,
        10,
        guidance.position_target_local_ned,
    ),
    Stream(
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
        1,
        10,
        guidance.position_target_global_int,
    ),
    Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET, 2, 10, guidance.attitude_target),
    Stream(mavlink.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS, 2, 5, guidance.orbit_execution_status),
    Stream(mavlink.MAVLINK_MSG_ID_FENCE_STATUS, 1, 1, guidance.fence_status),
    Stream(mavlink.MAVLINK_MSG_ID_WIND_COV, 0.5, 10, guidance.wind_cov),
    Stream(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, 0, 50, sensors.highres_imu),
    Stream(mavlink.MAVLINK_MSG_ID_ODOMETRY, 0, 30, pose.odometry),
    Stream(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 0, 0, sensors.hil_state_quaternion),
    Stream(mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS, 0, 0, controls.actuator_output_status),
    Stream(mavlink.MAVLINK_MSG_ID_ALTITUDE, 1, 10, pose.altitude),
    Stream(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 0.5, 0.5, status.battery_status),
    Stream(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 0.5, 1, status.estimator_status),
    Stream(mavlink.MAVLINK_MSG_ID_VIBRATION, 0.1, 0.5, sensors.vibration),
    Stream(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.5, 0.5, pose.home_position),
    Stream(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 1, 5, status.extended_sys_state),
    Stream(mavlink.MAVLINK_MSG_ID_FLIGHT_INFORMATION, 0, 0, status.flight_information),
    Stream(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 0.5, 0.5, status.current_mode),
    Stream(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES, 0.3, 0.3, link.available_modes_in_turn),
    Stream(
        mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR, 0.3, 0.3, status.available_modes_monitor
    ),
    Stream(ProtocolVersion.id, 0, 0, link.protocol_version),
)

CAMERA_STREAMS: Final[tuple[Stream, ...]] = tuple(
    Stream(message_id, rate_hz, rate_hz, builder, CAMERA_COMPONENT)
    for message_id, rate_hz, builder in (
        (mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1, camera.heartbeat),
        (mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION, 0, camera.camera_information),
        (mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS, 0, camera.camera_settings),
        (mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION, 0, camera.storage_information),
        (mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS, 0, camera.camera_capture_status),
        (
            mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS,
            0,
            camera.camera_tracking_image_status,
        ),
        (mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_GEO_STATUS, 0, camera.camera_tracking_geo_status),
        (mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION, 0, camera.video_stream_information),
        (mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS, 0, camera.video_stream_status),
    )
)
"""Streams of the camera component, with the same rates on both links."""

SECOND_CAMERA_STREAMS: Final[tuple[Stream, ...]] = tuple(
    Stream(message_id, rate_hz, rate_hz, camera.of_second_camera(builder), SECOND_CAMERA_COMPONENT)
    for message_id, rate_hz, builder in (
        (mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1, camera.heartbeat),
        (mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION, 0, camera.second_camera_information),
        (mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS, 0, camera.camera_settings),
        (mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION, 0, camera.storage_information),
        (mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS, 0, camera.second_capture_status),
    )
)
"""Streams of the second camera, which shares lens, storage and shutter with the first."""
_ALL: Final = STREAMS + CAMERA_STREAMS + SECOND_CAMERA_STREAMS

BUILDERS: Final[Mapping[int, Builder]] = {s.key: s.builder for s in _ALL}
"""Builders by `stream_key`, which is the message id for messages of the autopilot."""

DEFAULT_INTERVALS_US: Final[Mapping[LinkMode, Mapping[int, int]]] = {
    mode: {
        stream.key: round(1e6 / stream.rate_hz(mode)) for stream in _ALL if stream.rate_hz(mode) > 0
    }
    for mode in LinkMode
}
"""Default interval [us] of each stream by link mode."""


def default_intervals_us(params: LinkParams) -> Mapping[Profile, Mapping[int, int]]:
    """Default intervals [us] by profile of the peer."""
    return {
        Profile.GROUND_STATION: DEFAULT_INTERVALS_US[LinkMode(params.ground_station_mode)],
        Profile.ONBOARD: DEFAULT_INTERVALS_US[LinkMode(params.onboard_mode)],
    }
