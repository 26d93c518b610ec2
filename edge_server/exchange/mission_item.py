"""A mission item of a file, the commands that have a name here, and places on the ground."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final, NamedTuple, TypeAlias

from afarcloud.faults import Fault
from afarcloud.geodesy import LocalPlane

Parameters: TypeAlias = tuple[float | None, ...]
EXTRA: Final = "afarcloud"
"""Member of an item with parameters that MAVLink lacks; other programs ignore it."""


class Cmd(IntEnum):
    """MAV_CMD of MAVLink's common messages, as far as files name them."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    DO_FOLLOW = 32
    DO_ORBIT = 34
    NAV_DELAY = 93
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    SET_CAMERA_MODE = 530
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    CAMERA_TRACK_RECTANGLE = 2005
    VIDEO_START_CAPTURE = 2500
    VIDEO_STOP_CAPTURE = 2501
    PANORAMA_CREATE = 2800
    CONDITION_GATE = 4501


class Frame(IntEnum):
    """MAV_FRAME: what an altitude is measured from."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6


ABSOLUTE: Final = frozenset({Frame.GLOBAL, Frame.GLOBAL_INT})
RELATIVE: Final = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One item; `parameters` are seven, None is "not set" (MAVLink's NaN)."""

    path: str  # Its place in the file
    number: int  # Counted from 1 over the whole mission
    command: int
    frame: int
    parameters: Parameters
    auto_continue: bool = True
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def has_place(self) -> bool:
        """Whether its last three parameters are a place."""
        return self.frame != Frame.MISSION

    @property
    def title(self) -> str:
        """Its name in messages."""
        known = {cmd.value: cmd.name for cmd in Cmd}
        return f"item {self.number} ({known.get(self.command, f'MAV_CMD {self.command}')})"


class Home(NamedTuple):
    """Where a mission starts by its file; the altitude is above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float | None


class Place(NamedTuple):
    """A place with its height above home."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float

    def moved(self, north_m: float, east_m: float) -> "Place":
        """The place so far away, at the same height."""
        plane = LocalPlane.at(self.latitude_deg, self.longitude_deg)
        return Place(*plane.to_globe(north_m, east_m), self.relative_altitude_m)

    def way_to(self, other: "Place") -> tuple[float, float]:
        """North and east [m] of another place from this one."""
        plane = LocalPlane.at(self.latitude_deg, self.longitude_deg)
        return plane.to_plane(other.latitude_deg, other.longitude_deg)

    def distance_m(self, other: "Place") -> float:
        """Distance over ground."""
        return math.hypot(*self.way_to(other))

    def as_parameters(self) -> dict[str, float]:
        """The place as most commands name it."""
        return {
            "latitude": self.latitude_deg,
            "longitude": self.longitude_deg,
            "altitude": self.relative_altitude_m,
        }


class MissionFile(NamedTuple):
    """The content of a mission file of any format, before it is translated."""

    items: list[Item]
    home: Home | None
    speed_m_s: float | None = None  # Where no item has one
    zero_yaw_is_unset: bool = False
    geofence: dict[str, Any] | None = None
    rally_points: Sequence[Mapping[str, Any]] = ()
    warnings: tuple[Fault, ...] = ()
    missing: tuple[Fault, ...] = ()  # Parts that the file names and does not contain
