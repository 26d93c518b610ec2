"""Builds the status messages of the payload. Pure."""

import math
from typing import Final

from uav_firmware.lib.vector import ZERO
from uav_firmware.modules.payload.camera.gimbal import PITCH_MAX, PITCH_MIN
from uav_firmware.modules.payload.camera.lens import lens
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.payload import (
    CameraStatus,
    GimbalStatus,
    TrackingMode,
    TrackingState,
    VideoStream,
)
from uav_firmware.msg.vectors import Vector3

_UNSEEN = (math.nan, math.nan)
_STATIONARY_M_S: Final = 0.2  # Slower targets have no course


def camera_status(parts: Parts, now_us: int) -> CameraStatus:
    """The camera's status."""
    camera = parts.camera
    return CameraStatus(
        now_us,
        camera.mode,
        camera.image_status,
        camera.interval_s,
        parts.capture_log.count,
        camera.recording_since_us,
        camera.report_interval_us,
        parts.storage.total_mib,
        parts.storage.used_mib,
        camera.answers,
        _stream(parts),
        parts.params.second_picture != 0,
        parts.capture_log.second_count,
    )


def _stream(parts: Parts) -> VideoStream | None:
    if not parts.stream_uri:
        return None
    params = parts.params
    picture = lens(params.video_width_px)
    return VideoStream(
        parts.stream_uri,
        parts.is_streaming,
        params.video_rate_hz,
        picture.width_px,
        picture.height_px,
    )


def gimbal_status(parts: Parts, now_us: int) -> GimbalStatus:
    """Attitude and controllers of the gimbal."""
    gimbal = parts.gimbal
    return GimbalStatus(
        now_us,
        gimbal.pitch,
        gimbal.yaw,
        gimbal.heading,
        (gimbal.rate_pitch, gimbal.rate_yaw),
        gimbal.heading_rate,
        gimbal.locked,
        parts.neutral,
        parts.control.primary,
        parts.control.secondary,
        (PITCH_MIN, PITCH_MAX),
    )


def _course(velocity_ned: Vector3) -> float:
    """Course of a target [rad]; NaN when it is stationary."""
    north, east, _ = velocity_ned
    return math.atan2(east, north) if math.hypot(north, east) > _STATIONARY_M_S else math.nan


def tracking_state(parts: Parts, situation: Situation) -> TrackingState:
    """State of tracking."""
    tracker = parts.tracker
    target, sighting = tracker.target, tracker.sighting
    if target is None or sighting is None:
        return TrackingState(
            situation.now_us,
            tracker.status,
            TrackingMode.NONE if target is None else target.mode,
            _UNSEEN,
            _UNSEEN,
            math.nan,
            math.nan,
            math.nan,
            ZERO,
            math.nan,
            math.nan,
        )
    return TrackingState(
        situation.now_us,
        tracker.status,
        target.mode,
        sighting.centre,
        sighting.extent,
        *situation.to_geodetic(target.position_ned),
        target.velocity_ned,
        sighting.distance_m,
        _course(target.velocity_ned),
    )
