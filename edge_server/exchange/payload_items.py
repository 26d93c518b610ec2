"""Items of camera, gimbal and tracking: one function each, joined by the table of `to_commands`."""

import math
from typing import Final

from afarcloud.enumerations import CommandType
from edge_server.exchange.mission_item import Item, Place
from edge_server.exchange.translation import Refusal, Translation, unset, whole

CLOSEST_PICTURES_M: Final = 0.5
STRAIGHT_DOWN_DEG: Final = -90.0
_IN_EARTH_FRAME: Final = 16 | 64
"""GIMBAL_MANAGER_FLAGS_YAW_LOCK and _YAW_IN_EARTH_FRAME: the yaw is a heading."""
_MAVLINK_TARGETING: Final = 2
"""MAV_MOUNT_MODE: to the angles that are given."""


def gimbal(state: Translation, item: Item) -> None:
    """DO_GIMBAL_MANAGER_PITCHYAW: where the pictures behind it look."""
    pitch, yaw, *rates = item.parameters[:4]
    flags = int(item.parameters[4] or 0.0)
    if pitch is None or not unset(*rates):
        raise Refusal("turns the camera at a rate, or leaves its pitch open")
    is_heading = bool(flags & _IN_EARTH_FRAME)
    if yaw is not None and not is_heading and yaw != 0.0:
        raise Refusal("has a camera yaw from the vehicle's nose; a command has a heading")
    _point(state, item, pitch, yaw if is_heading else None)


def mount(state: Translation, item: Item) -> None:
    """DO_MOUNT_CONTROL: pitch of the pictures behind it."""
    pitch, roll, yaw = item.parameters[:3]
    if item.parameters[6] not in {None, _MAVLINK_TARGETING} or not unset(roll, yaw):
        raise Refusal("does more than to set the pitch of the camera")
    _point(state, item, pitch or 0.0, None)


def _point(state: Translation, item: Item, pitch: float, heading: float | None) -> None:
    if state.gimbal is not None and not state.gimbal_is_used:
        raise Refusal(f"follows item {state.gimbal[0].number}, and no picture is in between")
    state.gimbal, state.gimbal_is_used = (item, pitch, heading), False


def _picture(state: Translation, item: Item, count: int = 1, interval: int = 0) -> None:
    pitch, heading = STRAIGHT_DOWN_DEG, None
    if state.gimbal is not None:
        _, pitch, heading = state.gimbal
    elif not any(one["command_type_id"] == CommandType.CAMERA_IMAGE for one in state.commands):
        state.warn(item, "no item says where the camera looks: it looks straight down")
    state.add(
        item,
        CommandType.CAMERA_IMAGE,
        yaw_angle=heading,
        pitch_angle=pitch,
        photo_count=count,
        time_interval=interval,
    )
    state.gimbal_is_used = True


def pictures(state: Translation, item: Item) -> None:
    """IMAGE_START_CAPTURE: camera, interval, count."""
    camera, interval, count, _ = item.parameters[:4]
    if not unset(camera):
        raise Refusal("names a camera; a command has no camera id")
    if not count:
        raise Refusal("takes pictures without end; a command takes 1 to 255")
    _picture(state, item, whole(count, "its pictures", 1), whole(interval, "its interval", 0))


def pictures_by_distance(state: Translation, item: Item) -> None:
    """A picture every so many metres: no command does that, so each becomes a stop."""
    spacing = item.parameters[0]
    if spacing is None or spacing <= 0.0:
        state.picture_spacing_m = None
        return
    if spacing < CLOSEST_PICTURES_M:
        raise Refusal(f"takes pictures closer than {CLOSEST_PICTURES_M} m")
    if state.place is None:
        raise Refusal("takes pictures by distance, but no item before it has a position")
    state.warn(item, f"the vehicle stops for a picture every {spacing:g} m")
    state.picture_spacing_m, state.since_picture_m = spacing, 0.0
    if item.parameters[2]:
        _picture(state, item)


def pictures_on_the_way(state: Translation, item: Item, place: Place) -> None:
    """Stop for the pictures that are due before a place is reached."""
    start, spacing = state.place, state.picture_spacing_m
    if spacing is None or start is None:
        return
    north, east = start.way_to(place)
    length = math.hypot(north, east)
    climb = place.relative_altitude_m - start.relative_altitude_m
    along = spacing - state.since_picture_m
    while along < length:
        share = along / length
        stop = start.moved(north * share, east * share)
        stop = stop._replace(
            latitude_deg=round(stop.latitude_deg, 8),
            longitude_deg=round(stop.longitude_deg, 8),
            relative_altitude_m=round(start.relative_altitude_m + climb * share, 3),
        )
        state.add(item, CommandType.NAV_WAYPOINT, **stop.as_parameters())
        _picture(state, item)
        along += spacing
    state.since_picture_m = length - (along - spacing)


def video_start(state: Translation, item: Item) -> None:
    """VIDEO_START_CAPTURE: stream, rate of status messages."""
    stream, rate, camera = item.parameters[:3]
    if not unset(camera):
        raise Refusal("names a camera; a command has no camera id")
    number = whole(stream, "its stream", 0)
    state.add(item, CommandType.VIDEO_START_CAPTURE, video_stream_id=number, freq=rate or 0.0)


def video_stop(state: Translation, item: Item) -> None:
    """VIDEO_STOP_CAPTURE: stream."""
    stream, camera = item.parameters[:2]
    if not unset(camera):
        raise Refusal("names a camera; a command has no camera id")
    number = whole(stream, "its stream", 0)
    state.add(item, CommandType.VIDEO_STOP_CAPTURE, video_stream_id=number)


def track(state: Translation, item: Item) -> None:
    """CAMERA_TRACK_RECTANGLE: its corners."""
    left, top, right, bottom = item.parameters[:4]
    mode = item.extra.get("track_mode", 0)
    corners = [[left, top], [right, bottom]]
    state.add(item, CommandType.NAV_TRACK_SUBJECT, corners=corners, track_mode=mode)


def panorama(state: Translation, item: Item) -> None:
    """PANORAMA_CREATE: a full or half circle."""
    across, up, *rates = item.parameters[:4]
    if across not in {360.0, 180.0} or not unset(up, *rates):
        raise Refusal("is no full or half circle at the camera's own speed")
    state.add(item, CommandType.CAMERA_PANORAMA, panorama_mode=int(across == 180.0))
