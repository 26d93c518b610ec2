"""Shell of the commander: commands in, answers, state, home and sentences out."""

from collections.abc import Callable
from typing import Final

from uav_firmware.modules.commander.arming.arming_states import Arming, ArmingEvent, after
from uav_firmware.modules.commander.arming.disarming import DisarmTimer
from uav_firmware.modules.commander.arming.failure_latch import FailureLatch
from uav_firmware.modules.commander.arming.home import HomeKeeper
from uav_firmware.modules.commander.arming.readiness import EXAMINE_PERIOD_US, Health, examine
from uav_firmware.modules.commander.commands.decision import (
    Arm,
    Decision,
    Disarm,
    FlightEffect,
    HoldFor,
    Inject,
    SetHome,
    SetMode,
    Tell,
    Terminate,
)
from uav_firmware.modules.commander.commands.dispatch import decide
from uav_firmware.modules.commander.commands.flight_commands import Situation, hold_here
from uav_firmware.modules.commander.commands.texts import DISARM_TEXTS, Severity
from uav_firmware.modules.commander.failsafe.actions import PILOTED, Action
from uav_firmware.modules.commander.failsafe.causes import ROWS
from uav_firmware.modules.commander.failsafe.machine import Failsafe, FailsafeMachine
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe.return_time import pace_of
from uav_firmware.modules.commander.modes import requirements
from uav_firmware.modules.commander.modes.control_mode import control_of
from uav_firmware.modules.commander.modes.pilot import TakeOver
from uav_firmware.modules.commander.modes.timed_hold import TimedHold
from uav_firmware.modules.commander.observer import Observer
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.topics import CommanderTopics
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.control_mode import VehicleControlMode
from uav_firmware.msg.mission import ModeTarget, NavigatorRequest
from uav_firmware.msg.status import (
    CommandResult,
    NavigationState,
    StatusText,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.parameters import Registry

PERIOD_US: Final = 20_000  # [us] 50 Hz
STATUS_PERIOD_US: Final = 500_000  # [us] 2 Hz at least


class CommanderModule:
    """Holds the vehicle's arming state and mode.

    Declares `CommanderParams` and `FailsafeParams` in the registry. Starts disarmed in AUTO_LOITER.
    """

    def __init__(
        self,
        registry: Registry,
        topics: CommanderTopics,
        *,
        inject: Callable[[int, int, int], bool] = lambda _unit, _type, _instance: False,
        refusal_of: Callable[[ModeTarget], str | None] = lambda _target: None,
    ) -> None:
        registry.add(CommanderParams)
        registry.add(FailsafeParams)
        self._registry = registry
        self._topics = topics
        self._refusal_of = refusal_of
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
        self._failsafe.pace = pace_of(registry)
        self._take_over = TakeOver()
        self._disarm_timer = DisarmTimer()
        self._timed_hold = TimedHold()
        self._home_keeper = HomeKeeper(topics.home_position)
        self._last_target: tuple[NavigationState, str] | None = None
        self._judge_due_us = 0
        self._health = Health(0, NavigationState.AUTO_LOITER, armed=False)
        self._waited = False
        self._last_us: int | None = None

    def update(self, now_us: int) -> None:
        """Run a step if one is due."""
        if self._last_us is not None and now_us - self._last_us < PERIOD_US:
            return
        self._last_us = now_us
        if self._params_version != self._registry.version:
            self._params_version = self._registry.version
            self._params = self._registry.read(CommanderParams)
            self._failsafe_params = self._registry.read(FailsafeParams)
            self._failsafe.pace = pace_of(self._registry)
            self._acknowledge(now_us)
        view = self._observer.look(now_us, self._failsafe_params)
        if view.position is not None and view.position_valid:
            self._home_keeper.keep(now_us, view.position)
            if view.home is not self._topics.home_position.value:
                view = view._replace(home=self._topics.home_position.value)
        self._waited = self._mission_is_new() and not self._waited
        for command in [] if self._waited else self._topics.vehicle_command.drain():
            self._answer(command, view)
            view = view._replace(home=self._topics.home_position.value)
        self._observer.observe_wind(view, self._params.drag)
        self._supervise(view)
        self._publish(view)

    def _acknowledge(self, now_us: int) -> None:
        """Clear the latched failures if the operator has set COM_FAIL_ACK."""
        if not self._params.acknowledge_failures or self._armed:
            return
        self._latch.clear()
        self._failures_cleared_us = now_us
        self._registry.put_back("COM_FAIL_ACK")
        self._say(now_us, Severity.WARNING, "Failures of former flights acknowledged")

    @property
    def _armed(self) -> bool:
        return self._arming is Arming.ARMED

    def _mission_is_new(self) -> bool:
        """Whether the navigator has not yet looked at the mission just uploaded.

        Commands then wait for one step, so that a start sent right after the upload is judged
        by the mission that it means.
        """
        mission, progress = self._topics.mission.value, self._topics.mission_progress.value
        if mission is None:
            return False
        wanted = (mission.mission_id, len(mission.items))
        return progress is None or (progress.mission_id, progress.seq_total) != wanted

    def _situation(self, view: VehicleView) -> Situation:
        return Situation(view, self._armed, self._mode, self._params, self._refusal_of)

    def _answer(self, command: VehicleCommand, view: VehicleView) -> None:
        decision = decide(command, self._situation(view))
        for effect in decision.effects:
            if isinstance(effect, Inject):
                if not self._inject(*effect):
                    decision = Decision(CommandResult.UNSUPPORTED, "The vehicle cannot fail so")
            else:
                self._carry_out(effect, view)
        if decision.reason:
            accepted = decision.result is CommandResult.ACCEPTED
            self._say(view.now_us, Severity.INFO if accepted else Severity.WARNING, decision.reason)
        self._topics.vehicle_command_ack.publish(
            VehicleCommandAck(view.now_us, command.command, decision.result, 255, command.token)
        )

    def _carry_out(self, effect: FlightEffect, view: VehicleView) -> None:
        match effect:
            case SetMode(state):
                self._failsafe.overrule()
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
                    self._home_keeper.command(view.now_us, view.position, place, yaw)
            case Tell(request):
                self._tell(request)

    def _enter(self, mode: NavigationState) -> None:
        """Fly in a mode; a target of any other one is no longer being flown."""
        self._mode = mode
        if self._last_target is not None and self._last_target[0] is not mode:
            self._last_target = None

    def _tell(self, request: NavigatorRequest) -> None:
        """Hand a request on; a repeated target of the same mode is not flown twice."""
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
            self._home_keeper.arm(view.now_us, view.position)
        self._say(view.now_us, Severity.INFO, "Armed")

    def _disarm(self, event: ArmingEvent, now_us: int) -> None:
        """Stop the motors; the next flight begins in hold."""
        self._arming = after(self._arming, event)
        self._registry.armed = False
        self._armed_since_us = 0
        if self._mode not in PILOTED:
            self._enter(NavigationState.AUTO_LOITER)
        self._failsafe.clear()
        self._airborne_since_us = None
        self._home_keeper.disarm()
        self._last_target = None
        self._say(now_us, *DISARM_TEXTS[event])

    def _supervise(self, view: VehicleView) -> None:
        """What changes without a command: the end of a mode, disarming, failsafes."""
        if not self._armed:
            return
        navigator = view.navigator
        if requirements.missing_for_place(view) is not None:
            self._last_target = None  # Not flown any more; ordered again it is a new one
        done = (
            navigator is not None
            and navigator.finished
            and navigator.navigation_state is self._mode
        )
        if done and self._mode in requirements.ENDING_IN_HOLD:
            self._enter(NavigationState.AUTO_LOITER)
        following = self._timed_hold.next_mode(self._mode, view.now_us, at_rest=done)
        if following is not self._mode and requirements.missing(following, view) is None:
            self._enter(following)
        mission_state = view.progress.state if view.progress is not None else 0
        event = self._stopping_failure(view) or self._disarm_timer.due(
            view.now_us, landed=view.landed, mission_state=mission_state, params=self._params
        )
        if event is not None:
            self._disarm(event, view.now_us)
        else:
            self._watch(view)

    def _stopping_failure(self, view: VehicleView) -> ArmingEvent | None:
        """What stops the motors at once, whatever is flown."""
        if view.failure is not None and view.crashed:
            self._say(view.now_us, Severity.EMERGENCY, f"Crash: {view.failure.crash}")
            return ArmingEvent.CRASHED
        if view.landed and view.motor_failed:
            return ArmingEvent.MOTOR_FAILED_ON_GROUND
        return None

    def _watch(self, view: VehicleView) -> None:
        """Failsafes and the pilot's taking over.

        Not on the ground: what is found there would no longer be new after the take-off.
        """
        if view.landed:
            self._airborne_since_us = None
            return
        if self._airborne_since_us is None:
            self._airborne_since_us = view.now_us
        self._observe_pilot(view)
        if view.now_us < self._judge_due_us:
            return
        self._judge_due_us = view.now_us + EXAMINE_PERIOD_US
        airborne_s = (view.now_us - self._airborne_since_us) * 1e-6
        reaction = self._failsafe.update(view, self._failsafe_params, self._mode, airborne_s)
        for cause, action in reversed(reaction.threats):
            severity = Severity.WARNING if action is Action.WARN else Severity.CRITICAL
            self._say(view.now_us, severity, f"{ROWS[cause].text}: {action.name}")
        self._latch.note(cause for cause, _ in reaction.threats)
        for cause in reaction.cleared:
            self._say(view.now_us, Severity.INFO, f"{ROWS[cause].text}: over")
        if reaction.event is not None:
            self._disarm(reaction.event, view.now_us)
        elif reaction.mode is not None:
            if reaction.mode is self._mode is NavigationState.AUTO_LOITER:
                self._tell(hold_here(view.now_us))  # it may be on its way to a place
            self._timed_hold.cancel()
            self._enter(reaction.mode)

    def _observe_pilot(self, view: VehicleView) -> None:
        """Let a pilot who moves a stick fly on in position mode."""
        params = self._params
        sticks = view.sticks if view.sticks_fresh else None
        moved = self._take_over.moved(sticks, params.stick_override_percent * 0.01, self._mode)
        bit = 2 if self._mode is NavigationState.OFFBOARD else 1
        waiting = self._failsafe.state is Failsafe.WAITING
        if not moved or waiting or self._mode in PILOTED or not params.stick_override & bit:
            return
        for mode in (NavigationState.POSCTL, NavigationState.ALTCTL):
            if requirements.missing(mode, view) is None:
                self._failsafe.overrule()
                self._enter(mode)
                self._say(view.now_us, Severity.INFO, f"Pilot took over: {mode.name}")
                return

    def _say(self, now_us: int, severity: Severity, text: str) -> None:
        self._topics.status_text.publish(StatusText(now_us, severity, text))

    def _publish(self, view: VehicleView) -> None:
        health = self._health
        if view.now_us >= health.due_us or (self._mode, self._armed) != health[1:3]:
            health = self._health = examine(self._situation(view))
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
