"""Mission items in degrees and metres, and their encoding.

The encoding is accepted by strict and lenient autopilots: an unset parameter is 0, never NaN,
except the yaw (fourth parameter) of waypoint, land and take-off, where 0 would mean north, and
the rates of a gimbal, where 0 would mean that it does not move.
Positions use frame 6 (altitude above home), everything else uses frame 2.
"""

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.mavlink.dialect import Message, mavlink

Four: TypeAlias = tuple[float, float, float, float]

UNSET_YAW: Final = math.nan
_E7: Final = 1e7
_FRAME_NAMES: Final = {0: 5, 3: 6, 10: 11}
"""In MISSION_ITEM_INT the plain global frames mean the same as the _INT frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionItem:
    """One item; `frame` is a MAV_FRAME, `parameters` are the first four of its command.

    `at_home` marks the home position as it was when the mission was translated.
    """

    command: int
    frame: int = mavlink.MAV_FRAME_MISSION
    parameters: Four = (0.0, 0.0, 0.0, 0.0)
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    altitude_m: float = 0.0
    fifth: int = 0  # Fifth parameter of a command without a position
    at_home: bool = False

    @property
    def is_positional(self) -> bool:
        """Whether it has a position."""
        return bool(self.frame != mavlink.MAV_FRAME_MISSION)


def waypoint(
    *,
    latitude_deg: float,
    longitude_deg: float,
    relative_altitude_m: float,
    hold_s: float = 0.0,
    acceptance_radius_m: float = 0.0,
    yaw_deg: float | None = None,
) -> MissionItem:
    """NAV_WAYPOINT(16); radius 0: the vehicle's default; yaw None: along the track."""
    return MissionItem(
        command=mavlink.MAV_CMD_NAV_WAYPOINT,
        frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        parameters=(hold_s, acceptance_radius_m, 0.0, _yaw(yaw_deg)),
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=relative_altitude_m,
    )


def takeoff(
    *,
    latitude_deg: float,
    longitude_deg: float,
    relative_altitude_m: float,
    minimum_pitch_deg: float = 0.0,
    yaw_deg: float | None = None,
) -> MissionItem:
    """NAV_TAKEOFF(22)."""
    return MissionItem(
        command=mavlink.MAV_CMD_NAV_TAKEOFF,
        frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        parameters=(minimum_pitch_deg, 0.0, 0.0, _yaw(yaw_deg)),
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=relative_altitude_m,
    )


def land(
    *,
    latitude_deg: float,
    longitude_deg: float,
    relative_altitude_m: float,
    abort_altitude_m: float = 0.0,
    precision_mode: int = 0,
    yaw_deg: float | None = None,
) -> MissionItem:
    """NAV_LAND(21): fly to the position, land there."""
    return MissionItem(
        command=mavlink.MAV_CMD_NAV_LAND,
        frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        parameters=(abort_altitude_m, float(precision_mode), 0.0, _yaw(yaw_deg)),
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=relative_altitude_m,
    )


def hold(
    *,
    latitude_deg: float,
    longitude_deg: float,
    relative_altitude_m: float,
    yaw_deg: float = 0.0,
) -> MissionItem:
    """NAV_LOITER_UNLIM(17): hold the position until the next command.

    `yaw_deg` is what the family takes for "unchanged": NaN, or 0 if it refuses NaN.
    """
    return MissionItem(
        command=mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        parameters=(0.0, 0.0, 0.0, yaw_deg),
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=relative_altitude_m,
    )


def return_to_launch() -> MissionItem:
    """NAV_RETURN_TO_LAUNCH(20)."""
    return MissionItem(command=mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)


def change_speed(speed_m_s: float) -> MissionItem:
    """DO_CHANGE_SPEED(178) of the ground speed; the throttle stays as it is (-1)."""
    return MissionItem(
        command=mavlink.MAV_CMD_DO_CHANGE_SPEED, parameters=(1.0, speed_m_s, -1.0, 0.0)
    )


def condition_yaw(yaw_deg: float) -> MissionItem:
    """CONDITION_YAW(115): turn to a heading by the smaller angle, at the vehicle's own rate."""
    return MissionItem(
        command=mavlink.MAV_CMD_CONDITION_YAW, parameters=(yaw_deg % 360.0, 0.0, 0.0, 0.0)
    )


def delay(duration_s: float) -> MissionItem:
    """NAV_DELAY(93): hold for a duration; its clock times are unused (0)."""
    return MissionItem(command=mavlink.MAV_CMD_NAV_DELAY, parameters=(duration_s, 0.0, 0.0, 0.0))


def point_gimbal(
    pitch_deg: float, yaw_deg: float, flags: float, *, no_rate_deg_s: float = math.nan
) -> MissionItem:
    """DO_GIMBAL_MANAGER_PITCHYAW(1000) of every gimbal, at the gimbal's own rate.

    `flags` (GIMBAL_MANAGER_FLAGS) are in the latitude field, as a plain number.
    `no_rate_deg_s` is what the family takes for no rate: NaN, or 0 if it refuses NaN.
    """
    return MissionItem(
        command=mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        parameters=(pitch_deg, yaw_deg, no_rate_deg_s, no_rate_deg_s),
        fifth=round(flags),
    )


def take_gimbal() -> MissionItem:
    """DO_GIMBAL_MANAGER_CONFIGURE(1001): the mission controls the gimbal (-2), and nobody else.

    Who has secondary control is left as it is (-1).
    """
    return MissionItem(
        command=mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, parameters=(-2.0, -2.0, -1.0, -1.0)
    )


def point_mount(pitch_deg: float, yaw_deg: float) -> MissionItem:
    """DO_MOUNT_CONTROL(205) by angles: how older autopilots aim."""
    return MissionItem(
        command=mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        parameters=(pitch_deg, 0.0, yaw_deg, 0.0),
        altitude_m=float(mavlink.MAV_MOUNT_MODE_MAVLINK_TARGETING),
    )


def take_pictures(interval_s: float, count: float, number: float) -> MissionItem:
    """IMAGE_START_CAPTURE(2000) on every camera; `number` marks a single picture."""
    return MissionItem(
        command=mavlink.MAV_CMD_IMAGE_START_CAPTURE, parameters=(0.0, interval_s, count, number)
    )


def trigger_camera() -> MissionItem:
    """DO_DIGICAM_CONTROL(203): one picture of a camera that is only a shutter."""
    return MissionItem(command=mavlink.MAV_CMD_DO_DIGICAM_CONTROL, fifth=1)


def turn(
    *,
    latitude_deg: float,
    longitude_deg: float,
    relative_altitude_m: float,
    radius_m: float,
) -> MissionItem:
    """NAV_LOITER_TURNS(18), one turn; a negative radius goes round counter-clockwise."""
    return MissionItem(
        command=mavlink.MAV_CMD_NAV_LOITER_TURNS,
        frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        parameters=(1.0, 0.0, radius_m, 0.0),
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=relative_altitude_m,
    )


def look_at(*, latitude_deg: float, longitude_deg: float) -> MissionItem:
    """DO_SET_ROI_LOCATION(195): the nose or the camera points to a position, at home's height."""
    return MissionItem(
        command=mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
    )


def look_ahead() -> MissionItem:
    """DO_SET_ROI_NONE(197)."""
    return MissionItem(command=mavlink.MAV_CMD_DO_SET_ROI_NONE)


def home(*, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> MissionItem:
    """Item 0 of families that store home in the mission: a waypoint with altitude AMSL."""
    return MissionItem(
        command=mavlink.MAV_CMD_NAV_WAYPOINT,
        frame=mavlink.MAV_FRAME_GLOBAL,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=altitude_amsl_m,
    )


def to_message(
    item: MissionItem,
    *,
    seq: int,
    first: int | None,
    system: int,
    component: int,
    mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION,
) -> Message:
    """MISSION_ITEM_INT(73); `first` is the index of the first item of the mission."""
    return mavlink.MAVLink_mission_item_int_message(
        system,
        component,
        seq,
        item.frame,
        item.command,
        int(seq == first),
        1,
        *item.parameters,
        round(item.latitude_deg * _E7) if item.is_positional else item.fifth,
        round(item.longitude_deg * _E7),
        item.altitude_m,
        mission_type,
    )


def from_message(message: Message) -> MissionItem:
    """Decode MISSION_ITEM_INT(73), or MISSION_ITEM(39), as a vehicle sends it."""
    frame = _FRAME_NAMES.get(message.frame, message.frame)
    is_place = frame != mavlink.MAV_FRAME_MISSION
    scale = _E7 if message.get_type() == "MISSION_ITEM_INT" else 1.0
    return MissionItem(
        command=message.command,
        frame=frame,
        parameters=(message.param1, message.param2, message.param3, message.param4),
        fifth=0 if is_place else round(message.x),
        latitude_deg=message.x / scale if is_place else 0.0,
        longitude_deg=message.y / scale,
        altitude_m=message.z,
    )


def _yaw(yaw_deg: float | None) -> float:
    return UNSET_YAW if yaw_deg is None else yaw_deg
