"""Which parameters of camera and gimbal commands have a meaning here: pure.

Navigator asks before it accepts a mission, payload before it carries out a command, so that both
refuse the same. Numbers and meanings are MAVLink's (common.xml); an unset parameter is NaN or 0,
and a parameter that is set without an effect is a fault, as with PX4's masks.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from uav_firmware.msg.payload import CameraMode, GimbalFlags, PayloadCommand

CAMERA_COMPONENT: Final = 100
"""MAV_COMP_ID_CAMERA: the one camera's component; attached, its id is 1."""
GIMBAL_DEVICE: Final = 1
INTERVAL_MIN_S: Final = 0.5
"""[s] Shortest time between pictures."""
STATUS_RATE_MAX_HZ: Final = 50.0
PITCH_MIN_DEG: Final = -90.0
PITCH_MAX_DEG: Final = 30.0
"""[deg] What the gimbal can do, up positive; yaw turns without end."""
MOUNT_NEUTRAL: Final = 1.0
MOUNT_TARGETING: Final = 2.0
MOUNT_PLACE: Final = 4.0


class Fault(NamedTuple):
    """A parameter that cannot be honoured."""

    parameter: int  # [-] From 1
    reason: str  # Completes "parameter N"


Parameters = Sequence[float]
_Rule = Callable[[Parameters], Fault | None]

_HONOURED: Final[Mapping[int, frozenset[int]]] = {
    PayloadCommand.DO_DIGICAM_CONTROL: frozenset({5, 6, 7}),
    PayloadCommand.DO_MOUNT_CONFIGURE: frozenset({1, 2, 3, 4, 5, 6, 7}),
    PayloadCommand.DO_MOUNT_CONTROL: frozenset({1, 2, 3, 4, 5, 6, 7}),
    PayloadCommand.DO_SET_CAM_TRIGG_DIST: frozenset({1, 2, 3, 4}),
    PayloadCommand.STORAGE_FORMAT: frozenset({1, 2, 3}),
    PayloadCommand.RESET_CAMERA_SETTINGS: frozenset({1, 2}),
    PayloadCommand.SET_CAMERA_MODE: frozenset({1, 2}),
    PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW: frozenset({1, 2, 3, 4, 5, 7}),
    PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE: frozenset({1, 2, 3, 4, 7}),
    PayloadCommand.IMAGE_START_CAPTURE: frozenset({1, 2, 3, 4}),
    PayloadCommand.IMAGE_STOP_CAPTURE: frozenset({1}),
    PayloadCommand.CAMERA_TRACK_POINT: frozenset({1, 2, 3, 4}),
    PayloadCommand.CAMERA_TRACK_RECTANGLE: frozenset({1, 2, 3, 4, 5}),
    PayloadCommand.CAMERA_STOP_TRACKING: frozenset({1}),
    PayloadCommand.VIDEO_START_CAPTURE: frozenset({1, 2, 3}),
    PayloadCommand.VIDEO_STOP_CAPTURE: frozenset({1, 2}),
    PayloadCommand.VIDEO_START_STREAMING: frozenset({1, 2}),
    PayloadCommand.VIDEO_STOP_STREAMING: frozenset({1, 2}),
    PayloadCommand.PANORAMA_CREATE: frozenset({1, 2, 3, 4}),
}


def fault_of(command: int, parameters: Parameters) -> Fault | None:
    """First parameter of a camera or gimbal command that cannot be honoured, or None.

    `command` is one of `PayloadCommand`; `parameters` are its seven.
    """
    honoured = _HONOURED[command]
    for number, value in enumerate(parameters, start=1):
        if math.isinf(value):
            return Fault(number, "is infinite")
        if number not in honoured and not unset(value):
            return Fault(number, f"is {value:g} but has no effect and must be unset")
    for rule in _RULES.get(command, ()):
        fault = rule(parameters)
        if fault is not None:
            return fault
    return None


def unset(value: float) -> bool:
    """Whether a parameter carries no value: MAVLink uses NaN and, where 0 means nothing, 0."""
    return math.isnan(value) or value == 0.0


def _one_of(number: int, *allowed: float, what: str = "") -> _Rule:
    def rule(parameters: Parameters) -> Fault | None:
        value = parameters[number - 1]
        if math.isnan(value) or value in allowed:
            return None
        return Fault(number, f"is {value:g}{what}")

    return rule


def _within(number: int, low: float, high: float, unit: str) -> _Rule:
    def rule(parameters: Parameters) -> Fault | None:
        value = parameters[number - 1]
        if math.isnan(value) or low <= value <= high:
            return None
        return Fault(number, f"is {value:g}, not within {low:g} to {high:g} {unit}")

    return rule


def _camera(number: int) -> _Rule:
    """All cameras, the first attached one, or the component: there is one camera."""
    return _one_of(number, 0.0, 1.0, CAMERA_COMPONENT, what=", and no camera has this id")


def _gimbal(number: int) -> _Rule:
    return _one_of(number, 0.0, GIMBAL_DEVICE, what=", and no gimbal has this id")


def _given(number: int, what: str) -> _Rule:
    def rule(parameters: Parameters) -> Fault | None:
        return Fault(number, f"holds no {what}") if math.isnan(parameters[number - 1]) else None

    return rule


def _interval(parameters: Parameters) -> Fault | None:
    value = parameters[1]
    if unset(value) or value >= INTERVAL_MIN_S:
        return None
    return Fault(2, f"is {value:g} s, and the camera needs {INTERVAL_MIN_S:g} s for a picture")


def _whole(number: int, what: str) -> _Rule:
    def rule(parameters: Parameters) -> Fault | None:
        value = parameters[number - 1]
        if math.isnan(value) or (value >= 0.0 and value.is_integer()):
            return None
        return Fault(number, f"is {value:g}, no {what}")

    return rule


def _yaw_frame(parameters: Parameters) -> Fault | None:
    flags = parameters[4]
    if math.isnan(flags):
        return None
    if not (flags.is_integer() and 0.0 <= flags < 1024.0):
        return Fault(5, f"is {flags:g}, no flags")
    both = GimbalFlags.YAW_IN_VEHICLE_FRAME | GimbalFlags.YAW_IN_EARTH_FRAME
    if int(flags) & both == both:
        return Fault(5, "names two frames of yaw")
    if int(flags) & GimbalFlags.RETRACT:
        return Fault(5, "asks to retract, and the gimbal cannot")
    return None


def _controller(parameters: Parameters) -> Fault | None:
    for number, value in enumerate(parameters[:4], start=1):
        if not (math.isnan(value) or (value.is_integer() and -3.0 <= value <= 255.0)):
            return Fault(number, f"is {value:g}, no system or component")
    return None


def _mount(parameters: Parameters) -> Fault | None:
    """DO_MOUNT_CONTROL: pitch and yaw, a place, or neutral."""
    mode = parameters[6]
    if mode == MOUNT_PLACE:
        return _unused(parameters, 1, 2, 3) or _place(parameters)
    if mode == MOUNT_TARGETING:
        return (
            _unused(parameters, 2, 4, 5, 6)
            or _within(1, PITCH_MIN_DEG, PITCH_MAX_DEG, "degrees")(parameters)
            or _within(3, -360.0, 360.0, "degrees")(parameters)
        )
    if mode == MOUNT_NEUTRAL:
        return _unused(parameters, 1, 2, 3, 4, 5, 6)
    return Fault(7, f"is {mode:g}: only 1 (neutral), 2 (angles) and 4 (a place) are supported")


def _place(parameters: Parameters) -> Fault | None:
    return (
        _given(4, "altitude")(parameters)
        or _given(5, "latitude")(parameters)
        or _given(6, "longitude")(parameters)
        or _within(5, -90.0, 90.0, "degrees")(parameters)
        or _within(6, -180.0, 180.0, "degrees")(parameters)
    )


def _unused(parameters: Parameters, *numbers: int) -> Fault | None:
    for number in numbers:
        if not unset(parameters[number - 1]):
            return Fault(number, f"is {parameters[number - 1]:g} but has no effect in this mode")
    return None


def _rectangle(parameters: Parameters) -> Fault | None:
    left, top, right, bottom = parameters[:4]
    if not right > left:
        return Fault(3, "does not lie right of parameter 1")
    if not bottom > top:
        return Fault(4, "does not lie below parameter 2")
    return None


def _in_picture(*numbers: int) -> tuple[_Rule, ...]:
    return tuple(
        rule
        for number in numbers
        for rule in (_given(number, "place in the picture"), _within(number, 0.0, 1.0, "in all"))
    )


def _shutter(parameters: Parameters) -> Fault | None:
    value = parameters[1]
    if unset(value) or value == -1.0:
        return None
    return Fault(2, "sets a shutter time, and the camera exposes by itself")


_STREAM: Final = (_one_of(1, 0.0, 1.0, what=", and no stream has this id"), _camera(2))

_RULES: Final[Mapping[int, tuple[_Rule, ...]]] = {
    PayloadCommand.DO_DIGICAM_CONTROL: (_one_of(5, 0.0, 1.0),),
    PayloadCommand.DO_MOUNT_CONFIGURE: (
        _one_of(1, MOUNT_NEUTRAL, MOUNT_TARGETING, MOUNT_PLACE, what=", no mode of this gimbal"),
        *(_one_of(number, 0.0, 1.0) for number in (2, 3, 4)),
        *(_one_of(number, 0.0, 2.0) for number in (5, 6, 7)),
    ),
    PayloadCommand.DO_MOUNT_CONTROL: (_mount,),
    PayloadCommand.DO_SET_CAM_TRIGG_DIST: (
        _within(1, 0.0, 10_000.0, "m"),
        _shutter,
        _one_of(3, 0.0, 1.0),
        _camera(4),
    ),
    PayloadCommand.STORAGE_FORMAT: (
        _one_of(1, 0.0, 1.0, what=", and no storage has this id"),
        _one_of(2, 0.0, 1.0),
        _one_of(3, 0.0, 1.0),
    ),
    PayloadCommand.RESET_CAMERA_SETTINGS: (_one_of(1, 0.0, 1.0), _camera(2)),
    PayloadCommand.SET_CAMERA_MODE: (
        _camera(1),
        _given(2, "mode"),
        _one_of(2, *map(float, CameraMode), what=", no mode of this camera"),
    ),
    PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW: (
        _within(1, PITCH_MIN_DEG, PITCH_MAX_DEG, "degrees"),
        _within(2, -360.0, 360.0, "degrees"),
        _yaw_frame,
        _gimbal(7),
    ),
    PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE: (_controller, _gimbal(7)),
    PayloadCommand.IMAGE_START_CAPTURE: (
        _camera(1),
        _interval,
        _whole(3, "number of pictures"),
        _whole(4, "sequence number"),
    ),
    PayloadCommand.IMAGE_STOP_CAPTURE: (_camera(1),),
    PayloadCommand.CAMERA_TRACK_POINT: (
        *_in_picture(1, 2),
        _within(3, 0.0, 1.0, "in all"),
        _camera(4),
    ),
    PayloadCommand.CAMERA_TRACK_RECTANGLE: (*_in_picture(1, 2, 3, 4), _rectangle, _camera(5)),
    PayloadCommand.CAMERA_STOP_TRACKING: (_camera(1),),
    PayloadCommand.VIDEO_START_CAPTURE: (
        _one_of(1, 0.0, 1.0, what=", and no stream has this id"),
        _within(2, 0.0, STATUS_RATE_MAX_HZ, "Hz"),
        _camera(3),
    ),
    PayloadCommand.VIDEO_STOP_CAPTURE: _STREAM,
    PayloadCommand.VIDEO_START_STREAMING: _STREAM,
    PayloadCommand.VIDEO_STOP_STREAMING: _STREAM,
    PayloadCommand.PANORAMA_CREATE: (
        _given(1, "angle"),
        _within(1, 1.0, 360.0, "degrees"),
        _within(2, 0.0, 120.0, "degrees"),
        _within(3, 0.0, 360.0, "degrees/s"),
        _within(4, 0.0, 360.0, "degrees/s"),
    ),
}
