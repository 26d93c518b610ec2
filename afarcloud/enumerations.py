"""The enumerations of the information model, with the numbers that travel."""

from enum import IntEnum, StrEnum
from typing import Final


class CommandType(IntEnum):
    """`command_type_id`: what a command asks of the vehicle."""

    NAV_TAKEOFF = 1
    NAV_LAND = 2
    NAV_WAYPOINT = 3
    CAMERA_IMAGE = 4
    VIDEO_START_CAPTURE = 5
    VIDEO_STOP_CAPTURE = 6
    NAV_HOTPOINT = 7
    NAV_FOLLOW_TARGET = 8
    NAV_TRACK_SUBJECT = 9
    CAMERA_PANORAMA = 10
    NAV_HOME = 11


class Status(IntEnum):
    """`mission_status_id` and `command_status_id`; the last three are terminal."""

    NOT_STARTED = 1
    RUNNING = 2
    FINISHED = 3
    FAILED = 4
    ABORTED = 5

    @property
    def is_terminal(self) -> bool:
        """Whether nothing can follow it."""
        return self >= Status.FINISHED

    @property
    def has_begun(self) -> bool:
        """Whether it shows that the work was begun: what has failed may not have been."""
        return self in {Status.RUNNING, Status.FINISHED}


class EventType(IntEnum):
    """`event_type_id`: what interrupts a mission; from 101 on types beside AFarCloud's."""

    ABORT_MISSION = 1
    SOFT_ABORT_MISSION = 2
    DRONE_SPEED = 3
    PAUSE_MISSION = 101
    RESUME_MISSION = 102
    RETURN_HOME = 103

    @property
    def ends_mission(self) -> bool:
        """Whether it aborts what flies, and what waits behind it."""
        return self in _ENDING_EVENTS

    @property
    def stops_flight(self) -> bool:
        """Whether it ends what flies, or lets it hover."""
        return self.ends_mission or self is EventType.PAUSE_MISSION

    @property
    def takes_place(self) -> bool:
        """Whether it may name a place to which the vehicle goes."""
        return self in {EventType.ABORT_MISSION, EventType.SOFT_ABORT_MISSION}


_ENDING_EVENTS: Final = frozenset(
    {EventType.ABORT_MISSION, EventType.SOFT_ABORT_MISSION, EventType.RETURN_HOME}
)


class AlarmType(IntEnum):
    """`alarm_type_id`."""

    EQUIPMENT_FAILURE = 1
    FUNCTION_UNAVAILABLE = 2


class AlarmCode(IntEnum):
    """`alarm_code_id`: 1 to 6 are equipment, 50 to 53 are functions."""

    EQUIPMENT_SONAR = 1
    EQUIPMENT_PROPELLERS = 2
    EQUIPMENT_IMU = 3
    EQUIPMENT_CAMERA = 4
    EQUIPMENT_GPS = 5
    EQUIPMENT_HUMIDITY_SENSOR = 6
    FUNCTION_LOCALISATION = 50
    FUNCTION_PROPULSION = 51
    FUNCTION_NAVIGATION = 52
    FUNCTION_HUMIDITY_SENSING = 53


class StartPoint(IntEnum):
    """Where a hot-point orbit begins, seen from its centre."""

    NORTH = 0
    SOUTH = 1
    WEST = 2
    EAST = 3
    NEAREST = 4


class OrbitType(IntEnum):
    """Where the nose points during a hot-point orbit."""

    ALONG_CIRCLE_LOOKING_FORWARDS = 0
    ALONG_CIRCLE_LOOKING_BACKWARDS = 1
    TOWARDS_HOT_POINT = 2
    AWAY_FROM_HOT_POINT = 3
    CONTROLLED_BY_REMOTE_CONTROLLER = 4
    USING_INITIAL_HEADING = 5


class FollowHeading(IntEnum):
    """Where the nose points while following."""

    TOWARD_FOLLOW_POSITION = 0
    CONTROLLED_BY_REMOTE_CONTROLLER = 1


class TrackMode(IntEnum):
    """How a subject is tracked."""

    TRACE = 0
    PROFILE = 1
    SPOTLIGHT = 2
    SPOTLIGHT_PRO = 3
    QUICK_SHOT = 4


class PanoramaMode(IntEnum):
    """How much of the horizon a panorama covers."""

    FULL_CIRCLE = 0
    HALF_CIRCLE = 1


class PrecisionLandMode(IntEnum):
    """MAVLink's PRECISION_LAND_MODE."""

    DISABLED = 0
    OPPORTUNISTIC = 1
    REQUIRED = 2


class ImageFormat(StrEnum):
    """`format` of an image."""

    JPEG = "jpeg"
    PNG = "png"
    TIFF = "tiff"
    WEBP = "webp"
    DNG = "dng"


class Profile(StrEnum):
    """Which limits a plan is held to."""

    FIELD = "field"
    ANNEX = "annex"


ALARM_CODES: Final = {
    AlarmType.EQUIPMENT_FAILURE: range(1, 50),
    AlarmType.FUNCTION_UNAVAILABLE: range(50, 100),
}
"""Codes of each alarm type; those without a name in AlarmCode belong to vendors."""
