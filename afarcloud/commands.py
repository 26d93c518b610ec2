"""The eleven commands, identified by `command_type_id`.

Angles are degrees, altitudes metres above home, speeds m/s, times seconds. A yaw of null
leaves the heading to the autopilot. Ranges are those of the `field` profile; the narrower
`annex` profile is a table in `afarcloud.annex`.
"""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from afarcloud.enumerations import (
    CommandType,
    FollowHeading,
    OrbitType,
    PanoramaMode,
    PrecisionLandMode,
    StartPoint,
    TrackMode,
)
from afarcloud.numbers import (
    Boolean,
    Byte,
    Fraction,
    HeightAboveHome,
    Int32,
    Latitude,
    Longitude,
    Model,
    PositiveByte,
    PositiveHeightAboveHome,
    Yaw,
    field_error,
    json_integer,
    json_number,
)

TAG_PREFIX = "command:"
"""Marks the union's tags, so that error paths can leave them out."""


class NavTakeoffParameters(Model):
    """Climb to `altitude`, then fly to the position if the vehicle is elsewhere."""

    minimum_pitch: Annotated[float, Field(ge=0, le=45), BeforeValidator(json_number)] = 0.0
    yaw_angle: Yaw | None = None
    latitude: Latitude
    longitude: Longitude
    altitude: PositiveHeightAboveHome


class NavLandParameters(Model):
    """Fly to the position and land there."""

    minimum_target_altitude: HeightAboveHome = 0.0
    precision_land_mode: Annotated[PrecisionLandMode, BeforeValidator(json_integer)] = (
        PrecisionLandMode.DISABLED
    )
    desired_yaw_angle: Yaw | None = None
    latitude: Latitude
    longitude: Longitude
    landing_altitude: Annotated[float, Field(ge=-50, le=120), BeforeValidator(json_number)] = 0.0


class NavWaypointParameters(Model):
    """Fly to the position; `hold_time` in seconds (`annex`: in tens of seconds)."""

    hold_time: Annotated[float, Field(ge=0, le=3600), BeforeValidator(json_number)] = 0.0
    acceptance_radius: Annotated[float, Field(ge=0.1, le=50), BeforeValidator(json_number)] = 1.0
    trajectory_control: Annotated[float, Field(ge=-50, le=50), BeforeValidator(json_number)] = 0.0
    desired_yaw_angle: Yaw | None = None
    latitude: Latitude
    longitude: Longitude
    altitude: HeightAboveHome


class CameraImageParameters(Model):
    """Take `photo_count` pictures, `time_interval` seconds apart."""

    yaw_angle: Yaw | None = None
    pitch_angle: Annotated[float, Field(ge=-90, le=90), BeforeValidator(json_number)]
    photo_count: PositiveByte = 1
    time_interval: Byte = 0

    @model_validator(mode="after")
    def _a_series_needs_an_interval(self) -> "CameraImageParameters":
        if self.photo_count > 1 and self.time_interval == 0:
            raise field_error("time_interval", "must be above 0 when photo_count is above 1")
        return self


class VideoStartCaptureParameters(Model):
    """Record a video stream, 0 for all; `freq` is the rate [Hz] of status messages."""

    video_stream_id: Byte = 0
    freq: Annotated[float, Field(ge=0, le=5), BeforeValidator(json_number)] = 0.0


class VideoStopCaptureParameters(Model):
    """Stop recording a video stream, 0 for all."""

    video_stream_id: Byte = 0


class NavHotpointParameters(Model):
    """Fly one full turn about a point; `angular_velocity` in deg/s."""

    latitude: Latitude
    longitude: Longitude
    orbit_altitude: Annotated[float, Field(ge=2, le=120), BeforeValidator(json_number)]
    radius: Annotated[float, Field(ge=5, le=500), BeforeValidator(json_number)]
    angular_velocity: Annotated[float, Field(gt=0, le=60), BeforeValidator(json_number)] = 20.0
    is_clockwise: Boolean = True
    start_point: Annotated[StartPoint, BeforeValidator(json_integer)] = StartPoint.NEAREST
    orbit_type: Annotated[OrbitType, BeforeValidator(json_integer)] = (
        OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS
    )


class NavFollowTargetParameters(Model):
    """Follow a target first expected at the position."""

    latitude: Latitude
    longitude: Longitude
    altitude: HeightAboveHome
    heading: Annotated[FollowHeading, BeforeValidator(json_integer)] = (
        FollowHeading.TOWARD_FOLLOW_POSITION
    )


Corner: TypeAlias = tuple[Fraction, Fraction]


class NavTrackSubjectParameters(Model):
    """Track what is inside a rectangle of the picture, corners as fractions (x, y)."""

    corners: tuple[Corner, Corner]
    track_mode: Annotated[TrackMode, BeforeValidator(json_integer)] = TrackMode.TRACE

    @model_validator(mode="after")
    def _the_corners_span_a_rectangle(self) -> "NavTrackSubjectParameters":
        (left, top), (right, bottom) = self.corners
        if not (left < right and top < bottom):
            raise field_error("corners", "must run from top left to bottom right")
        return self


class CameraPanoramaParameters(Model):
    """Take pictures all around, or half around."""

    panorama_mode: Annotated[PanoramaMode, BeforeValidator(json_integer)] = PanoramaMode.FULL_CIRCLE


class NavHomeParameters(Model):
    """Fly home; land there, or hover above it."""

    landing: Boolean = True


def _command_type(value: Any) -> CommandType:
    """Check the number first: a Literal would take true for 1."""
    return CommandType(json_integer(value))


_TypeId = BeforeValidator(_command_type)


class _Command(Model):
    command_id: Int32


class NavTakeoff(_Command):
    """Command 1."""

    command_type_id: Annotated[Literal[CommandType.NAV_TAKEOFF], _TypeId]
    parameters: NavTakeoffParameters


class NavLand(_Command):
    """Command 2."""

    command_type_id: Annotated[Literal[CommandType.NAV_LAND], _TypeId]
    parameters: NavLandParameters


class NavWaypoint(_Command):
    """Command 3."""

    command_type_id: Annotated[Literal[CommandType.NAV_WAYPOINT], _TypeId]
    parameters: NavWaypointParameters


class CameraImage(_Command):
    """Command 4."""

    command_type_id: Annotated[Literal[CommandType.CAMERA_IMAGE], _TypeId]
    parameters: CameraImageParameters


class VideoStartCapture(_Command):
    """Command 5."""

    command_type_id: Annotated[Literal[CommandType.VIDEO_START_CAPTURE], _TypeId]
    parameters: VideoStartCaptureParameters = VideoStartCaptureParameters()


class VideoStopCapture(_Command):
    """Command 6."""

    command_type_id: Annotated[Literal[CommandType.VIDEO_STOP_CAPTURE], _TypeId]
    parameters: VideoStopCaptureParameters = VideoStopCaptureParameters()


class NavHotpoint(_Command):
    """Command 7."""

    command_type_id: Annotated[Literal[CommandType.NAV_HOTPOINT], _TypeId]
    parameters: NavHotpointParameters


class NavFollowTarget(_Command):
    """Command 8."""

    command_type_id: Annotated[Literal[CommandType.NAV_FOLLOW_TARGET], _TypeId]
    parameters: NavFollowTargetParameters


class NavTrackSubject(_Command):
    """Command 9."""

    command_type_id: Annotated[Literal[CommandType.NAV_TRACK_SUBJECT], _TypeId]
    parameters: NavTrackSubjectParameters


class CameraPanorama(_Command):
    """Command 10."""

    command_type_id: Annotated[Literal[CommandType.CAMERA_PANORAMA], _TypeId]
    parameters: CameraPanoramaParameters = CameraPanoramaParameters()


class NavHome(_Command):
    """Command 11."""

    command_type_id: Annotated[Literal[CommandType.NAV_HOME], _TypeId]
    parameters: NavHomeParameters = NavHomeParameters()


def _tag(document: Any) -> str | None:
    """The union's tag for a raw command or for one of our own objects."""
    number = (
        document.get("command_type_id")
        if isinstance(document, dict)
        else getattr(document, "command_type_id", None)
    )
    try:
        return f"{TAG_PREFIX}{CommandType(json_integer(number)).name}"
    except ValueError:
        return None


Command: TypeAlias = Annotated[
    Annotated[NavTakeoff, Tag("command:NAV_TAKEOFF")]
    | Annotated[NavLand, Tag("command:NAV_LAND")]
    | Annotated[NavWaypoint, Tag("command:NAV_WAYPOINT")]
    | Annotated[CameraImage, Tag("command:CAMERA_IMAGE")]
    | Annotated[VideoStartCapture, Tag("command:VIDEO_START_CAPTURE")]
    | Annotated[VideoStopCapture, Tag("command:VIDEO_STOP_CAPTURE")]
    | Annotated[NavHotpoint, Tag("command:NAV_HOTPOINT")]
    | Annotated[NavFollowTarget, Tag("command:NAV_FOLLOW_TARGET")]
    | Annotated[NavTrackSubject, Tag("command:NAV_TRACK_SUBJECT")]
    | Annotated[CameraPanorama, Tag("command:CAMERA_PANORAMA")]
    | Annotated[NavHome, Tag("command:NAV_HOME")],
    Discriminator(_tag),
]
"""Any of the eleven."""

FLYING = frozenset(
    {
        CommandType.NAV_TAKEOFF,
        CommandType.NAV_LAND,
        CommandType.NAV_WAYPOINT,
        CommandType.NAV_HOTPOINT,
        CommandType.NAV_FOLLOW_TARGET,
        CommandType.NAV_TRACK_SUBJECT,
        CommandType.NAV_HOME,
    }
)
"""Commands that move the vehicle."""
