"""AFarCloud commands to mission items, the inverse of `to_commands`. Pure.

The mission's speed comes first. A parameter without a MAVLink parameter is kept in a
member of the item (`mission_item.EXTRA`), so that an export that is imported again loses nothing.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

from afarcloud.commands import (
    CameraImage,
    CameraPanorama,
    NavFollowTarget,
    NavHome,
    NavHotpoint,
    NavLand,
    NavTakeoff,
    NavTrackSubject,
    NavWaypoint,
    VideoStartCapture,
    VideoStopCapture,
)
from afarcloud.enumerations import CommandType, PanoramaMode
from afarcloud.plan import Mission
from afarcloud.route import spot_of
from edge_server.exchange import orbits
from edge_server.exchange.mission_item import Cmd, Frame, Home, Item, Parameters, Place

_HEADING_IN_EARTH_FRAME: Final = 16.0 + 64.0
_YAW_IN_VEHICLE_FRAME: Final = 32.0
_FULL_CIRCLE_DEG: Final = 360.0


class _Raw(NamedTuple):
    """An item before it has its number."""

    command: Cmd
    parameters: Parameters
    has_place: bool = False
    extra: Mapping[str, Any] = {}


class _Situation(NamedTuple):
    """What the meaning of a command may depend on."""

    home: Home
    relative_altitude_m: float  # At which the mission flies when the command begins
    is_last: bool


def home_of(mission: Mission) -> Home:
    """Return where a mission starts: at its first place; the height of home is unknown."""
    places = (spot_of(command) for command in mission.command_array)
    first = next((place for place in places if place is not None), None)
    if first is None:
        return Home(0.0, 0.0, 0.0)
    return Home(first.latitude_deg, first.longitude_deg, 0.0)


def items_of(mission: Mission, home: Home) -> list[Item]:
    """Translate a mission under the `field` profile, hold times in seconds."""
    return [
        Item(
            path=f"mission.items.{index}",
            number=index + 1,
            command=raw.command,
            frame=Frame.GLOBAL_RELATIVE_ALT if raw.has_place else Frame.MISSION,
            parameters=raw.parameters,
            extra=raw.extra,
        )
        for index, raw in enumerate(_raw_items(mission, home))
    ]


def _raw_items(mission: Mission, home: Home) -> Iterator[_Raw]:
    yield _plain(Cmd.DO_CHANGE_SPEED, 1.0, mission.maximum_speed, -1.0)
    altitude_m = 0.0
    last = mission.command_array[-1]
    for command in mission.command_array:
        situation = _Situation(home, altitude_m, command is last)
        yield from _WRITERS[command.command_type_id](command, situation)
        place = spot_of(command)
        if place is not None and command.command_type_id != CommandType.NAV_LAND:
            altitude_m = place.relative_altitude_m


def _plain(command: Cmd, *parameters: float | None, **extra: Any) -> _Raw:
    """An item without a place; what is not given is 0."""
    filled = (*parameters, *[0.0] * (7 - len(parameters)))
    return _Raw(command, filled, extra=extra)


def _placed(command: Cmd, first: Parameters, place: Place, **extra: Any) -> _Raw:
    """An item with a place; `first` are its first four parameters."""
    return _Raw(command, (*first, *place), has_place=True, extra=extra)


def _takeoff(command: NavTakeoff, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    place = Place(p.latitude, p.longitude, p.altitude)
    yield _placed(Cmd.NAV_TAKEOFF, (p.minimum_pitch, 0.0, 0.0, p.yaw_angle), place)


def _land(command: NavLand, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    first = (p.minimum_target_altitude, float(p.precision_land_mode), 0.0, p.desired_yaw_angle)
    yield _placed(Cmd.NAV_LAND, first, Place(p.latitude, p.longitude, p.landing_altitude))


def _waypoint(command: NavWaypoint, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    first = (p.hold_time, p.acceptance_radius, p.trajectory_control, p.desired_yaw_angle)
    yield _placed(Cmd.NAV_WAYPOINT, first, Place(p.latitude, p.longitude, p.altitude))


def _bare(place: Place) -> _Raw:
    """A waypoint with no more than its place: it belongs to the command behind it."""
    return _placed(Cmd.NAV_WAYPOINT, (0.0, 0.0, 0.0, None), place)


def _picture(command: CameraImage, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    flags = _YAW_IN_VEHICLE_FRAME if p.yaw_angle is None else _HEADING_IN_EARTH_FRAME
    angles = (p.pitch_angle, p.yaw_angle, None, None)
    yield _plain(Cmd.DO_GIMBAL_MANAGER_PITCHYAW, *angles, flags)
    number = float(command.command_id + 1) if p.photo_count == 1 else 0.0
    yield _plain(Cmd.IMAGE_START_CAPTURE, 0.0, float(p.time_interval), float(p.photo_count), number)


def _video_start(command: VideoStartCapture, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    yield _plain(Cmd.VIDEO_START_CAPTURE, float(p.video_stream_id), p.freq)


def _video_stop(command: VideoStopCapture, _: _Situation) -> Iterator[_Raw]:
    yield _plain(Cmd.VIDEO_STOP_CAPTURE, float(command.parameters.video_stream_id))


def _hotpoint(command: NavHotpoint, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    centre = Place(p.latitude, p.longitude, p.orbit_altitude)
    if (begin := orbits.beginning(centre, p.radius, p.start_point)) is not None:
        yield _bare(begin)
    radius = p.radius if p.is_clockwise else -p.radius
    speed = math.radians(p.angular_velocity) * p.radius
    behaviour = float(orbits.YAW_BEHAVIOUR[p.orbit_type])
    yield _placed(Cmd.DO_ORBIT, (radius, speed, behaviour, math.tau), centre)


def _follow(command: NavFollowTarget, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    yield _bare(Place(p.latitude, p.longitude, p.altitude))
    yield _plain(Cmd.DO_FOLLOW, heading=int(p.heading))


def _track(command: NavTrackSubject, _: _Situation) -> Iterator[_Raw]:
    p = command.parameters
    (left, top), (right, bottom) = p.corners
    corners = (left, top, right, bottom)
    yield _plain(Cmd.CAMERA_TRACK_RECTANGLE, *corners, track_mode=int(p.track_mode))


def _panorama(command: CameraPanorama, _: _Situation) -> Iterator[_Raw]:
    is_full = command.parameters.panorama_mode == PanoramaMode.FULL_CIRCLE
    across = _FULL_CIRCLE_DEG if is_full else _FULL_CIRCLE_DEG / 2.0
    yield _plain(Cmd.PANORAMA_CREATE, across, 0.0, None, None)


def _home(command: NavHome, situation: _Situation) -> Iterator[_Raw]:
    """Return and land, or hover at home: for good at the mission's end, else in passing."""
    if command.parameters.landing:
        yield _plain(Cmd.NAV_RETURN_TO_LAUNCH)
        return
    home = situation.home
    place = Place(home.latitude_deg, home.longitude_deg, situation.relative_altitude_m)
    kind = Cmd.NAV_LOITER_UNLIM if situation.is_last else Cmd.NAV_LOITER_TIME
    yield _placed(kind, (0.0, 0.0, 0.0, None), place)


_Writer: TypeAlias = Callable[[Any, _Situation], Iterator[_Raw]]
_WRITERS: Final[Mapping[CommandType, _Writer]] = {
    CommandType.NAV_TAKEOFF: _takeoff,
    CommandType.NAV_LAND: _land,
    CommandType.NAV_WAYPOINT: _waypoint,
    CommandType.CAMERA_IMAGE: _picture,
    CommandType.VIDEO_START_CAPTURE: _video_start,
    CommandType.VIDEO_STOP_CAPTURE: _video_stop,
    CommandType.NAV_HOTPOINT: _hotpoint,
    CommandType.NAV_FOLLOW_TARGET: _follow,
    CommandType.NAV_TRACK_SUBJECT: _track,
    CommandType.CAMERA_PANORAMA: _panorama,
    CommandType.NAV_HOME: _home,
}
