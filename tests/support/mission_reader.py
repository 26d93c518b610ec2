"""Reads mission items and live commands back as AFarCloud's commands: the translation's inverse.

It knows what the items mean, and nothing of how they were made: from MISSION_ITEM_INT as a vehicle
gives them back, it finds the commands in their order, their items, and what they ask for.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from afarcloud.enumerations import CommandType, PanoramaMode
from tests.support.geodesy import LocalGround
from tests.support.vehicle_wire import Message, mavlink

TAKEOFF, LAND, WAYPOINT, RETURN = 22, 21, 16, 20
HOLD, SPEED, YAW, TURNS, DELAY = 17, 178, 115, 18, 93
LOOK_AT, LOOK_AHEAD = 195, 197
AIM = frozenset({1000, 205})
TAKE_GIMBAL = 1001
SHOOT = frozenset({2000, 203})
VIDEO_START, VIDEO_STOP = 2500, 2501
FEWEST_SHOTS = 5
"""Of a panorama: a picture after a waypoint is none."""


class Place(NamedTuple):
    """Where an item is [deg, deg, m above home]."""

    latitude: float
    longitude: float
    altitude: float


@dataclass
class ReadCommand:
    """One command as it can be read from a vehicle."""

    kind: CommandType
    items: range
    values: dict[str, Any]


class UnreadableError(Exception):
    """Items that mean no command."""


class MissionReader:
    """Goes through the items of one stretch."""

    def __init__(
        self,
        items: Sequence[Message],
        home: tuple[float, float],
        first: int,
        *,
        has_yaws: bool = True,
    ) -> None:
        """Take the items; `has_yaws` unless the vehicle keeps none in items with a place."""
        self._items = items
        self._has_yaws = has_yaws
        self._home = home
        self._next = first
        self.speed_m_s: float | None = None
        self.holds = False
        self.commands: list[ReadCommand] = []

    def read(self) -> list[ReadCommand]:
        """Give the commands.

        Raises:
            UnreadableError: if some item belongs to none.
        """
        while self._next < len(self._items):
            if self.holds:
                raise UnreadableError("something follows the last hold")
            if self._peek() == SPEED and not self._rounds():
                self._speed()
            elif self._peek() == HOLD:
                self._take()
                self.holds = True
            else:
                self._command()
        return self.commands

    def _command(self) -> None:
        begin = self._next
        for kind, reader in _READERS:
            values = reader(self)
            if values is not None:
                self.commands.append(ReadCommand(kind, range(begin, self._next), values))
                return
            self._next = begin
        raise UnreadableError(f"item {begin}: command {self._peek()}")

    def _speed(self) -> None:
        """Read a speed, given by one or two items."""
        while self._peek() == SPEED and not self._rounds():
            self.speed_m_s = self._take().param2

    def _rounds(self) -> bool:
        """Whether a speed is that of the circle behind it."""
        return self._peek(1) in {TURNS, LOOK_AT}

    # What the readers of the kinds use.

    def _peek(self, ahead: int = 0) -> int | None:
        index = self._next + ahead
        return self._items[index].command if index < len(self._items) else None

    def _take(self) -> Message:
        self._next += 1
        return self._items[self._next - 1]

    def _positional(self, command: int) -> tuple[Message, float | None] | None:
        """Take an item with a place and its yaw, which may stand in an item before it."""
        yaw = self._take().param1 if self._peek() == YAW else math.nan
        if self._peek() != command:
            return None
        item = self._take()
        yaw = item.param4 if math.isnan(yaw) and self._has_yaws else yaw
        return item, None if math.isnan(yaw) else yaw

    def takeoff(self) -> dict[str, Any] | None:
        if self._peek() != TAKEOFF:
            return None
        climb = self._take()
        self._speed()
        positional = self._positional(WAYPOINT)
        if positional is None or place(positional[0]) != place(climb):
            raise UnreadableError("nothing goes to the place of the take-off")
        return {**place(climb)._asdict(), "yaw_angle": positional[1], "minimum_pitch": climb.param1}

    def land(self) -> dict[str, Any] | None:
        positional = self._positional(LAND)
        if positional is None:
            return None
        item, yaw = positional
        latitude, longitude, altitude = place(item)
        return {
            "latitude": latitude,
            "longitude": longitude,
            "landing_altitude": altitude,
            "desired_yaw_angle": yaw,
            "minimum_target_altitude": item.param1,
            "precision_land_mode": item.param2,
        }

    def panorama(self) -> dict[str, Any] | None:
        yaws: list[float] = []
        while True:
            begin = self._next
            positional = self._positional(WAYPOINT)
            if positional is None or positional[1] is None or self._peek() not in SHOOT:
                self._next = begin
                break
            self._take()
            yaws.append(positional[1])
        if len(yaws) < FEWEST_SHOTS or self._peek() != DELAY:
            return None
        self._take()
        return {"panorama_mode": _mode_of(yaws)}

    def hotpoint(self) -> dict[str, Any] | None:
        start = place(self._take()) if self._peek() == WAYPOINT else None
        self._speed()
        slowly = self._peek() == SPEED and self._rounds()
        if slowly:
            self._take()
        inwards = self._peek() == LOOK_AT
        if inwards:
            self._take()
        if self._peek() != TURNS:
            return None
        item = self._take()
        centre = place(item)
        if inwards:
            if self._peek() != LOOK_AHEAD:
                raise UnreadableError("it never looks ahead again")
            self._take()
        if slowly and self._peek() != SPEED:
            raise UnreadableError("it never flies as fast again")
        self._speed()
        if start is not None:
            away = metres_between(start[:2], centre[:2])
            if not math.isclose(away, abs(item.param3), rel_tol=0.02, abs_tol=0.5):
                return None  # A waypoint, and a hotpoint behind it
        return {
            "latitude": centre.latitude,
            "longitude": centre.longitude,
            "orbit_altitude": centre.altitude,
            "radius": abs(item.param3),
            "is_clockwise": item.param3 > 0.0,
            "turns": item.param1,
        }

    def home(self) -> dict[str, Any] | None:
        if self._peek() == RETURN:
            self._take()
            return {"landing": True}
        if self._peek() != WAYPOINT:
            return None
        item = self._take()
        here = place(item)
        at_home = metres_between(here[:2], self._home) < 0.05 and item.param2 == 0.0
        return {"landing": False, "altitude": here.altitude} if at_home else None

    def waypoint(self) -> dict[str, Any] | None:
        positional = self._positional(WAYPOINT)
        if positional is None:
            return None
        item, yaw = positional
        return {
            **place(item)._asdict(),
            "desired_yaw_angle": yaw,
            "hold_time": item.param1,
            "acceptance_radius": item.param2,
        }

    def image(self) -> dict[str, Any] | None:
        takes = self._peek() == TAKE_GIMBAL
        if takes:
            self._take()
        aim = self._take() if self._peek() in AIM else None
        if takes and aim is None:
            raise UnreadableError("it takes a gimbal that it does not point")
        if aim is not None and self._peek() == DELAY:
            self._take()
        if self._peek() not in SHOOT or self._peek(1) != DELAY:
            return None
        shots = self._take()
        self._take()
        values = {"photo_count": shots.param3, "time_interval": shots.param2}
        return values if aim is None else values | {"pitch_angle": aim.param1}

    def video_start(self) -> dict[str, Any] | None:
        if self._peek() != VIDEO_START:
            return None
        item = self._take()
        return {"video_stream_id": item.param1, "freq": item.param2}

    def video_stop(self) -> dict[str, Any] | None:
        if self._peek() != VIDEO_STOP:
            return None
        return {"video_stream_id": self._take().param1}


_READERS: list[tuple[CommandType, Callable[[MissionReader], dict[str, Any] | None]]] = [
    (CommandType.NAV_TAKEOFF, MissionReader.takeoff),
    (CommandType.CAMERA_PANORAMA, MissionReader.panorama),
    (CommandType.NAV_HOTPOINT, MissionReader.hotpoint),
    (CommandType.NAV_HOME, MissionReader.home),
    (CommandType.NAV_WAYPOINT, MissionReader.waypoint),
    (CommandType.NAV_LAND, MissionReader.land),
    (CommandType.CAMERA_IMAGE, MissionReader.image),
    (CommandType.VIDEO_START_CAPTURE, MissionReader.video_start),
    (CommandType.VIDEO_STOP_CAPTURE, MissionReader.video_stop),
]


def place(item: Message) -> Place:
    """Where an item is."""
    return Place(item.x / 1e7, item.y / 1e7, item.z)


def metres_between(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Distance over ground."""
    return math.hypot(*LocalGround(*one).north_east_m(*other)[:2])


def _mode_of(yaws: Sequence[float]) -> PanoramaMode:
    steps = {round((after - before) % 360.0) for before, after in pairwise(yaws)}
    if steps != {45}:
        raise UnreadableError(f"a panorama in steps of {steps}")
    return PanoramaMode.FULL_CIRCLE if len(yaws) == 8 else PanoramaMode.HALF_CIRCLE


LIVE_KINDS = {
    mavlink.MAV_CMD_DO_ORBIT: CommandType.NAV_HOTPOINT,
    mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE: CommandType.NAV_TRACK_SUBJECT,
    mavlink.MAV_CMD_PANORAMA_CREATE: CommandType.CAMERA_PANORAMA,
    mavlink.MAV_CMD_VIDEO_START_CAPTURE: CommandType.VIDEO_START_CAPTURE,
    mavlink.MAV_CMD_VIDEO_STOP_CAPTURE: CommandType.VIDEO_STOP_CAPTURE,
    mavlink.MAV_CMD_IMAGE_START_CAPTURE: CommandType.CAMERA_IMAGE,
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: CommandType.CAMERA_IMAGE,
    mavlink.MAV_CMD_DO_FOLLOW: CommandType.NAV_FOLLOW_TARGET,
    mavlink.MAV_CMD_DO_SET_MODE: CommandType.NAV_FOLLOW_TARGET,
    mavlink.MAV_CMD_DO_REPOSITION: CommandType.NAV_FOLLOW_TARGET,
}
"""What the first order of a live command means."""
