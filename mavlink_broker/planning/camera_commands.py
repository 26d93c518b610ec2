"""Pictures, video and panoramas: as mission items, or live if the vehicle's position is unknown.

A gimbal's or camera's command that the vehicle has refused as an item is replaced by the older
one, as ground stations do.
"""

import math
import zlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, TypeAlias

from afarcloud.commands import CameraImage, CameraPanorama, VideoStartCapture, VideoStopCapture
from afarcloud.enumerations import PanoramaMode
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import ONBOARD_COMPUTER, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.command import CommandLong, long_command
from mavlink_broker.planning.situation import (
    Items,
    Lasted,
    LiveAction,
    Refusal,
    SendCommand,
    Series,
    Situation,
    Step,
    TurnInPlace,
)

CAMERA: Final[int] = mavlink.MAV_COMP_ID_CAMERA
PANORAMA_WITHIN_S: Final = 180.0
PANORAMA_WORKS_S: Final = 20.0
"""Eight pictures take this project's camera some six seconds."""
_STEP_DEG: Final = 45.0
PANORAMA_SHOTS: Final = {PanoramaMode.FULL_CIRCLE: 8, PanoramaMode.HALF_CIRCLE: 5}
"""Pictures of a panorama."""
_SPAN_DEG: Final = {PanoramaMode.FULL_CIRCLE: 360.0, PanoramaMode.HALF_CIRCLE: 180.0}
Aim: TypeAlias = tuple[float, float | None]
"""Pitch and yaw of a camera; no yaw: along the nose."""
_SETTLE_S: Final = 2.0
TURNED_WITHIN_S: Final = 600.0
_VEHICLE_TURNS: Final = "the vehicle turns from picture to picture: the camera takes no panoramas"
_NO_GIMBAL: Final = "the vehicle has no gimbal: pitch_angle and yaw_angle were left out"
_SEQUENCES: Final = 2**23
"""Numbers that a float represents exactly."""
_POINT: Final[int] = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
_CONTROL: Final[int] = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
_LARGEST_TURN_DEG: Final = 180.0
_SLOW_GIMBAL_DEG_S: Final = 45.0
"""Slower than gimbals for cameras turn to an angle: most reach 60 deg/s or more."""
_STEADY_S: Final = 0.5
"""Time in which a gimbal that has turned comes to rest."""
_AS_BEFORE: Final = (-1.0, -1.0)
"""Secondary control of a gimbal."""
_EARTH: Final = float(
    mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME | mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK
)
_VEHICLE: Final = float(mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME)


def image(command: CameraImage, situation: Situation) -> Items | LiveAction:
    """Point the camera, take the pictures, wait until they are taken.

    The yaw counts from north; without one the camera looks along the nose.
    """
    p = command.parameters
    duration_s = max(1.0, (p.photo_count - 1) * p.time_interval + 1.0)
    number = _picture_number(situation, command.command_id)
    shots = (float(p.time_interval), float(p.photo_count))
    aim = p.pitch_angle, p.yaw_angle
    slew_s = 0.0 if aim == situation.aim else situation.family.gimbal_slew_s
    turning_s = 0.0 if situation.family.gimbal_slew_s else _turning_s(situation.aim, aim)
    if situation.after_live:
        return _live_image(situation, aim, shots, number, duration_s + slew_s, turning_s)
    pointing, notes = _pointing(p.pitch_angle, p.yaw_angle, situation)
    wholes = situation.family.truncated_parameters.get(_POINT)
    if wholes and (p.pitch_angle % 1.0 or (p.yaw_angle or 0.0) % 1.0):
        notes = (*notes, f"{situation.family.name} points its gimbal in whole degrees")
    capture, more = _capture(shots, number, situation.refused)
    taking = capture, mission_item.delay(duration_s + (slew_s if pointing else 0.0))
    waiting = (mission_item.delay(turning_s),) if pointing and turning_s else ()
    items = (*pointing, *waiting, *taking)
    return Items(items, len(items) - 1, (*notes, *more))


def video_start(command: VideoStartCapture, situation: Situation) -> Items | LiveAction:
    """Start recording."""
    p = command.parameters
    family = situation.family
    values = (float(p.video_stream_id), p.freq)
    part = _video(mavlink.MAV_CMD_VIDEO_START_CAPTURE, values, situation)
    if p.freq == 0.0 or family.honours_video_frequency:
        return part
    return replace(part, notes=(f"freq: {family.name} tells nothing while it records",))


def video_stop(command: VideoStopCapture, situation: Situation) -> Items | LiveAction:
    """Stop recording."""
    values = (float(command.parameters.video_stream_id), 0.0)
    return _video(mavlink.MAV_CMD_VIDEO_STOP_CAPTURE, values, situation)


def panorama(command: CameraPanorama, situation: Situation) -> Items | LiveAction | Refusal:
    """Have the camera take it if it can, else turn the vehicle from picture to picture."""
    mode = command.parameters.panorama_mode
    if situation.family.takes_panoramas:
        angles = (_SPAN_DEG[mode], math.nan, math.nan, math.nan)
        create = long_command(mavlink.MAV_CMD_PANORAMA_CREATE, *angles, component=CAMERA)
        in_hold = tuple((*hold, create) for hold in situation.family.holding)
        begin = (*in_hold, (create,))  # The vehicle refuses it unless it holds its position
        return LiveAction(
            begin=begin,
            end=Lasted(),
            within_s=PANORAMA_WITHIN_S,
            execution_s=PANORAMA_WORKS_S,
            moves=False,
        )
    if situation.spot is None:
        return _turned_panorama(command, situation)
    middle_deg = situation.heading_deg or 0.0
    first_deg = middle_deg - (90.0 if mode is PanoramaMode.HALF_CIRCLE else 0.0)
    items: list[MissionItem] = []
    for shot in range(PANORAMA_SHOTS[mode]):
        yaw_deg = (first_deg + shot * _STEP_DEG) % 360.0
        number = _picture_number(situation, command.command_id, shot)
        items += _turn(yaw_deg, situation)
        items.append(_capture((0.0, 1.0), number, situation.refused)[0])
    items.append(mission_item.delay(1.0))
    return Items(tuple(items), len(items) - 1, (_VEHICLE_TURNS,))


def _turned_panorama(command: CameraPanorama, situation: Situation) -> LiveAction | Refusal:
    """Turn in place, at the position after a live command or an earlier mission."""
    family, mode = situation.family, command.parameters.panorama_mode
    if not situation.after_live:
        return Refusal("command_type_id", "no command before it brings the vehicle to a place")
    first_deg = -90.0 if mode is PanoramaMode.HALF_CIRCLE else 0.0
    steps: list[Step] = []
    for shot in range(PANORAMA_SHOTS[mode]):
        number = _picture_number(situation, command.command_id, shot)
        take = _to_camera(family, mavlink.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0, number)
        steps += [
            TurnInPlace(first_deg + shot * _STEP_DEG, _SETTLE_S),
            SendCommand(tuple((t,) for t in take)),
        ]
    steps.append(TurnInPlace(0.0))
    return LiveAction(
        begin=family.holding,
        end=Series(tuple(steps)),
        within_s=TURNED_WITHIN_S,
        notes=(_VEHICLE_TURNS,),
    )


def _to_camera(family: Family, command: int, *values: float) -> tuple[CommandLong, CommandLong]:
    """Address the camera, or the autopilot if that is the camera; then the other one."""
    camera = long_command(command, *values, component=CAMERA)
    autopilot = long_command(command, *values)
    return (autopilot, camera) if family.camera_is_autopilot else (camera, autopilot)


def _turn(yaw_deg: float, situation: Situation) -> Sequence[MissionItem]:
    """Turn to a heading at the vehicle's position, and wait until it rests."""
    if situation.spot is None:
        raise ValueError("the position of the turn is not known")
    by_condition = situation.family.yaw_by_condition
    stop = mission_item.waypoint(
        **situation.spot._asdict(), hold_s=_SETTLE_S, yaw_deg=None if by_condition else yaw_deg
    )
    return [mission_item.condition_yaw(yaw_deg), stop] if by_condition else [stop]


def _pointing(
    pitch_deg: float, yaw_deg: float | None, situation: Situation
) -> tuple[tuple[MissionItem, ...], tuple[str, ...]]:
    """Point the gimbal by the newest command that the vehicle has not refused."""
    refused, family = situation.refused, situation.family
    if not refused & {_POINT, _CONTROL}:
        yaw, flags = _direction(yaw_deg, family)
        rate = family.gimbal_rate_deg_s
        point = mission_item.point_gimbal(pitch_deg, yaw, flags, no_rate_deg_s=rate)
        if family.missions_take_gimbal:
            return (point,), ()
        return (mission_item.take_gimbal(), point), ()
    if mavlink.MAV_CMD_DO_MOUNT_CONTROL not in refused:
        return (mission_item.point_mount(pitch_deg, yaw_deg or 0.0),), ()
    return (), (_NO_GIMBAL,)


def _turning_s(before: Aim | None, aim: Aim) -> float:
    """Give the time for which pictures wait for a gimbal, where the camera does not.

    PX4 goes on to the next item when it has sent the command; since 1.16 behind MIS_COMMAND_TOUT,
    which is 0 by default (`mission_block.cpp`, `is_mission_item_reached_or_completed`). ArduPilot
    goes on at once (`AP_Mission.cpp`, `verify_command`).
    """
    if aim == before:
        return 0.0
    turn_deg = _LARGEST_TURN_DEG if before is None else _turn_deg(before, aim)
    return math.ceil(2.0 * turn_deg / _SLOW_GIMBAL_DEG_S) / 2.0 + _STEADY_S


def _turn_deg(before: Aim, aim: Aim) -> float:
    """Give the larger turn of the two axes; from or to the nose a yaw may turn by any angle."""
    (pitch_before_deg, yaw_before_deg), (pitch_deg, yaw_deg) = before, aim
    by_pitch_deg = abs(pitch_deg - pitch_before_deg)
    if yaw_deg is None and yaw_before_deg is None:
        return by_pitch_deg
    if yaw_deg is None or yaw_before_deg is None:
        return _LARGEST_TURN_DEG
    return max(by_pitch_deg, abs(math.remainder(yaw_deg - yaw_before_deg, 360.0)))


def _direction(yaw_deg: float | None, family: Family) -> tuple[float, float]:
    """Give yaw and flags of a gimbal's command; without a yaw it looks along the nose."""
    yaw, flags = (0.0, _VEHICLE) if yaw_deg is None else (yaw_deg, _EARTH)
    return yaw, flags + family.gimbal_flags


def _capture(
    shots: tuple[float, float], number: float, refused: frozenset[int]
) -> tuple[MissionItem, tuple[str, ...]]:
    interval_s, count = shots
    if mavlink.MAV_CMD_IMAGE_START_CAPTURE not in refused:
        single = number if count == 1.0 else 0.0
        return mission_item.take_pictures(interval_s, count, single), ()
    lost = "" if count == 1.0 else f": one picture instead of {count:.0f}"
    return mission_item.trigger_camera(), (f"the vehicle knows only a shutter{lost}",)


def _live_image(
    situation: Situation,
    aim: Aim,
    shots: tuple[float, float],
    number: float,
    duration_s: float,
    turning_s: float,
) -> LiveAction:
    """Point the gimbal, wait while it turns, take the pictures; without a gimbal at once."""
    (pitch_deg, yaw_deg), family = aim, situation.family
    yaw, flags = _direction(yaw_deg, family)
    point = long_command(_POINT, pitch_deg, yaw, math.nan, math.nan, flags)
    broker = float(situation.own_system), float(ONBOARD_COMPUTER)
    control = long_command(_CONTROL, *broker, *_AS_BEFORE)
    single = number if shots[1] == 1.0 else 0.0
    takes = _to_camera(family, mavlink.MAV_CMD_IMAGE_START_CAPTURE, 0.0, *shots, single)
    aimed = replace(takes[0], wait_s=turning_s)
    return LiveAction(
        begin=((control, point, aimed), (point, aimed), *((take,) for take in takes)),
        alternative_notes=("", "", _NO_GIMBAL, _NO_GIMBAL),
        end=Lasted(duration_s),
        within_s=2.0 * turning_s + duration_s + PANORAMA_WITHIN_S,
        moves=False,
        wants_camera=True,
    )


def _video(command: int, values: tuple[float, float], situation: Situation) -> Items | LiveAction:
    stream, frequency_hz = values
    if not situation.after_live and command not in situation.refused:
        item = MissionItem(command=command, parameters=(stream, frequency_hz, 0.0, 0.0))
        return Items((item,), 0)
    alternatives = tuple((order,) for order in _to_camera(situation.family, command, *values))
    return LiveAction(
        begin=alternatives, end=Lasted(), within_s=PANORAMA_WITHIN_S, moves=False, wants_camera=True
    )


def _picture_number(situation: Situation, command_id: int, shot: int = 0) -> float:
    """Give a number that differs from recent ones: a camera ignores a repeated single picture."""
    text = f"{situation.flight}{situation.mission_id}/{command_id}/{shot}"
    return float(1 + zlib.crc32(text.encode()) % _SEQUENCES)
