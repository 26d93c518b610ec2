"""Camera and gimbal: orders to the payload, and its reports."""

from enum import IntEnum
from typing import NamedTuple, TypeAlias

from uav_firmware.msg.status import VehicleCommand
from uav_firmware.msg.vectors import Quaternion, Vector3


class PayloadCommand(IntEnum):
    """MAVLink's MAV_CMD of the commands that payload answers."""

    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONFIGURE = 204
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    STORAGE_FORMAT = 526
    RESET_CAMERA_SETTINGS = 529
    SET_CAMERA_MODE = 530
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    CAMERA_TRACK_POINT = 2004
    CAMERA_TRACK_RECTANGLE = 2005
    CAMERA_STOP_TRACKING = 2010
    VIDEO_START_CAPTURE = 2500
    VIDEO_STOP_CAPTURE = 2501
    VIDEO_START_STREAMING = 2502
    VIDEO_STOP_STREAMING = 2503
    PANORAMA_CREATE = 2800


class CameraMode(IntEnum):
    """MAVLink's CAMERA_MODE."""

    IMAGE = 0
    VIDEO = 1
    IMAGE_SURVEY = 2


class ImageStatus(IntEnum):
    """`image_status` of MAVLink's CAMERA_CAPTURE_STATUS."""

    IDLE = 0
    CAPTURING = 1
    SERIES_WAITING = 2
    SERIES_CAPTURING = 3


class TrackingStatus(IntEnum):
    """MAVLink's CAMERA_TRACKING_STATUS_FLAGS."""

    IDLE = 0
    ACTIVE = 1
    ERROR = 2


class TrackingMode(IntEnum):
    """MAVLink's CAMERA_TRACKING_MODE."""

    NONE = 0
    POINT = 1
    RECTANGLE = 2


class GimbalFlags(IntEnum):
    """MAVLink's GIMBAL_MANAGER_FLAGS, equal to its GIMBAL_DEVICE_FLAGS."""

    RETRACT = 1
    NEUTRAL = 2
    ROLL_LOCK = 4
    PITCH_LOCK = 8
    YAW_LOCK = 16
    YAW_IN_VEHICLE_FRAME = 32
    YAW_IN_EARTH_FRAME = 64


class Controller(NamedTuple):
    """Who may point the gimbal."""

    system_id: int  # [-] 0 none
    component_id: int  # [-] 0 none


class GimbalOrder(NamedTuple):
    """A streamed wish for the gimbal, which has no answer. Written by mavlink.

    NaN leaves a part as it is.
    """

    time_us: int  # [us] Of arrival
    source: Controller
    flags: int  # [-] GIMBAL_MANAGER_FLAGS
    pitch: float  # [rad] Up is positive; normalised: -1..1
    yaw: float  # [rad] In the frame that the flags name; normalised: -1..1
    pitch_rate: float  # [rad/s] Normalised: -1..1
    yaw_rate: float  # [rad/s] Normalised: -1..1
    normalised: bool  # Values are shares of what the gimbal can do


class CancelOrder(NamedTuple):
    """Break off a command that is in progress. Written by mavlink."""

    time_us: int  # [us]
    token: int  # [-] Of the command


PayloadOrder: TypeAlias = VehicleCommand | GimbalOrder | CancelOrder
"""What payload's queue of orders carries; a command with token 0 is the mission's."""


class VideoStream(NamedTuple):
    """The live view."""

    uri: str
    running: bool
    rate_hz: float  # [Hz]
    width_px: int
    height_px: int


class CameraStatus(NamedTuple):
    """What the camera does. Written by payload on change; read by mavlink."""

    time_us: int  # [us]
    mode: CameraMode
    image_status: ImageStatus
    image_interval_s: float  # [s] Between pictures of a timed series, else 0
    image_count: int  # [-] Pictures in the log of captures
    recording_since_us: int  # [us] Start of the video being recorded; -1 none
    report_interval_us: int  # [us] How often the status was asked for while recording; 0 never
    total_mib: float  # [MiB] Size of the storage
    used_mib: float  # [MiB]
    answers: bool = True  # Else the camera is dead
    stream: "VideoStream | None" = None  # None: there is none
    has_second: bool = False  # Whether a second picture is stored with each picture
    second_count: int = 0  # [-] Second pictures in the log of captures


class CameraLens(NamedTuple):
    """What the camera is built of. Written by payload at start and on change; read by mavlink."""

    focal_length_mm: float  # [mm]
    sensor_width_mm: float  # [mm]
    sensor_height_mm: float  # [mm]
    width_px: int  # [px]
    height_px: int  # [px]


class ImageCaptured(NamedTuple):
    """One picture, or an attempt at one. Written by payload, once; read by mavlink."""

    time_us: int  # [us] Of the exposure
    image_index: int  # [-] In the log of captures, from 0
    latitude_deg: float  # [deg] NaN unknown
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    relative_altitude_m: float  # [m] Above home
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    succeeded: bool
    file_url: str  # Where the picture can be fetched; empty when there is no file
    second_index: int = -1  # [-] Of the second picture among those; -1: there is none
    second_file_url: str = ""


class CaptureLogReset(NamedTuple):
    """The log of captures begins anew at index 0. Written by payload; read by mavlink."""

    time_us: int  # [us]


CameraEvent: TypeAlias = ImageCaptured | CaptureLogReset


class Box(NamedTuple):
    """A box in the picture, as shares of its width and height from its top left corner."""

    left: float
    top: float
    right: float
    bottom: float


class TrackingState(NamedTuple):
    """What the camera tracks. Written by payload while it changes; read by mavlink.

    Image coordinates run from 0, 0 (top left) to 1, 1; unknown parts are NaN.
    """

    time_us: int  # [us]
    status: TrackingStatus
    mode: TrackingMode
    centre: tuple[float, float]  # [-] Of the target in the picture
    extent: tuple[float, float]  # [-] Half width and half height, or the radius twice
    latitude_deg: float  # [deg] Of the target
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    velocity_ned: Vector3  # [m/s] Of the target
    distance_m: float  # [m] Slant range to the vehicle
    heading: float  # [rad] Where the target moves to; NaN when it stands


class GimbalStatus(NamedTuple):
    """Attitude of the gimbal and who points it. Written by payload; read by mavlink.

    `pitch` and `roll` are against the horizon, which the gimbal holds.
    """

    time_us: int  # [us]
    pitch: float  # [rad] Up is positive
    yaw: float  # [rad] From north, (-pi, pi]
    heading: float  # [rad] Of the vehicle, at the same time
    rate_pitch_yaw: tuple[float, float]  # [rad/s] In the earth frame
    heading_rate: float  # [rad/s]
    yaw_locked: bool  # Yaw is held against north, else against the vehicle
    neutral: bool  # No pointing has been asked for
    primary: Controller
    secondary: Controller
    pitch_range: tuple[float, float]  # [rad]
