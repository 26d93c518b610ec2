"""Builders of the messages of the camera component."""

import math
from collections.abc import Callable
from typing import Final, TypeAlias

from uav_firmware.modules.mavlink.telemetry.context import (
    INT32_MAX,
    NAN,
    Context,
    boot_ms,
    degrees_e7,
    millimetres,
    uint32,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.msg.payload import ImageCaptured, TrackingMode, VideoStream

Builder: TypeAlias = Callable[[Context], Message | None]
FLAGS: Final[int] = (
    mavlink.CAMERA_CAP_FLAGS_CAPTURE_VIDEO
    | mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
    | mavlink.CAMERA_CAP_FLAGS_HAS_MODES
    | mavlink.CAMERA_CAP_FLAGS_CAN_CAPTURE_IMAGE_IN_VIDEO_MODE
    | mavlink.CAMERA_CAP_FLAGS_CAN_CAPTURE_VIDEO_IN_IMAGE_MODE
    | mavlink.CAMERA_CAP_FLAGS_HAS_IMAGE_SURVEY_MODE
    | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT
    | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
    | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_GEO_STATUS
)
"""Capabilities: no zoom, no focus; HAS_VIDEO_STREAM is added if there is a stream."""

STORAGE_ID: Final = 1
STREAM_ID: Final = 1
_HORIZONTAL_VIEW_DEG: Final = 70
_GIMBAL_DEVICE: Final = 1
_VENDOR: Final = b"Farm Flight Bridge"
_MODEL: Final = b"Simulated camera"
_SECOND_MODEL: Final = b"Simulated vegetation camera"
_FIRMWARE_VERSION: Final = 1
_URL_BYTES: Final = 205
_MODE_OF_TRACKING: Final = {
    TrackingMode.NONE: mavlink.CAMERA_TRACKING_MODE_NONE,
    TrackingMode.POINT: mavlink.CAMERA_TRACKING_MODE_POINT,
    TrackingMode.RECTANGLE: mavlink.CAMERA_TRACKING_MODE_RECTANGLE,
}


def heartbeat(context: Context) -> Message | None:
    """HEARTBEAT of the camera; None when it does not respond."""
    status = context.topics.camera_status.value
    if status is not None and not status.answers:
        return None
    return mavlink.MAVLink_heartbeat_message(
        type=mavlink.MAV_TYPE_CAMERA,
        autopilot=mavlink.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=mavlink.MAV_STATE_STANDBY,
        mavlink_version=3,
    )


def camera_information(context: Context) -> Message | None:
    """CAMERA_INFORMATION; no definition file, as there are no further settings."""
    lens = context.topics.camera_lens.value
    if lens is None:
        return None
    streams = mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM if _stream(context) is not None else 0
    return mavlink.MAVLink_camera_information_message(
        time_boot_ms=boot_ms(context.now_us),
        vendor_name=_name(_VENDOR),
        model_name=_name(_MODEL),
        firmware_version=_FIRMWARE_VERSION,
        focal_length=lens.focal_length_mm,
        sensor_size_h=lens.sensor_width_mm,
        sensor_size_v=lens.sensor_height_mm,
        resolution_h=lens.width_px,
        resolution_v=lens.height_px,
        lens_id=0,
        flags=FLAGS | streams,
        cam_definition_version=0,
        cam_definition_uri=b"",
        gimbal_device_id=_GIMBAL_DEVICE,
    )


def _name(text: bytes) -> list[int]:
    return list(text.ljust(32, b"\x00"))


def camera_settings(context: Context) -> Message | None:
    """CAMERA_SETTINGS; neither zoom nor focus."""
    status = context.topics.camera_status.value
    if status is None:
        return None
    return mavlink.MAVLink_camera_settings_message(
        time_boot_ms=boot_ms(context.now_us),
        mode_id=int(status.mode),
        zoomLevel=NAN,
        focusLevel=NAN,
    )


def storage_information(context: Context) -> Message | None:
    """STORAGE_INFORMATION of the only storage."""
    status = context.topics.camera_status.value
    if status is None:
        return None
    return mavlink.MAVLink_storage_information_message(
        time_boot_ms=boot_ms(context.now_us),
        storage_id=STORAGE_ID,
        storage_count=1,
        status=mavlink.STORAGE_STATUS_READY,
        total_capacity=status.total_mib,
        used_capacity=status.used_mib,
        available_capacity=max(status.total_mib - status.used_mib, 0.0),
        read_speed=NAN,
        write_speed=NAN,
        type=mavlink.STORAGE_TYPE_MICROSD,
        name=b"microsd",
        storage_usage=mavlink.STORAGE_USAGE_FLAG_SET
        | mavlink.STORAGE_USAGE_FLAG_PHOTO
        | mavlink.STORAGE_USAGE_FLAG_VIDEO,
    )


def camera_capture_status(context: Context) -> Message | None:
    """CAMERA_CAPTURE_STATUS."""
    status = context.topics.camera_status.value
    if status is None:
        return None
    recording = status.recording_since_us >= 0
    recorded_us = context.now_us - status.recording_since_us if recording else 0
    return mavlink.MAVLink_camera_capture_status_message(
        time_boot_ms=boot_ms(context.now_us),
        image_status=int(status.image_status),
        video_status=int(recording),
        image_interval=status.image_interval_s,
        recording_time_ms=uint32(recorded_us / 1e3),
        available_capacity=max(status.total_mib - status.used_mib, 0.0),
        image_count=status.image_count,
    )


def _stream(context: Context) -> VideoStream | None:
    status = context.topics.camera_status.value
    return None if status is None else status.stream


def video_stream_information(context: Context) -> Message | None:
    """VIDEO_STREAM_INFORMATION of the live view.

    MAVLink has no type for Motion JPEG over HTTP; the closest is a stream over TCP.
    """
    stream = _stream(context)
    if stream is None:
        return None
    return mavlink.MAVLink_video_stream_information_message(
        stream_id=STREAM_ID,
        count=1,
        type=mavlink.VIDEO_STREAM_TYPE_TCP_MPEG,
        flags=_stream_flags(stream),
        framerate=stream.rate_hz,
        resolution_h=stream.width_px,
        resolution_v=stream.height_px,
        bitrate=0,
        rotation=0,
        hfov=_HORIZONTAL_VIEW_DEG,
        name=b"live view",
        uri=stream.uri.encode(),
        encoding=mavlink.VIDEO_STREAM_ENCODING_UNKNOWN,
    )


def video_stream_status(context: Context) -> Message | None:
    """VIDEO_STREAM_STATUS of the live view."""
    stream = _stream(context)
    if stream is None:
        return None
    return mavlink.MAVLink_video_stream_status_message(
        stream_id=STREAM_ID,
        flags=_stream_flags(stream),
        framerate=stream.rate_hz,
        resolution_h=stream.width_px,
        resolution_v=stream.height_px,
        bitrate=0,
        rotation=0,
        hfov=_HORIZONTAL_VIEW_DEG,
    )


def _stream_flags(stream: VideoStream) -> int:
    return int(mavlink.VIDEO_STREAM_STATUS_FLAGS_RUNNING) if stream.running else 0


def of_second_camera(builder: Builder) -> Builder:
    """The same message of the second camera; None while there is none."""

    def build(context: Context) -> Message | None:
        status = context.topics.camera_status.value
        if status is None or not status.has_second:
            return None
        return builder(context)

    return build


def second_camera_information(context: Context) -> Message | None:
    """CAMERA_INFORMATION of the second camera, which takes what the first one does."""
    message = camera_information(context)
    if message is not None:
        message.flags = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
        message.model_name = _name(_SECOND_MODEL)
    return message


def second_capture_status(context: Context) -> Message | None:
    """CAMERA_CAPTURE_STATUS of the second camera, with the number of its own pictures."""
    message, status = camera_capture_status(context), context.topics.camera_status.value
    if message is not None and status is not None:
        message.image_count = status.second_count
        message.video_status = message.recording_time_ms = 0
    return message


def second_image_captured(image: ImageCaptured, boot_time_utc_us: int) -> Message:
    """CAMERA_IMAGE_CAPTURED of the second picture."""
    second = image._replace(image_index=image.second_index, file_url=image.second_file_url)
    return camera_image_captured(second, boot_time_utc_us)


def camera_image_captured(image: ImageCaptured, boot_time_utc_us: int) -> Message:
    """CAMERA_IMAGE_CAPTURED; an unknown position is 0, 0."""
    return mavlink.MAVLink_camera_image_captured_message(
        time_boot_ms=boot_ms(image.time_us),
        time_utc=boot_time_utc_us + image.time_us if boot_time_utc_us > 0 else 0,
        camera_id=0,
        lat=degrees_e7(image.latitude_deg),
        lon=degrees_e7(image.longitude_deg),
        alt=millimetres(image.altitude_amsl_m),
        relative_alt=millimetres(image.relative_altitude_m),
        q=list(image.q_ned_camera),
        image_index=image.image_index,
        capture_result=int(image.succeeded),
        file_url=image.file_url.encode()[:_URL_BYTES],
    )


def camera_tracking_image_status(context: Context) -> Message | None:
    """CAMERA_TRACKING_IMAGE_STATUS; unknown values are NaN."""
    state = context.topics.tracking_state.value
    if state is None:
        return None
    x, y = state.centre
    width, height = state.extent
    point = state.mode is TrackingMode.POINT
    rectangle = state.mode is TrackingMode.RECTANGLE
    tracked = state.mode is not TrackingMode.NONE
    return mavlink.MAVLink_camera_tracking_image_status_message(
        tracking_status=int(state.status),
        tracking_mode=_MODE_OF_TRACKING[state.mode],
        target_data=mavlink.CAMERA_TRACKING_TARGET_DATA_IN_STATUS if tracked else 0,
        point_x=x if point else NAN,
        point_y=y if point else NAN,
        radius=width if point else NAN,
        rec_top_x=x - width if rectangle else NAN,
        rec_top_y=y - height if rectangle else NAN,
        rec_bottom_x=x + width if rectangle else NAN,
        rec_bottom_y=y + height if rectangle else NAN,
    )


def camera_tracking_geo_status(context: Context) -> Message | None:
    """CAMERA_TRACKING_GEO_STATUS; unknown values are INT32_MAX and NaN."""
    state = context.topics.tracking_state.value
    if state is None:
        return None
    known = math.isfinite(state.latitude_deg)
    local = context.topics.vehicle_local_position.value
    accuracy = local.horizontal_accuracy_m if known and local is not None else NAN
    north, east, down = state.velocity_ned if known else (NAN, NAN, NAN)
    return mavlink.MAVLink_camera_tracking_geo_status_message(
        tracking_status=int(state.status),
        lat=degrees_e7(state.latitude_deg) if known else INT32_MAX,
        lon=degrees_e7(state.longitude_deg) if known else INT32_MAX,
        alt=state.altitude_amsl_m,
        h_acc=accuracy,
        v_acc=NAN,
        vel_n=north,
        vel_e=east,
        vel_d=down,
        vel_acc=NAN,
        dist=state.distance_m,
        hdg=state.heading,
        hdg_acc=NAN,
    )
