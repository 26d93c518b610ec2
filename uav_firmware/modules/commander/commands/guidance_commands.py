"""Decisions on orbit, follow, region of interest and yaw commands."""

import math
from typing import Final

from uav_firmware.lib.mission_rules import HIGHEST_M, ROI_LOCATION
from uav_firmware.lib.payload_rules import GIMBAL_DEVICE, unset
from uav_firmware.modules.commander.commands.command_parameters import (
    BadParameterError,
    Place,
    choice,
    place,
    refuse_set,
    refuse_too_low,
)
from uav_firmware.modules.commander.commands.decision import (
    Decision,
    RequestNavigator,
    accepted,
    temporarily_rejected,
)
from uav_firmware.modules.commander.commands.flight_commands import (
    Situation,
    change_mode,
    change_mode_for,
)
from uav_firmware.msg.guidance import (
    FollowHeight,
    FollowOrder,
    HeadingRequest,
    OrbitHeading,
    OrbitTarget,
    RegionOfInterest,
)
from uav_firmware.msg.status import NavigationState, VehicleCommand

ORBIT_RADIUS_MIN_M: Final = 1.0
ORBIT_SPEED_MAX_M_S: Final = 10.0
_FULL_TURN_DEG: Final = 360.0
_NOWHERE: Final = Place(math.nan, math.nan, math.nan)
_TURNING: Final = frozenset(
    {
        NavigationState.AUTO_LOITER,
        NavigationState.AUTO_MISSION,
        NavigationState.AUTO_TAKEOFF,
        NavigationState.AUTO_RTL,
        NavigationState.AUTO_LAND,
    }
)


def orbit(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_ORBIT: to the nearest point of the circle, then round it; 0 or NaN radians without end."""
    radius, speed, angle = command.param1, command.param2, command.param4
    largest = situation.params.orbit_radius_max
    if not (math.isnan(radius) or ORBIT_RADIUS_MIN_M <= abs(radius) <= largest):
        limits = f"{ORBIT_RADIUS_MIN_M:g} to {largest:g} m"
        raise BadParameterError(f"parameter 1: a radius of {radius:g} m is not within {limits}")
    if not (math.isnan(speed) or 0.0 < speed <= ORBIT_SPEED_MAX_M_S):
        limits = f"above 0, up to {ORBIT_SPEED_MAX_M_S:g} m/s"
        raise BadParameterError(f"parameter 2: a speed of {speed:g} m/s is not {limits}")
    if angle < 0.0:
        raise BadParameterError(f"parameter 4: {angle:g} rad; use a negative radius instead")
    spot = place(command, situation.view, zero_is_unset=False)
    refuse_too_low(spot.altitude_amsl_m, situation.view)
    target = OrbitTarget(
        situation.view.now_us,
        NavigationState.ORBIT,
        *spot,
        radius_m=radius,
        speed_m_s=speed,
        heading=_orbit_heading(command.param3),
        angle=math.inf if unset(angle) else angle,
    )
    return change_mode_for(target, situation)


def _orbit_heading(value: float) -> OrbitHeading:
    if math.isnan(value):
        return OrbitHeading.TOWARDS_CENTRE
    if value not in {float(heading) for heading in OrbitHeading}:
        raise BadParameterError(f"parameter 3 is {value:g}, no yaw behaviour")
    return OrbitHeading(int(value))


def follow(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_FOLLOW: the target that a system reports; system 0 ends it with a hold."""
    refuse_set(command, 2, 3, 6, 7)
    system_id = command.param1
    if not (system_id.is_integer() and 0.0 <= system_id <= 255.0):
        raise BadParameterError(f"parameter 1 is {system_id:g}, no system")
    if system_id == 0.0:
        if situation.mode is not NavigationState.AUTO_FOLLOW_TARGET:
            return accepted()
        return change_mode(NavigationState.AUTO_LOITER, situation)
    mode = FollowHeight.PARAMETERS
    if not math.isnan(command.param4):
        mode = FollowHeight(int(choice(command, 4, 0.0, 1.0, 2.0)))
    height = command.param5
    if mode is FollowHeight.FIXED and not 0.0 < height <= HIGHEST_M:
        raise BadParameterError(f"parameter 5: a height of {height:g} m above home")
    if mode is not FollowHeight.FIXED:
        refuse_set(command, 5)
    order = FollowOrder(
        situation.view.now_us,
        NavigationState.AUTO_FOLLOW_TARGET,
        int(system_id),
        mode,
        height,
    )
    return change_mode_for(order, situation)


def set_roi_location(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_SET_ROI_LOCATION: point the nose at a place."""
    _refuse_other_gimbals(command)
    refuse_set(command, 2, 3, 4)
    return _set_place(command, situation)


def set_roi_none(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_SET_ROI_NONE: end the region of interest."""
    _refuse_other_gimbals(command)
    refuse_set(command, 2, 3, 4, 5, 6, 7)
    return _request_region(situation, _NOWHERE)


def _refuse_other_gimbals(command: VehicleCommand) -> None:
    """Refuse a parameter 1 that names another gimbal than the one on board."""
    if not unset(command.param1):
        choice(command, 1, float(GIMBAL_DEVICE))


def set_roi(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_SET_ROI, the deprecated form: parameter 1 is 3 for a place and 0 for none."""
    mode = 0.0 if math.isnan(command.param1) else choice(command, 1, 0.0, ROI_LOCATION)
    refuse_set(command, 2, 3, 4)
    if mode == ROI_LOCATION:
        return _set_place(command, situation)
    refuse_set(command, 5, 6, 7)
    return _request_region(situation, _NOWHERE)


def _set_place(command: VehicleCommand, situation: Situation) -> Decision:
    spot = place(command, situation.view, zero_is_unset=False)
    if math.isnan(spot.latitude_deg):
        raise BadParameterError("parameters 5 and 6: no place")
    return _request_region(situation, spot)


def _request_region(situation: Situation, spot: Place) -> Decision:
    """Point the gimbal there, and the nose while the vehicle is armed."""
    return accepted(RequestNavigator(RegionOfInterest(situation.view.now_us, *spot)))


def condition_yaw(command: VehicleCommand, situation: Situation) -> Decision:
    """CONDITION_YAW: to a heading, or through an angle, at a rate and in a direction."""
    refuse_set(command, 5, 6, 7)
    angle, rate = command.param1, command.param2
    direction = 0.0 if math.isnan(command.param3) else choice(command, 3, -1.0, 0.0, 1.0)
    relative = not math.isnan(command.param4) and choice(command, 4, 0.0, 1.0) == 1.0
    if not abs(angle) <= _FULL_TURN_DEG:
        raise BadParameterError(f"parameter 1 is {angle:g}, no angle")
    if rate < 0.0:
        raise BadParameterError("parameter 2 is negative")
    if not situation.armed or situation.view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    if situation.mode not in _TURNING:
        return temporarily_rejected(f"mode {situation.mode.name} has a heading of its own")
    now_us = situation.view.now_us
    request = HeadingRequest(now_us, angle, rate, int(direction), relative)
    return accepted(RequestNavigator(request))
