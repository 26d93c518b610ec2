"""Handlers of camera commands; the table is at the end.

Parameters are checked before a handler runs; the handler returns the outcome.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.lib.payload_rules import unset
from uav_firmware.modules.payload.camera import tracking
from uav_firmware.modules.payload.camera.panorama import Panorama, directions
from uav_firmware.modules.payload.camera.states import CameraState
from uav_firmware.modules.payload.parts import PanoramaWork, Parts
from uav_firmware.modules.payload.situation import (
    ACCEPTED,
    Outcome,
    Situation,
    denied,
    failed,
    temporarily_rejected,
)
from uav_firmware.msg.payload import (
    Box,
    CameraMode,
    CaptureLogReset,
    Controller,
    PayloadCommand,
    TrackingMode,
)
from uav_firmware.msg.status import CommandResult, NavigationState, VehicleCommand

Handler = Callable[[VehicleCommand, Parts, Situation], Outcome]

_STORAGE_FULL: Final = failed("the storage is full")


def from_mission(command: VehicleCommand) -> bool:
    """Whether a command comes from the vehicle's own mission."""
    return command.token == 0


def _start_capture(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """IMAGE_START_CAPTURE: one picture, a number of them, or an endless series."""
    count = 0 if math.isnan(command.param3) else int(command.param3)
    sequence = 0 if unset(command.param4) else int(command.param4)
    own = from_mission(command)
    sender = Controller(command.source_system, command.source_component)
    if not own and parts.capture_log.is_repeated(sender, sequence, situation.now_us):
        return ACCEPTED
    if not parts.has_space:
        return _STORAGE_FULL
    if count == 1:
        parts.camera.take_picture(limited=not own)
        parts.capture_log.note(sender, sequence, situation.now_us)
    else:
        parts.camera.begin_series(command.param2, count, situation.now_us, from_mission=own)
    return ACCEPTED


def _stop_capture(_command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    """IMAGE_STOP_CAPTURE; a panorama in progress fails."""
    parts.camera.stop()
    return ACCEPTED


def _trigger_by_distance(command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    """DO_SET_CAM_TRIGG_DIST: 0 stops, after one more picture if parameter 3 is 1."""
    at_once, own = command.param3 == 1.0, from_mission(command)
    if unset(command.param1):
        return _stop_by_distance(parts, at_once=at_once)
    if not parts.has_space:
        return _STORAGE_FULL
    parts.camera.begin_distance(command.param1, at_once=at_once, from_mission=own)
    return ACCEPTED


def _stop_by_distance(parts: Parts, *, at_once: bool) -> Outcome:
    parts.camera.stop()
    if at_once:
        if not parts.has_space:
            return _STORAGE_FULL
        parts.camera.take_picture()
    return ACCEPTED


def _digicam(command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    """DO_DIGICAM_CONTROL: deprecated command to take a picture."""
    if command.param5 != 1.0:
        return ACCEPTED
    if not parts.has_space:
        return _STORAGE_FULL
    parts.camera.take_picture(limited=not from_mission(command))
    return ACCEPTED


def _start_video(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """VIDEO_START_CAPTURE; a mission may start a recording that already runs."""
    if from_mission(command) and parts.camera.recording_since_us >= 0:
        return ACCEPTED
    if not parts.has_space:
        return _STORAGE_FULL
    rate = 0.0 if math.isnan(command.param2) else command.param2
    parts.camera.start_video(rate, situation.now_us)
    return ACCEPTED


def _stop_video(_command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    parts.camera.stop_video()
    return ACCEPTED


def _start_streaming(_command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    """VIDEO_START_STREAMING; accepted when already streaming."""
    if not parts.stream_uri:
        return failed("there is no live view")
    parts.is_streaming = True
    return ACCEPTED


def _stop_streaming(_command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    parts.is_streaming = False
    return ACCEPTED


def _set_mode(command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    parts.camera.mode = CameraMode(int(command.param2))
    return ACCEPTED


def _reset_settings(command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    if command.param1 == 1.0:
        parts.camera.mode = CameraMode.IMAGE
    return ACCEPTED


def _format(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """STORAGE_FORMAT: parameter 2 removes the pictures, 3 only the capture log; 2 implies 3."""
    erases, resets = command.param2 == 1.0, command.param3 == 1.0
    if not (erases or resets):
        return ACCEPTED
    camera = parts.camera
    busy = camera.state is not CameraState.IDLE or parts.storing > 0 or parts.is_filming
    if busy or camera.recording_since_us >= 0:
        return temporarily_rejected("the camera takes pictures")
    if erases:
        parts.erase_due = True
        parts.storage.format()
        parts.storage.total_mib = parts.params.storage_mib
    parts.capture_log.reset()
    parts.events.append(CaptureLogReset(situation.now_us))
    return ACCEPTED


def _track_point(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    radius = 0.0 if math.isnan(command.param3) else command.param3
    around = tracking.around(command.param1, command.param2, radius)
    return _track(around, TrackingMode.POINT, parts, situation)


def _track_rectangle(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    rectangle = (command.param1, command.param2, command.param3, command.param4)
    return _track(rectangle, TrackingMode.RECTANGLE, parts, situation)


def _track(
    rectangle: tuple[float, float, float, float],
    mode: TrackingMode,
    parts: Parts,
    situation: Situation,
) -> Outcome:
    ground = situation.ground_down
    if situation.position_ned is None or ground is None:
        return temporarily_rejected("position unknown")
    view = tracking.View(situation.position_ned, parts.gimbal.q_ned_camera)
    target = tracking.choose(view, ground, rectangle, mode)
    if target is None:
        return failed("no ground is seen there")
    if parts.panorama is not None:
        return temporarily_rejected("a panorama is being taken")
    parts.point(tracking.aim_at(target))
    if parts.seeker is not None and parts.seeker.lock(Box(*rectangle), parts.gaze):
        target = target._replace(is_subject=True)
    parts.tracker.start(target, situation.now_us)
    return ACCEPTED


def _stop_tracking(_command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    """CAMERA_STOP_TRACKING: the gimbal holds its direction."""
    if parts.tracker.target is not None:
        parts.tracker.stop()
        parts.gimbal.hold()
    parts.tracker.stop()
    return ACCEPTED


def _panorama(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """PANORAMA_CREATE, by the gimbal while the vehicle holds its position."""
    if situation.state is not NavigationState.AUTO_LOITER:
        return temporarily_rejected("a panorama needs the vehicle in Hold mode")
    if not situation.comes_to_rest:
        return temporarily_rejected("the vehicle moves")
    if not parts.has_space:
        return _STORAGE_FULL
    vertical = 0.0 if math.isnan(command.param2) else command.param2
    gimbal = parts.gimbal
    try:
        shots = directions(command.param1, vertical, gimbal.pitch, gimbal.yaw)
    except ValueError as error:
        return denied(str(error))
    parts.camera.begin_panorama()
    parts.tracker.stop()
    panorama = Panorama(shots, _rate(command.param3), _rate(command.param4))
    parts.panorama = PanoramaWork(panorama, command, gimbal.aim, situation.now_us)
    gimbal.follow(panorama.aim)
    return Outcome(CommandResult.IN_PROGRESS)


def _rate(value_deg: float) -> float:
    return math.inf if unset(value_deg) else math.radians(value_deg)


HANDLERS: Final[Mapping[int, Handler]] = {
    PayloadCommand.DO_DIGICAM_CONTROL: _digicam,
    PayloadCommand.DO_SET_CAM_TRIGG_DIST: _trigger_by_distance,
    PayloadCommand.STORAGE_FORMAT: _format,
    PayloadCommand.RESET_CAMERA_SETTINGS: _reset_settings,
    PayloadCommand.SET_CAMERA_MODE: _set_mode,
    PayloadCommand.IMAGE_START_CAPTURE: _start_capture,
    PayloadCommand.IMAGE_STOP_CAPTURE: _stop_capture,
    PayloadCommand.CAMERA_TRACK_POINT: _track_point,
    PayloadCommand.CAMERA_TRACK_RECTANGLE: _track_rectangle,
    PayloadCommand.CAMERA_STOP_TRACKING: _stop_tracking,
    PayloadCommand.VIDEO_START_CAPTURE: _start_video,
    PayloadCommand.VIDEO_STOP_CAPTURE: _stop_video,
    PayloadCommand.VIDEO_START_STREAMING: _start_streaming,
    PayloadCommand.VIDEO_STOP_STREAMING: _stop_streaming,
    PayloadCommand.PANORAMA_CREATE: _panorama,
}
