"""Builders of messages of gimbal manager and gimbal device, both served by the autopilot."""

import math
from typing import Final

from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.mavlink.telemetry.context import Context, boot_ms
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.msg.payload import GimbalFlags, GimbalStatus

DEVICE_ID: Final = 1
"""Id of a gimbal without its own component."""

CAPABILITIES: Final[int] = (
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_NEUTRAL
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_ROLL_LOCK
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_LOCK
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_FOLLOW
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_LOCK
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_SUPPORTS_INFINITE_YAW
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_SUPPORTS_YAW_IN_EARTH_FRAME
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_CAN_POINT_LOCATION_GLOBAL
)
"""Capabilities; roll is stabilised and cannot be commanded."""


def _flags(status: GimbalStatus) -> int:
    """Flags: roll and pitch locked, and the frame of yaw."""
    flags = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK
    flags |= GimbalFlags.NEUTRAL if status.neutral else 0
    if status.yaw_locked:
        return flags | GimbalFlags.YAW_LOCK | GimbalFlags.YAW_IN_EARTH_FRAME
    return flags | GimbalFlags.YAW_IN_VEHICLE_FRAME


def gimbal_manager_information(context: Context) -> Message | None:
    """GIMBAL_MANAGER_INFORMATION."""
    status = context.topics.gimbal_status.value
    if status is None:
        return None
    return mavlink.MAVLink_gimbal_manager_information_message(
        time_boot_ms=boot_ms(context.now_us),
        cap_flags=CAPABILITIES,
        gimbal_device_id=DEVICE_ID,
        roll_min=0.0,
        roll_max=0.0,
        pitch_min=status.pitch_range[0],
        pitch_max=status.pitch_range[1],
        yaw_min=-math.pi,
        yaw_max=math.pi,
    )


def gimbal_manager_status(context: Context) -> Message | None:
    """GIMBAL_MANAGER_STATUS: who is in control."""
    status = context.topics.gimbal_status.value
    if status is None:
        return None
    return mavlink.MAVLink_gimbal_manager_status_message(
        time_boot_ms=boot_ms(context.now_us),
        flags=_flags(status),
        gimbal_device_id=DEVICE_ID,
        primary_control_sysid=status.primary.system_id,
        primary_control_compid=status.primary.component_id,
        secondary_control_sysid=status.secondary.system_id,
        secondary_control_compid=status.secondary.component_id,
    )


def gimbal_device_attitude_status(context: Context) -> Message | None:
    """GIMBAL_DEVICE_ATTITUDE_STATUS in the frame of its flags.

    Angular velocity is about the camera's axes; `delta_yaw` turns the vehicle's frame to earth's.
    """
    status = context.topics.gimbal_status.value
    if status is None:
        return None
    yaw, (pitch_rate, yaw_rate) = status.yaw, status.rate_pitch_yaw
    if not status.yaw_locked:
        yaw, yaw_rate = yaw - status.heading, yaw_rate - status.heading_rate
    return mavlink.MAVLink_gimbal_device_attitude_status_message(
        target_system=0,
        target_component=0,
        time_boot_ms=boot_ms(status.time_us),
        flags=_flags(status),
        q=list(from_euler(0.0, status.pitch, yaw)),
        angular_velocity_x=-math.sin(status.pitch) * yaw_rate,
        angular_velocity_y=pitch_rate,
        angular_velocity_z=math.cos(status.pitch) * yaw_rate,
        failure_flags=0,
        delta_yaw=status.heading,
        delta_yaw_velocity=status.heading_rate,
        gimbal_device_id=DEVICE_ID,
    )
