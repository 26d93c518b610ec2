"""Decisions on the commands that move the vehicle."""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.mission_rules import HIGHEST_M, LOWEST_TAKEOFF_M
from uav_firmware.lib.payload_rules import unset
from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.commands.command_parameters import (
    NAN,
    BadParameterError,
    Place,
    choice,
    place,
    refuse_negative,
    refuse_set,
    refuse_too_low,
)
from uav_firmware.modules.commander.commands.decision import (
    Decision,
    HoldFor,
    RequestNavigator,
    SetMode,
    accepted,
    denied,
    temporarily_rejected,
)
from uav_firmware.modules.commander.failsafe_actions import PILOTED
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.mission import (
    MissionCurrentRequest,
    MissionState,
    ModeTarget,
    NavigatorTarget,
    SpeedRequest,
)
from uav_firmware.msg.status import NavigationState, VehicleCommand

LONGEST_HOLD_S: Final = 86_400.0  # [s]
_HERE: Final = Place(NAN, NAN, NAN)


class Situation(NamedTuple):
    """State on which a decision depends."""

    view: VehicleView
    armed: bool
    mode: NavigationState
    params: CommanderParams


def change_mode(state: NavigationState, situation: Situation) -> Decision:
    """Change to a mode if its requirements are met.

    A complete mission begins again, and a hold that flies to a point stops. Before arming every
    mode may be chosen, as on PX4; the arming is refused while a requirement is missing. An armed
    vehicle on the ground may land: it ends a take-off that has not lifted off, and disarms. In
    flight without a fix the vehicle lands: then only a commanded landing or a pilot's mode
    changes the mode.
    """
    view = situation.view
    reason = _refusal_in_flight(state, situation) if situation.armed else None
    if reason is not None:
        return temporarily_rejected(reason)
    leaves_ground = state in mode_requirements.AIRBORNE_ONLY - {NavigationState.AUTO_LAND}
    if leaves_ground and situation.armed and view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    complete = view.progress is not None and view.progress.state == MissionState.COMPLETE
    if state is NavigationState.AUTO_MISSION and complete:
        again = MissionCurrentRequest(view.now_us, 0, reset=True)
        return accepted(RequestNavigator(again), SetMode(state))
    if state is NavigationState.AUTO_LOITER and situation.mode is state:
        return accepted(RequestNavigator(hold_here(view.now_us)), SetMode(state))
    return accepted(SetMode(state))


def _refusal_in_flight(state: NavigationState, situation: Situation) -> str | None:
    """Why an armed vehicle cannot change to a mode by command; None when it can.

    Only the failsafe holds by dead reckoning, while it waits for the fix: a commanded hold would
    delay the landing without limit.
    """
    view = situation.view
    reason = mode_requirements.missing(state, view)
    if reason is not None or state in PILOTED or state is NavigationState.AUTO_LAND:
        return reason
    holds = state is NavigationState.AUTO_LOITER
    if holds or situation.mode is NavigationState.AUTO_LAND:
        return mode_requirements.missing_for_place(view)
    return None


def hold_here(now_us: int) -> NavigatorTarget:
    """Target that stops the vehicle at its present position."""
    return NavigatorTarget(now_us, NavigationState.AUTO_LOITER, *_HERE, yaw=NAN, speed_m_s=NAN)


def _change_mode_to(
    state: NavigationState,
    situation: Situation,
    spot: Place,
    *,
    yaw: float,
    speed: float = NAN,
    note: str = "",
) -> Decision:
    target = NavigatorTarget(situation.view.now_us, state, *spot, yaw, speed)
    return change_mode_for(target, situation, note=note)


def change_mode_for(target: ModeTarget, situation: Situation, *, note: str = "") -> Decision:
    """Change to the mode of a target, if the target can be flown to.

    Without a measured position no target with a place is accepted, for a hold or a landing
    either: dead reckoning does not find the place that the operator means.
    """
    state = target.navigation_state
    if state in mode_requirements.AIRBORNE_ONLY and situation.view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    decision = change_mode(state, situation)
    if not decision.effects:
        return decision
    if situation.armed and _has_place(target):
        reason = mode_requirements.missing_for_place(situation.view)
        if reason is not None:
            return temporarily_rejected(reason)
    return accepted(RequestNavigator(target), SetMode(state), note=note, target=target)


def _has_place(target: ModeTarget) -> bool:
    """Whether a target names a place; an altitude or a heading alone is reached from here."""
    return isinstance(target, NavigatorTarget) and not math.isnan(target.latitude_deg)


def take_off(command: VehicleCommand, situation: Situation) -> Decision:
    """NAV_TAKEOFF: accepted before arming; the climb then begins at the arming.

    An altitude below the lowest of a take-off becomes MIS_TAKEOFF_ALT.
    """
    refuse_set(command, 2, 3)
    spot, note = place(command, situation.view, zero_is_unset=True), ""
    home = situation.view.home
    if home is not None and not spot.altitude_amsl_m >= home.altitude_amsl_m + LOWEST_TAKEOFF_M:
        spot = spot._replace(altitude_amsl_m=NAN)
        note = "Take-off to MIS_TAKEOFF_ALT above home"
    yaw = math.radians(command.param4)
    return _change_mode_to(NavigationState.AUTO_TAKEOFF, situation, spot, yaw=yaw, note=note)


def land(command: VehicleCommand, situation: Situation) -> Decision:
    """NAV_LAND: at the place, or here; parameter 7 is the height of the ground there.

    Parameter 1 is the height above it to climb back to when the landing is aborted.
    """
    refuse_negative(command, 1)
    if command.param1 > HIGHEST_M:
        raise BadParameterError(f"parameter 1: more than {HIGHEST_M:.0f} m")
    refuse_set(command, 3)
    if not math.isnan(command.param2):
        choice(command, 2, 0.0, 1.0)
    spot = place(command, situation.view, zero_is_unset=True)
    if math.isnan(spot.latitude_deg) and unset(command.param7):
        spot = spot._replace(altitude_amsl_m=NAN)
    yaw = NAN if unset(command.param4) else math.radians(command.param4)
    abort_height = NAN if unset(command.param1) else command.param1
    if all(map(math.isnan, (*spot, yaw, abort_height))):
        return change_mode(NavigationState.AUTO_LAND, situation)
    target = NavigatorTarget(
        situation.view.now_us, NavigationState.AUTO_LAND, *spot, yaw, NAN, abort_height
    )
    return change_mode_for(target, situation)


def return_home(command: VehicleCommand, situation: Situation) -> Decision:
    """NAV_RETURN_TO_LAUNCH; coordinates, which some ground stations send, are ignored."""
    refuse_set(command, 1, 2, 3, 4)
    return change_mode(NavigationState.AUTO_RTL, situation)


def loiter(command: VehicleCommand, situation: Situation) -> Decision:
    """NAV_LOITER_UNLIM: hold here, or at the place given."""
    refuse_set(command, 1, 2, 3)
    spot = place(command, situation.view, zero_is_unset=True)
    if math.isnan(spot.latitude_deg) and unset(command.param7):
        refuse_set(command, 4)
        return change_mode(NavigationState.AUTO_LOITER, situation)
    if situation.view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    refuse_too_low(spot.altitude_amsl_m, situation.view)
    yaw = math.radians(command.param4)
    return _change_mode_to(NavigationState.AUTO_LOITER, situation, spot, yaw=yaw)


def waypoint(command: VehicleCommand, situation: Situation) -> Decision:
    """NAV_WAYPOINT: fly there and hold; hold time and acceptance radius have no effect."""
    for number in (1, 2):
        refuse_negative(command, number)
    refuse_set(command, 3)
    spot = place(command, situation.view, zero_is_unset=False)
    if math.isnan(spot.latitude_deg):
        return denied("parameters 5 and 6: no place")
    refuse_too_low(spot.altitude_amsl_m, situation.view)
    if situation.view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    yaw = math.radians(command.param4)
    return _change_mode_to(NavigationState.AUTO_LOITER, situation, spot, yaw=yaw)


def loiter_time(command: VehicleCommand, situation: Situation) -> Decision:
    """NAV_LOITER_TIME: hold here or at the place for parameter 1 [s]; a mission then continues."""
    if not 0.0 < command.param1 <= LONGEST_HOLD_S:
        raise BadParameterError(f"parameter 1: a time of {command.param1:g} s")
    refuse_set(command, 2, 3, 4)
    spot = place(command, situation.view, zero_is_unset=True)
    if math.isnan(spot.latitude_deg) and unset(command.param7):
        spot = _HERE
    if situation.view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    refuse_too_low(spot.altitude_amsl_m, situation.view)
    decision = _change_mode_to(NavigationState.AUTO_LOITER, situation, spot, yaw=NAN)
    if not decision.effects:
        return decision
    on_mission = situation.mode is NavigationState.AUTO_MISSION
    then = NavigationState.AUTO_MISSION if on_mission else NavigationState.AUTO_LOITER
    return decision._replace(effects=(*decision.effects, HoldFor(command.param1, then)))


def reposition(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_REPOSITION: fly there and hold; NaN keeps the present value."""
    flags = 0.0 if math.isnan(command.param2) else choice(command, 2, 0.0, 1.0)
    refuse_set(command, 3)
    speed = command.param1
    if speed == 0.0 or (speed < 0.0 and speed != -1.0):
        speed_text = f"parameter 1 is {speed:g}, no speed"
        raise BadParameterError(speed_text)
    spot = place(command, situation.view, zero_is_unset=False)
    refuse_too_low(spot.altitude_amsl_m, situation.view)
    if not situation.armed or situation.view.landed:
        return temporarily_rejected("the vehicle is on the ground")
    if flags == 0.0 and situation.mode is not NavigationState.AUTO_LOITER:
        return temporarily_rejected("not in hold, and parameter 2 does not allow the change")
    return _change_mode_to(
        NavigationState.AUTO_LOITER,
        situation,
        spot,
        yaw=command.param4,
        speed=speed if speed > 0.0 else NAN,
    )


def change_speed(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_CHANGE_SPEED: -1 keeps the speed, -2 returns to the parameters."""
    speed_type = choice(command, 1, 0.0, 1.0, 2.0, 3.0)
    speed, throttle = command.param2, command.param3
    refuse_set(command, 4, 5, 6, 7)
    if not (speed > 0.0 or speed in {-1.0, -2.0}):
        return denied(f"parameter 2 is {speed:g}, no speed")
    if throttle > 0.0:
        return denied("parameter 3: a multirotor has no throttle to set")
    if not situation.armed:
        return temporarily_rejected("the vehicle is disarmed")
    if situation.mode is NavigationState.ORBIT:
        return temporarily_rejected("the speed of an orbit is part of its command")
    if speed == -1.0:
        return accepted()
    requested = NAN if speed == -2.0 else speed
    return accepted(
        RequestNavigator(SpeedRequest(situation.view.now_us, int(speed_type), requested))
    )
