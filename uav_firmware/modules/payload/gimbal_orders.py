"""Handlers of gimbal commands and of streamed gimbal orders; the table is at the end."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.lib.payload_rules import MOUNT_NEUTRAL, MOUNT_PLACE, unset
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.payload.camera.gimbal import (
    NEUTRAL,
    NO_CONTROLLER,
    PITCH_MAX,
    PITCH_MIN,
    Aim,
    Angles,
    Gimbal,
    Place,
    Rates,
)
from uav_firmware.modules.payload.params import PayloadParams
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import (
    ACCEPTED,
    Outcome,
    Situation,
    denied,
    temporarily_rejected,
)
from uav_firmware.msg.guidance import RegionOfInterest
from uav_firmware.msg.payload import Controller, GimbalFlags, GimbalOrder, PayloadCommand
from uav_firmware.msg.status import VehicleCommand

Handler = Callable[[VehicleCommand, Parts, Situation], Outcome]

_PANORAMA: Final = temporarily_rejected("a panorama is being taken")
_RELATIVE_FRAME: Final = 3


def aim_of(
    pitch: float, yaw: float, rate_pitch: float, rate_yaw: float, flags: int, gimbal: Gimbal
) -> Aim:
    """Translate angles and rates [rad, rad/s] with GIMBAL_MANAGER_FLAGS to an aim.

    With an angle, a rate limits the turn to it; without one, the gimbal keeps turning.
    """
    if flags & GimbalFlags.NEUTRAL:
        return NEUTRAL
    locked = bool(flags & GimbalFlags.YAW_LOCK)
    if math.isnan(pitch) and math.isnan(yaw):
        return Rates(rate_pitch, rate_yaw, locked)
    in_earth = locked
    if flags & GimbalFlags.YAW_IN_EARTH_FRAME:
        in_earth = True
    elif flags & GimbalFlags.YAW_IN_VEHICLE_FRAME:
        in_earth = False
    if in_earth and not locked:
        yaw -= gimbal.heading
    elif locked and not in_earth:
        yaw += gimbal.heading
    return Angles(
        pitch,
        yaw if math.isnan(yaw) else wrap_pi(yaw),
        locked,
        math.inf if unset(rate_pitch) else abs(rate_pitch),
        math.inf if unset(rate_yaw) else abs(rate_yaw),
    )


def take_stream(order: GimbalOrder, parts: Parts) -> bool:
    """Execute a streamed order; False when it is invalid or its sender is not in control.

    Pitch beyond the range is limited, because a stream has no answer.
    """
    if not parts.control.may_point(order.source) or parts.panorama is not None:
        return False
    if any(map(math.isinf, (order.pitch, order.yaw, order.pitch_rate, order.yaw_rate))):
        return False
    if order.normalised:
        order = _scaled(order, parts.params)
    pitch = min(max(order.pitch, PITCH_MIN), PITCH_MAX)
    pitch = order.pitch if math.isnan(order.pitch) else pitch
    parts.point(
        aim_of(pitch, order.yaw, order.pitch_rate, order.yaw_rate, order.flags, parts.gimbal)
    )
    return True


def _scaled(order: GimbalOrder, params: PayloadParams) -> GimbalOrder:
    """Manual order in radians: full deflection is the end of the range, or the manual rate."""
    return order._replace(
        pitch=order.pitch * (PITCH_MAX if order.pitch > 0.0 else -PITCH_MIN),
        yaw=order.yaw * math.pi,
        pitch_rate=order.pitch_rate * math.radians(params.manual_rate_pitch_deg),
        yaw_rate=order.yaw_rate * math.radians(params.manual_rate_yaw_deg),
    )


def take_region(region: RegionOfInterest, parts: Parts, situation: Situation) -> None:
    """Look at the region of interest, or level and forward when it is cleared."""
    if parts.panorama is not None:
        return
    if math.isnan(region.latitude_deg):
        if isinstance(parts.gimbal.aim, Place) and parts.tracker.target is None:
            parts.gimbal.follow(NEUTRAL)
            parts.neutral = True
        return
    place = situation.to_ned(region.latitude_deg, region.longitude_deg, region.altitude_amsl_m)
    if place is not None:
        parts.point(Place(place))


def _sender(command: VehicleCommand, situation: Situation) -> Controller:
    if command.token == 0:
        return situation.own
    return Controller(command.source_system, command.source_component)


def _configure(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """DO_GIMBAL_MANAGER_CONFIGURE."""
    parts.control = parts.control.configured(command[2:6], _sender(command, situation))
    return ACCEPTED


def _pitch_yaw(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """DO_GIMBAL_MANAGER_PITCHYAW; the mission takes control with it."""
    sender = _sender(command, situation)
    if sender == situation.own:
        parts.control = parts.control.with_primary(sender)
    elif not parts.control.may_point(sender):
        return denied("the sender is not in control of the gimbal")
    if parts.panorama is not None:
        return _PANORAMA
    flags = 0 if math.isnan(command.param5) else int(command.param5)
    pitch, yaw, rate_pitch, rate_yaw = map(math.radians, command[2:6])
    parts.point(aim_of(pitch, yaw, rate_pitch, rate_yaw, flags, parts.gimbal))
    return ACCEPTED


def _mount_control(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    """DO_MOUNT_CONTROL, which has no concept of control: it takes control if that is free."""
    sender = _sender(command, situation)
    if sender == situation.own or parts.control.primary == NO_CONTROLLER:
        parts.control = parts.control.with_primary(sender)
    elif not parts.control.may_point(sender):
        return denied("another controller is in control of the gimbal")
    if parts.panorama is not None:
        return _PANORAMA
    if command.param7 == MOUNT_PLACE:
        return _look_at(command, parts, situation)
    if command.param7 == MOUNT_NEUTRAL:
        parts.point(NEUTRAL)
        return ACCEPTED
    pitch, yaw = math.radians(command.param1), math.radians(command.param3)
    parts.point(aim_of(pitch, yaw, math.nan, math.nan, 0, parts.gimbal))
    return ACCEPTED


def _look_at(command: VehicleCommand, parts: Parts, situation: Situation) -> Outcome:
    altitude = command.param4
    if command.frame == _RELATIVE_FRAME:
        altitude += math.nan if situation.home is None else situation.home.altitude_amsl_m
    place = situation.to_ned(command.param5, command.param6, altitude)
    if place is None:
        return temporarily_rejected("position unknown")
    parts.point(Place(place))
    return ACCEPTED


def _mount_configure(command: VehicleCommand, parts: Parts, _situation: Situation) -> Outcome:
    """DO_MOUNT_CONFIGURE: only neutral has an effect, as all axes are always stabilised."""
    if command.param1 == MOUNT_NEUTRAL and parts.panorama is None:
        parts.point(NEUTRAL)
    return ACCEPTED


HANDLERS: Final[Mapping[int, Handler]] = {
    PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE: _configure,
    PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW: _pitch_yaw,
    PayloadCommand.DO_MOUNT_CONFIGURE: _mount_configure,
    PayloadCommand.DO_MOUNT_CONTROL: _mount_control,
}
