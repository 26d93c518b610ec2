"""What the payload tells: pure, from its parts."""

import math

from uav_firmware.modules.payload.gimbal import PITCH_MAX, PITCH_MIN
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.payload import CameraStatus, GimbalStatus, TrackingMode, TrackingState

_ZERO = (0.0, 0.0, 0.0)
_UNSEEN = (math.nan, math.nan)


def camera_status(parts: Parts, now_us: int) -> CameraStatus:
    """The camera's status."""
    camera = parts.camera
    return CameraStatus(
        now_us,
        camera.mode,
        camera.image_status,
        camera.interval_s,
        parts.ledger.count,
        camera.recording_since_us,
        camera.report_interval_us,
        parts.storage.total_mib,
        parts.storage.used_mib,
        camera.answers,
    )


def gimbal_status(parts: Parts, now_us: int) -> GimbalStatus:
    """The gimbal's attitude and its controllers."""
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


def tracking_state(parts: Parts, situation: Situation) -> TrackingState:
    """What is tracked."""
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
            _ZERO,
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
        _ZERO,
        sighting.distance_m,
        math.nan,
    )
