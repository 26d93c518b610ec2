"""How the vehicle takes each command; one table. What is not in it is not supported."""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final

from sim.tester.vehicle.live_commands import (
    FOLLOW,
    ORBIT,
    PANORAMA,
    STOP_TRACKING,
    TAKE_PICTURES,
    TRACK_POINT,
    TRACK_RECTANGLE,
)

CAMERA: Final = 100
"""MAV_COMP_ID_CAMERA."""


class Answer(Enum):
    """A result of a command."""

    UNSUPPORTED = auto()
    SET_OUT = auto()
    PAUSE = auto()
    GO = auto()
    COME_DOWN = auto()
    SPEED = auto()
    LIVE = auto()
    STOP_LIVE = auto()
    PAYLOAD = auto()


ANSWERS: Final[Mapping[int, Answer]] = {
    20: Answer.COME_DOWN,  # NAV_RETURN_TO_LAUNCH
    21: Answer.COME_DOWN,  # NAV_LAND
    178: Answer.SPEED,  # DO_CHANGE_SPEED
    192: Answer.GO,  # DO_REPOSITION
    193: Answer.PAUSE,  # DO_PAUSE_CONTINUE
    203: Answer.PAYLOAD,  # DO_DIGICAM_CONTROL
    205: Answer.PAYLOAD,  # DO_MOUNT_CONTROL
    300: Answer.SET_OUT,  # MISSION_START
    1000: Answer.PAYLOAD,  # DO_GIMBAL_MANAGER_PITCHYAW
    2500: Answer.PAYLOAD,  # VIDEO_START_CAPTURE
    2501: Answer.PAYLOAD,  # VIDEO_STOP_CAPTURE
    ORBIT: Answer.LIVE,
    FOLLOW: Answer.LIVE,
    TRACK_POINT: Answer.LIVE,
    TRACK_RECTANGLE: Answer.LIVE,
    TAKE_PICTURES: Answer.LIVE,
    PANORAMA: Answer.LIVE,
    STOP_TRACKING: Answer.STOP_LIVE,
}
"""By MAV_CMD."""
MAVSDKS: Final = frozenset({22, 176, 185, 246, 400, 511, 512, 520})
"""What MAVSDK's own plugins answer: take-off, mode, termination, reboot, arming, messages."""
