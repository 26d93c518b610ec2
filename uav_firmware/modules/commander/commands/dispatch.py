"""Decides on commands by the table `HANDLERS`; a command that is not in it is UNSUPPORTED.

Pure: command, state and mode in; decision out. Wrong parameters are DENIED; valid ones that the
state does not allow are TEMPORARILY_REJECTED.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.lib.payload_rules import unset
from uav_firmware.modules.commander import health_checks, mode_requirements
from uav_firmware.modules.commander.commands import flight_commands, guidance_commands
from uav_firmware.modules.commander.commands.command_parameters import (
    NAN,
    BadParameterError,
    choice,
    place,
    refuse_infinite,
    refuse_set,
)
from uav_firmware.modules.commander.commands.decision import (
    Arm,
    Decision,
    Disarm,
    InjectFailure,
    RequestNavigator,
    SetHome,
    SetMode,
    Terminate,
    accepted,
    denied,
    failed,
    temporarily_rejected,
)
from uav_firmware.modules.commander.commands.flight_commands import Situation
from uav_firmware.modules.commander.mode_requirements import Need
from uav_firmware.msg.mission import FenceSwitch, MissionCurrentRequest, MissionState
from uav_firmware.msg.status import Command, CommandResult, NavigationState, VehicleCommand

FORCE: Final = 21196.0
"""Parameter 2 of COMPONENT_ARM_DISARM that skips the checks, as MAVLink defines it."""
FORCED_ARMING: Final = 2989.0
"""What ground stations send to every autopilot to skip the checks before arming, as ArduPilot reads
it: QGroundControl (Vehicle::forceArm) and Mission Planner (MAVLinkInterface.doARM)."""

_MAIN_AUTO: Final = 4.0
_MAIN_POSITION: Final = 3.0
_MODES: Final[Mapping[tuple[float, float], NavigationState]] = {
    (_MAIN_AUTO, 2.0): NavigationState.AUTO_TAKEOFF,
    (_MAIN_AUTO, 3.0): NavigationState.AUTO_LOITER,
    (_MAIN_AUTO, 4.0): NavigationState.AUTO_MISSION,
    (_MAIN_AUTO, 5.0): NavigationState.AUTO_RTL,
    (_MAIN_AUTO, 6.0): NavigationState.AUTO_LAND,
    (_MAIN_AUTO, 8.0): NavigationState.AUTO_FOLLOW_TARGET,
    (_MAIN_POSITION, 1.0): NavigationState.ORBIT,
    (1.0, 0.0): NavigationState.MANUAL,
    (2.0, 0.0): NavigationState.ALTCTL,
    (_MAIN_POSITION, 0.0): NavigationState.POSCTL,
    (5.0, 0.0): NavigationState.ACRO,
    (6.0, 0.0): NavigationState.OFFBOARD,
    (7.0, 0.0): NavigationState.STAB,
}
_MODE_CUSTOM: Final = 1.0


def decide(command: VehicleCommand, situation: Situation) -> Decision:
    """Answer to a command."""
    handler = HANDLERS.get(command.command)
    if handler is None:
        return Decision(CommandResult.UNSUPPORTED)
    try:
        refuse_infinite(command)
        decision = handler(command, situation)
    except BadParameterError as error:
        return denied(f"{Command(command.command).name} denied: {error}")
    if decision.result is CommandResult.ACCEPTED or not decision.reason:
        return decision
    return _refused(command, decision)


def decide_on_target(command: VehicleCommand, decision: Decision, refusal: str) -> Decision:
    """Final answer to a command whose target the geofence allows, or refuses with a reason."""
    return _refused(command, denied(refusal)) if refusal else decision


def _refused(command: VehicleCommand, decision: Decision) -> Decision:
    """Put the name of the command before the reason."""
    name = Command(command.command).name
    return decision._replace(reason=f"{name} refused: {decision.reason}")


def _arm_disarm(command: VehicleCommand, situation: Situation) -> Decision:
    arm = choice(command, 1, 0.0, 1.0) == 1.0
    forces = (FORCE, FORCED_ARMING) if arm else (FORCE,)
    force = not unset(command.param2) and choice(command, 2, *forces) in forces
    refuse_set(command, 3, 4, 5, 6, 7)
    if not arm:
        if not situation.armed:
            return accepted()
        if not situation.view.landed and not force:
            return temporarily_rejected("the vehicle is in the air")
        return accepted(Disarm())
    if situation.armed:
        return accepted()
    if force:
        startable = situation.mode in mode_requirements.STARTABLE
        return (
            accepted(Arm()) if startable else accepted(SetMode(NavigationState.AUTO_LOITER), Arm())
        )
    reason = arming_refusal(situation)
    return accepted(Arm()) if reason is None else temporarily_rejected(reason)


def arming_refusal(situation: Situation) -> str | None:
    """First reason not to arm; None when the vehicle may be armed."""
    mode, view = situation.mode, situation.view
    positioned = Need.POSITION in mode_requirements.needs_of(mode, view)
    failures = health_checks.failures(view, situation.params, positioned=positioned)
    if failures:
        return failures[0]
    if mode not in mode_requirements.STARTABLE:
        return f"Mode {mode.name} cannot be started from"
    return mode_requirements.missing(mode, view) or health_checks.unsafe_throttle(mode, view.sticks)


def _check(command: VehicleCommand, situation: Situation) -> Decision:
    """RUN_PREARM_CHECKS: reports the first check that fails."""
    refuse_set(command, 1, 2, 3, 4, 5, 6, 7)
    if situation.armed:
        return temporarily_rejected("the vehicle is armed")
    reason = arming_refusal(situation)
    return accepted(note="Ready to arm" if reason is None else f"Not ready: {reason}")


def _set_mode(command: VehicleCommand, situation: Situation) -> Decision:
    if not int(choice(command, 1, *map(float, range(256)))) & int(_MODE_CUSTOM):
        return denied("parameter 1 has no custom mode")
    refuse_set(command, 4, 5, 6, 7)
    main, sub = command.param2, command.param3
    state = _MODES.get((main, sub))
    if state is None:
        return denied(f"mode {main:g}/{sub:g} is not available")
    return flight_commands.change_mode(state, situation)


def _mission_start(command: VehicleCommand, situation: Situation) -> Decision:
    """MISSION_START: mission mode and armed, as on PX4; nothing changes if a check fails."""
    refuse_set(command, 3, 4, 5, 6, 7)
    progress = situation.view.progress
    total = progress.seq_total if progress is not None else 0
    first, last = command.param1, command.param2
    if total == 0:
        return failed("no mission stored")
    if not (unset(first) or first == -1.0 or first in range(total)):
        return denied(f"parameter 1 is {first:g}, no item of the mission")
    if not (unset(last) or last in {-1.0, float(total - 1)}):
        return denied("parameter 2: a mission is flown to its last item")
    decision = flight_commands.change_mode(NavigationState.AUTO_MISSION, situation)
    if decision.result is not CommandResult.ACCEPTED:
        return decision
    if not situation.armed:
        in_mission = situation._replace(mode=NavigationState.AUTO_MISSION)
        reason = arming_refusal(in_mission)
        if reason is not None:
            return temporarily_rejected(reason)
    effects = decision.effects
    if first > 0.0:
        jump = MissionCurrentRequest(situation.view.now_us, int(first), reset=True)
        effects = (RequestNavigator(jump), SetMode(NavigationState.AUTO_MISSION))
    return accepted(*effects) if situation.armed else accepted(*effects, Arm())


def _set_current(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_SET_MISSION_CURRENT, with the results in the order of the mission protocol."""
    refuse_set(command, 3, 4, 5, 6, 7)
    seq, reset = command.param1, command.param2
    if seq < -1.0 or not seq.is_integer():
        return denied(f"parameter 1 is {seq:g}, no item number")
    if not (unset(reset) or reset == 1.0):
        return denied(f"parameter 2 is {reset:g}, neither 0 nor 1")
    progress = situation.view.progress
    if progress is None or progress.seq_total == 0:
        return failed("no mission stored")
    if seq >= progress.seq_total:
        return failed(f"the mission has {progress.seq_total} items")
    request = MissionCurrentRequest(situation.view.now_us, int(seq), reset=reset == 1.0)
    return accepted(RequestNavigator(request))


def _pause_continue(command: VehicleCommand, situation: Situation) -> Decision:
    resume = choice(command, 1, 0.0, 1.0) == 1.0
    refuse_set(command, 2, 3, 4, 5, 6, 7)
    if not situation.armed:
        return temporarily_rejected("the vehicle is disarmed")
    if not resume:
        return flight_commands.change_mode(NavigationState.AUTO_LOITER, situation)
    progress = situation.view.progress
    if situation.mode is NavigationState.AUTO_MISSION:
        return accepted()
    if progress is None or progress.state != MissionState.PAUSED:
        return temporarily_rejected("no mission is paused")
    return flight_commands.change_mode(NavigationState.AUTO_MISSION, situation)


def _set_home(command: VehicleCommand, situation: Situation) -> Decision:
    here = choice(command, 1, 0.0, 1.0) == 1.0
    refuse_set(command, 2, 3)
    view = situation.view
    if here:
        refuse_set(command, 4, 5, 6, 7)
        return accepted(SetHome(None, NAN)) if view.position_valid else failed("position unknown")
    spot = place(command, view, zero_is_unset=False)
    if any(map(math.isnan, spot)):
        return denied("parameters 5 to 7: no place")
    if view.position is None or not view.position_valid:
        return temporarily_rejected("position unknown")
    yaw = NAN if unset(command.param4) else math.radians(command.param4)
    return accepted(SetHome(spot, yaw))


def _fence_enable(command: VehicleCommand, situation: Situation) -> Decision:
    """DO_FENCE_ENABLE for the whole geofence; it has no floor that 2 could disable."""
    enabled = choice(command, 1, 0.0, 1.0) == 1.0
    refuse_set(command, 2, 3, 4, 5, 6, 7)
    return accepted(RequestNavigator(FenceSwitch(situation.view.now_us, enabled)))


def _terminate(command: VehicleCommand, situation: Situation) -> Decision:
    terminate = choice(command, 1, 0.0, 1.0) == 1.0
    refuse_set(command, 2, 3, 4, 5, 6, 7)
    if not terminate:
        return accepted()
    return (
        accepted(Terminate())
        if situation.armed
        else temporarily_rejected("the vehicle is disarmed")
    )


def _inject_failure(command: VehicleCommand, situation: Situation) -> Decision:
    """INJECT_FAILURE, only with SYS_FAILURE_EN."""
    numbers = (command.param1, command.param2, 0.0 if unset(command.param3) else command.param3)
    refuse_set(command, 4, 5, 6, 7)
    for number, value in enumerate(numbers, start=1):
        if not (value >= 0.0 and value.is_integer()):
            return denied(f"parameter {number} is {value:g}")
    if not situation.params.failure_injection:
        return denied("SYS_FAILURE_EN is 0")
    unit, failure_type, instance = map(int, numbers)
    return accepted(InjectFailure(unit, failure_type, instance))


Handler = Callable[[VehicleCommand, Situation], Decision]

HANDLERS: Final[Mapping[int, Handler]] = {
    Command.NAV_WAYPOINT: flight_commands.waypoint,
    Command.NAV_LOITER_UNLIM: flight_commands.loiter,
    Command.NAV_LOITER_TIME: flight_commands.loiter_time,
    Command.NAV_RETURN_TO_LAUNCH: flight_commands.return_home,
    Command.NAV_LAND: flight_commands.land,
    Command.NAV_TAKEOFF: flight_commands.take_off,
    Command.DO_FOLLOW: guidance_commands.follow,
    Command.DO_ORBIT: guidance_commands.orbit,
    Command.CONDITION_YAW: guidance_commands.condition_yaw,
    Command.DO_SET_ROI_LOCATION: guidance_commands.set_roi_location,
    Command.DO_SET_ROI_NONE: guidance_commands.set_roi_none,
    Command.DO_SET_ROI: guidance_commands.set_roi,
    Command.DO_SET_MODE: _set_mode,
    Command.DO_CHANGE_SPEED: flight_commands.change_speed,
    Command.DO_SET_HOME: _set_home,
    Command.DO_FLIGHTTERMINATION: _terminate,
    Command.DO_FENCE_ENABLE: _fence_enable,
    Command.DO_REPOSITION: flight_commands.reposition,
    Command.DO_PAUSE_CONTINUE: _pause_continue,
    Command.DO_SET_MISSION_CURRENT: _set_current,
    Command.MISSION_START: _mission_start,
    Command.COMPONENT_ARM_DISARM: _arm_disarm,
    Command.RUN_PREARM_CHECKS: _check,
    Command.INJECT_FAILURE: _inject_failure,
}
