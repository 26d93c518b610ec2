"""The commander on the bus: commands in; acknowledgements, state, home and texts out."""

from collections.abc import Callable
from typing import Final, NamedTuple

from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.arm_state_machine import (
    DISARM_TEXTS,
    Arming,
    ArmingEvent,
    DisarmTimer,
    after,
)
from uav_firmware.modules.commander.commands.decision import (
    Arm,
    Decision,
    Disarm,
    FlightEffect,
    HoldFor,
    InjectFailure,
    RequestNavigator,
    SetHome,
    SetMode,
    Terminate,
    temporarily_rejected,
)
from uav_firmware.modules.commander.commands.dispatch import decide, decide_on_target
from uav_firmware.modules.commander.commands.flight_commands import Situation, hold_here
from uav_firmware.modules.commander.failsafe.causes import ROWS
from uav_firmware.modules.commander.failsafe.machine import (
    Failsafe,
    FailsafeMachine,
    FailureLatch,
    Reaction,
)
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe.return_time import return_speeds
from uav_firmware.modules.commander.failsafe_actions import PILOTED, Action
from uav_firmware.modules.commander.health_report import HEALTH_PERIOD_US, Health, check_health
from uav_firmware.modules.commander.home_position import HomePositionUpdater
from uav_firmware.modules.commander.mode_changes import StickOverride, TimedHold
from uav_firmware.modules.commander.mode_requirements import control_of
from uav_firmware.modules.commander.observer import Observer
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.control_mode import VehicleControlMode
from uav_firmware.msg.mission import ModeTarget, NavigatorRequest, ReturnOrder, TargetCheckRequest
from uav_firmware.msg.status import (
    PROGRESS_UNKNOWN,
    CommandResult,
    NavigationState,
    Severity,
    StatusText,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

READS: Final = (
    "vehicle_command", "target_check_result", "mission", "mission_progress", "navigator_status",
    "geofence_status", "vehicle_attitude", "vehicle_local_position", "estimator_status",
    "land_detected", "failure_detector_status", "sensors_status", "storage_status", "sensor_imu",
    "sensor_baro", "sensor_mag", "sensor_gps", "sensor_range", "battery_status",
    "ground_station_heartbeat", "manual_control_setpoint", "offboard_setpoint", "internal_errors",
    "terrain_estimate",
)  # fmt: skip
WRITES: Final = (
    "vehicle_command_ack", "vehicle_status", "vehicle_control_mode", "home_position", "wind",
    "navigator_request", "target_check_request", "status_text",
)  # fmt: skip
PERIOD_US: Final = 20_000  # [us] 50 Hz
STATUS_PERIOD_US: Final = 500_000  # [us] 2 Hz at least


class _Unchecked(NamedTuple):
    """A command whose target the navigator checks by the geofence."""

    request_id: int
    command: VehicleCommand
    decision: Decision


class CommanderModule:
    """Holds the arming state and the mode of the vehicle.

    Declares `CommanderParams` and `FailsafeParams` in the registry. Starts disarmed in AUTO_LOITER.
    """

    def __init__(
        self,
        registry: Registry,
        topics: Topics,
        *,
        inject: Callable[[int, int, int], bool] = lambda _unit, _type, _instance: False,
    ) -> None:
        registry.add(CommanderParams)
        registry.add(FailsafeParams)
        self._registry = registry
        self._topics = topics
        self._inject = inject
        self._latch = FailureLatch()
        self._observer = Observer(topics, self._latch)
        self._failures_cleared_us = 0
        self._params_version = registry.version
        self._params = registry.read(CommanderParams)
        self._failsafe_params = registry.read(FailsafeParams)
        self._arming = Arming.DISARMED
        self._mode = NavigationState.AUTO_LOITER
        self._armed_since_us = 0
        self._airborne_since_us: int | None = None
        self._failsafe = FailsafeMachine()
        self._failsafe.return_speeds = return_speeds(registry)
        self._stick_override = StickOverride()
        self._disarm_timer = DisarmTimer()
        self._timed_hold = TimedHold()
        self._home = HomePositionUpdater(topics.home_position)
        self._last_target: tuple[NavigationState, str] | None = None
        self._failsafe_due_us = 0
        self._health = Health(0, NavigationState.AUTO_LOITER, armed=False)
        self._waited = False
        self._view: VehicleView | None = None  # Of a step that has not been finished
        self._unchecked: _Unchecked | None = None
        self._checks = 0  # Requests to the navigator so far
        self._last_us: int | None = None

    def update(self, now_us: int) -> None:
        """Begin a step if one is due, up to the first command whose target the navigator checks."""
        if self._last_us is not None and now_us - self._last_us < PERIOD_US:
            return
        self._last_us = now_us
        if self._params_version != self._registry.version:
            self._params_version = self._registry.version
            self._params = self._registry.read(CommanderParams)
            self._failsafe_params = self._registry.read(FailsafeParams)
            self._failsafe.return_speeds = return_speeds(self._registry)
            self._acknowledge(now_us)
        view = self._observer.read(now_us, self._failsafe_params)
        if view.position is not None and view.position_valid:
            self._home.update(now_us, view.position)
            if view.home is not self._topics.home_position.value:
                view = view._replace(home=self._topics.home_position.value)
        self._waited = self._mission_is_new() and not self._waited
        self._view = view if self._waited else self._handle_commands(view)

    def resume(self) -> None:
        """Answer the command whose target the navigator has checked, and continue with the next."""
        view, unchecked = self._view, self._unchecked
        if view is None or unchecked is None:
            return
        for result in self._topics.target_check_result.drain():
            if result.request_id == unchecked.request_id:
                _, command, decision = unchecked
                self._unchecked = None
                decision = decide_on_target(command, decision, result.refusal)
                self._view = self._handle_commands(self._answer(command, decision, view))

    def finish(self) -> None:
        """Finish the step that `update` has begun: all that changes without a command."""
        view, self._view = self._view, None
        if view is None:
            return
        unchecked, self._unchecked = self._unchecked, None
        if unchecked is not None:  # Without an answer it is refused, and the others wait
            decision = temporarily_rejected("the geofence has not been checked")
            view = self._answer(unchecked.command, decision, view)
        self._observer.observe_wind(view, self._params.drag)
        self._supervise(view)
        self._publish(view)

    def _handle_commands(self, view: VehicleView) -> VehicleView:
        """Answer the commands in their order, up to one whose target the navigator has to check."""
        queue = self._topics.vehicle_command
        while self._unchecked is None and (command := queue.pop()) is not None:
            decision = decide(command, self._situation(view))
            if decision.target is None:
                view = self._answer(command, decision, view)
            else:
                self._checks += 1
                self._unchecked = _Unchecked(self._checks, command, decision)
                request = TargetCheckRequest(self._checks, decision.target)
                self._topics.target_check_request.publish(request)
        return view

    def _acknowledge(self, now_us: int) -> None:
        """Clear the latched failures if the operator has set COM_FAIL_ACK."""
        if not self._params.acknowledge_failures or self._armed:
            return
        self._latch.clear()
        self._failures_cleared_us = now_us
        self._registry.put_back("COM_FAIL_ACK")
        self._report(now_us, Severity.WARNING, "Failures of former flights acknowledged")

    @property
    def _armed(self) -> bool:
        return self._arming is Arming.ARMED

    def _mission_is_new(self) -> bool:
        """Whether the navigator has not yet received the mission just uploaded.

        Commands then wait for one step, so that a start sent right after the upload is decided
        by the new mission.
        """
        mission, progress = self._topics.mission.value, self._topics.mission_progress.value
        if mission is None:
            return False
        uploaded = (mission.mission_id, len(mission.items))
        return progress is None or (progress.mission_id, progress.seq_total) != uploaded

    def _situation(self, view: VehicleView) -> Situation:
        return Situation(view, self._armed, self._mode, self._params)

    def _answer(
        self, command: VehicleCommand, decision: Decision, view: VehicleView
    ) -> VehicleView:
        """Carry out a decision and acknowledge its command; returns the view with the new home."""
        for effect in decision.effects:
            if isinstance(effect, InjectFailure):
                if not self._inject(*effect):
                    decision = Decision(CommandResult.UNSUPPORTED, "The vehicle cannot fail so")
            else:
                self._carry_out(effect, view)
        if decision.reason:
            accepted = decision.result is CommandResult.ACCEPTED
            self._report(
                view.now_us, Severity.INFO if accepted else Severity.WARNING, decision.reason
            )
        self._topics.vehicle_command_ack.publish(
            VehicleCommandAck(
                view.now_us, command.command, decision.result, PROGRESS_UNKNOWN, command.token
            )
        )
        return view._replace(home=self._topics.home_position.value)

    def _carry_out(self, effect: FlightEffect, view: VehicleView) -> None:
        match effect:
            case SetMode(state):
                self._failsafe.override()
                self._timed_hold.cancel()
                self._enter(state)
            case HoldFor(seconds, then):
                self._timed_hold.order(seconds, then, view.now_us)
            case Arm():
                self._arm(view)
            case Disarm():
                self._disarm(ArmingEvent.DISARM_ACCEPTED, view.now_us)
            case Terminate():
                self._disarm(ArmingEvent.TERMINATED, view.now_us)
            case SetHome(place, yaw):
                if view.position is not None:
                    self._home.set(view.now_us, view.position, place, yaw)
            case RequestNavigator(request):
                self._request_navigator(request)

    def _enter(self, mode: NavigationState) -> None:
        """Change the mode; a target of another mode is no longer flown."""
        self._mode = mode
        if self._last_target is not None and self._last_target[0] is not mode:
            self._last_target = None

    def _request_navigator(self, request: NavigatorRequest) -> None:
        """Send a request; a repeated target of the same mode is not sent again."""
        if isinstance(request, ModeTarget):
            # As text, since NaN equals nothing.
            target = (request.navigation_state, str(request[1:]))
            if target == self._last_target and request.navigation_state is self._mode:
                return
            self._last_target = target
        self._topics.navigator_request.publish(request)

    def _arm(self, view: VehicleView) -> None:
        self._arming = after(self._arming, ArmingEvent.ARM_ACCEPTED)
        self._registry.armed = True
        self._armed_since_us = view.now_us
        self._disarm_timer.start(view.now_us)
        self._failsafe.clear()
        if view.position is not None and view.position_valid:
            self._home.on_arming(view.now_us, view.position)
        self._report(view.now_us, Severity.INFO, "Armed")

    def _disarm(self, event: ArmingEvent, now_us: int) -> None:
        """Disarm; the next flight begins in hold."""
        self._arming = after(self._arming, event)
        self._registry.armed = False
        self._armed_since_us = 0
        if self._mode not in PILOTED:
            self._enter(NavigationState.AUTO_LOITER)
        self._failsafe.clear()
        self._airborne_since_us = None
        self._home.on_disarming()
        self._last_target = None
        self._report(now_us, *DISARM_TEXTS[event])

    def _supervise(self, view: VehicleView) -> None:
        """Changes without a command: the end of a mode, disarming, failsafes."""
        if not self._armed:
            return
        navigator = view.navigator
        if mode_requirements.missing_for_place(view) is not None:
            self._last_target = None  # No longer flown; sent again it is a new one
        done = (
            navigator is not None
            and navigator.finished
            and navigator.navigation_state is self._mode
        )
        if done and self._mode in mode_requirements.ENDING_IN_HOLD:
            self._enter(NavigationState.AUTO_LOITER)
        following = self._timed_hold.next_mode(self._mode, view.now_us, at_rest=done)
        if following is not self._mode and mode_requirements.missing(following, view) is None:
            self._enter(following)
        mission_state = view.progress.state if view.progress is not None else 0
        event = self._stopping_failure(view) or self._disarm_timer.due(
            view.now_us,
            landed=view.landed,
            resting=view.resting,
            mission_state=mission_state,
            params=self._params,
        )
        if event is not None:
            self._disarm(event, view.now_us)
        else:
            self._run_failsafes(view)

    def _stopping_failure(self, view: VehicleView) -> ArmingEvent | None:
        """Failure that stops the motors at once, in any mode."""
        if view.failure is not None and view.crashed:
            self._report(view.now_us, Severity.EMERGENCY, f"Crash: {view.failure.crash}")
            return ArmingEvent.CRASHED
        if view.landed and view.motor_failed:
            return ArmingEvent.MOTOR_FAILED_ON_GROUND
        return None

    def _run_failsafes(self, view: VehicleView) -> None:
        """Run failsafes and stick override.

        Not on the ground: a cause found there would not be new after the take-off.
        """
        if view.landed:
            self._airborne_since_us = None
            return
        if self._airborne_since_us is None:
            self._airborne_since_us = view.now_us
        self._observe_pilot(view)
        if view.now_us < self._failsafe_due_us:
            return
        self._failsafe_due_us = view.now_us + HEALTH_PERIOD_US
        airborne_s = (view.now_us - self._airborne_since_us) * 1e-6
        reaction = self._failsafe.update(view, self._failsafe_params, self._mode, airborne_s)
        self._report_causes(view.now_us, reaction)
        self._latch.note(cause for cause, _ in reaction.threats)
        if reaction.event is not None:
            self._disarm(reaction.event, view.now_us)
        elif reaction.mode is not None:
            if reaction.mode is self._mode is NavigationState.AUTO_LOITER:
                self._request_navigator(hold_here(view.now_us))  # It may still fly to a place
            self._timed_hold.cancel()
            self._enter(reaction.mode)
            if reaction.stays_low:
                self._request_navigator(ReturnOrder(view.now_us, reaction.mode))

    def _report_causes(self, now_us: int, reaction: Reaction) -> None:
        """Report the causes that act and those that are over."""
        for cause, action in reversed(reaction.threats):
            severity = Severity.WARNING if action is Action.WARN else Severity.CRITICAL
            self._report(now_us, severity, f"{ROWS[cause].text}: {action.name}")
            held = action is Action.HOLD and reaction.mode is NavigationState.AUTO_LOITER
            if held and (advice := ROWS[cause].advice):
                self._report(now_us, Severity.WARNING, advice)
        for cause in reaction.cleared:
            self._report(now_us, Severity.INFO, f"{ROWS[cause].text}: over")

    def _observe_pilot(self, view: VehicleView) -> None:
        """Change to position mode when a pilot moves a stick."""
        params = self._params
        sticks = view.sticks if view.sticks_fresh else None
        moved = self._stick_override.moved(sticks, params.stick_override_percent * 0.01, self._mode)
        bit = 2 if self._mode is NavigationState.OFFBOARD else 1
        waiting = self._failsafe.state is Failsafe.WAITING
        if not moved or waiting or self._mode in PILOTED or not params.stick_override & bit:
            return
        for mode in (NavigationState.POSCTL, NavigationState.ALTCTL):
            if mode_requirements.missing(mode, view) is None:
                self._failsafe.override()
                self._enter(mode)
                self._report(view.now_us, Severity.INFO, f"Pilot took over: {mode.name}")
                return

    def _report(self, now_us: int, severity: Severity, text: str) -> None:
        self._topics.status_text.publish(StatusText(now_us, severity, text))

    def _publish(self, view: VehicleView) -> None:
        health = self._health
        if view.now_us >= health.due_us or (self._mode, self._armed) != health[1:3]:
            health = self._health = check_health(self._situation(view))
        status = VehicleStatus(
            view.now_us,
            self._armed,
            self._mode,
            self._failsafe.state is not Failsafe.CLEAR,
            health.ready,
            self._armed_since_us,
            health.present,
            health.enabled,
            health.healthy,
            self._airborne_since_us or 0,
            self._failures_cleared_us,
        )
        old = self._topics.vehicle_status.value
        stale = old is None or view.now_us - old.time_us >= STATUS_PERIOD_US
        if old is None or stale or status[1:] != old[1:]:
            self._topics.vehicle_status.publish(status)
        source, level = control_of(
            self._mode if self._armed else NavigationState.AUTO_LOITER, view.offboard
        )
        control = self._topics.vehicle_control_mode
        if control.value is None or control.value[1:] != (source, level):
            control.publish(VehicleControlMode(view.now_us, source, level))
