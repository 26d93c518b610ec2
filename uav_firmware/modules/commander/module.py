"""Shell of the commander: commands in, answers, state, home and sentences out."""

from collections.abc import Callable
from typing import Any, Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.arming_states import Arming, ArmingEvent, after
from uav_firmware.modules.commander.commands import arming_refusal, decide
from uav_firmware.modules.commander.decision import (
    Arm,
    Disarm,
    Effect,
    SetHome,
    SetMode,
    Tell,
    Terminate,
)
from uav_firmware.modules.commander.disarming import DisarmTimer
from uav_firmware.modules.commander.failsafe import (
    TEXT_OF,
    Action,
    FailsafeMonitor,
    mode_against,
)
from uav_firmware.modules.commander.flight_commands import Situation
from uav_firmware.modules.commander.home import HomeKeeper
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.sensor_watch import Freshness, healthy_bits, present_bits
from uav_firmware.modules.commander.texts import DISARM_TEXTS, Severity
from uav_firmware.modules.commander.vehicle_view import SensorAges, VehicleView
from uav_firmware.msg.estimate import EstimatorStatus, VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.mission import (
    Mission,
    MissionProgress,
    ModeTarget,
    NavigatorRequest,
    NavigatorStatus,
)
from uav_firmware.msg.sensors import SensorBaro, SensorBattery, SensorGps, SensorImu, SensorMag
from uav_firmware.msg.status import (
    CommandResult,
    HomePosition,
    LandDetected,
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

    Declares `CommanderParams` in the registry. Starts disarmed in AUTO_LOITER.
    """

    def __init__(
        self,
        registry: Registry,
        *,
        vehicle_command: Queue[VehicleCommand],
        vehicle_command_ack: Queue[VehicleCommandAck],
        vehicle_attitude: Topic[VehicleAttitude],
        vehicle_local_position: Topic[VehicleLocalPosition],
        estimator_status: Topic[EstimatorStatus],
        land_detected: Topic[LandDetected],
        mission: Topic[Mission],
        mission_progress: Topic[MissionProgress],
        navigator_status: Topic[NavigatorStatus],
        sensor_imu: Topic[SensorImu],
        sensor_baro: Topic[SensorBaro],
        sensor_mag: Topic[SensorMag],
        sensor_gps: Topic[SensorGps],
        sensor_battery: Topic[SensorBattery],
        ground_station_heartbeat: Topic[Any],
        vehicle_status: Topic[VehicleStatus],
        home_position: Topic[HomePosition],
        navigator_request: Queue[NavigatorRequest],
        status_text: Queue[StatusText],
        refusal_of: Callable[[ModeTarget], str | None],
    ) -> None:
        registry.add(CommanderParams)
        self._registry = registry
        self._commands = vehicle_command
        self._answers = vehicle_command_ack
        self._attitude = vehicle_attitude
        self._position = vehicle_local_position
        self._estimator = estimator_status
        self._land = land_detected
        self._mission = mission
        self._progress = mission_progress
        self._navigator = navigator_status
        self._gps = sensor_gps
        self._battery = sensor_battery
        self._status = vehicle_status
        self._home = home_position
        self._requests = navigator_request
        self._texts = status_text
        self._refusal_of = refusal_of
        heard: tuple[Topic[Any], ...] = (
            sensor_imu,
            sensor_baro,
            sensor_mag,
            sensor_gps,
            sensor_battery,
            ground_station_heartbeat,
        )
        self._heard = [Freshness(topic) for topic in heard]
        self._params_version = registry.version
        self._params = registry.read(CommanderParams)
        self._arming = Arming.DISARMED
        self._mode = NavigationState.AUTO_LOITER
        self._armed_since_us = 0
        self._failsafe = False
        self._monitor = FailsafeMonitor()
        self._disarm_timer = DisarmTimer()
        self._home_keeper = HomeKeeper(home_position)
        self._last_target = ""
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
        view = self._view(now_us)
        if view.position is not None and view.position_valid:
            self._home_keeper.keep(now_us, view.position)
            view = view._replace(home=self._home.value)
        self._waited = self._mission_is_new() and not self._waited
        for command in [] if self._waited else self._commands.drain():
            self._answer(command, view)
            view = view._replace(home=self._home.value)
        self._supervise(view)
        self._publish(view)

    @property
    def _armed(self) -> bool:
        return self._arming is Arming.ARMED

    def _mission_is_new(self) -> bool:
        """Whether the navigator has not yet looked at the mission just uploaded.

        Commands then wait for one step, so that a start sent right after the upload is judged
        by the mission that it means.
        """
        mission, progress = self._mission.value, self._progress.value
        if mission is None:
            return False
        wanted = (mission.mission_id, len(mission.items))
        return progress is None or (progress.mission_id, progress.seq_total) != wanted

    def _view(self, now_us: int) -> VehicleView:
        estimator = self._estimator.value
        return VehicleView(
            now_us,
            self._attitude.value,
            self._position.value,
            estimator is not None and estimator.aligned,
            self._gps.value,
            self._battery.value,
            self._land.value,
            self._home.value,
            self._progress.value,
            self._navigator.value,
            SensorAges(*(heard.age(now_us) for heard in self._heard)),
        )

    def _situation(self, view: VehicleView) -> Situation:
        return Situation(view, self._armed, self._mode, self._params, self._refusal_of)

    def _answer(self, command: VehicleCommand, view: VehicleView) -> None:
        decision = decide(command, self._situation(view))
        for effect in decision.effects:
            self._carry_out(effect, view)
        if decision.reason:
            accepted = decision.result is CommandResult.ACCEPTED
            self._say(view.now_us, Severity.INFO if accepted else Severity.WARNING, decision.reason)
        self._answers.publish(
            VehicleCommandAck(view.now_us, command.command, decision.result, 255, command.token)
        )

    def _carry_out(self, effect: Effect, view: VehicleView) -> None:
        match effect:
            case SetMode(state):
                self._failsafe = False
                self._mode = state
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

    def _tell(self, request: NavigatorRequest) -> None:
        """Hand a request on; a repeated target of the same mode is not flown twice."""
        if isinstance(request, ModeTarget):
            # As text, since NaN equals nothing.
            target = str(request[1:])
            if target == self._last_target and request.navigation_state is self._mode:
                return
            self._last_target = target
        self._requests.publish(request)

    def _arm(self, view: VehicleView) -> None:
        self._arming = after(self._arming, ArmingEvent.ARM_ACCEPTED)
        self._armed_since_us = view.now_us
        self._disarm_timer.start(view.now_us)
        self._monitor.clear()
        if view.position is not None and view.position_valid:
            self._home_keeper.arm(view.now_us, view.position)
        self._say(view.now_us, Severity.INFO, "Armed")

    def _disarm(self, event: ArmingEvent, now_us: int) -> None:
        """Stop the motors; the next flight begins in hold."""
        self._arming = after(self._arming, event)
        self._armed_since_us = 0
        self._mode = NavigationState.AUTO_LOITER
        self._failsafe = False
        self._home_keeper.disarm()
        self._last_target = ""
        self._say(now_us, *DISARM_TEXTS[event])

    def _supervise(self, view: VehicleView) -> None:
        """What changes without a command: the end of a mode, disarming, failsafes."""
        if not self._armed:
            return
        navigator = view.navigator
        done = (
            navigator is not None
            and navigator.finished
            and navigator.navigation_state is self._mode
        )
        if done and self._mode in mode_requirements.ENDING_IN_HOLD:
            self._mode = NavigationState.AUTO_LOITER
        mission_state = view.progress.state if view.progress is not None else 0
        event = self._disarm_timer.due(
            view.now_us, landed=view.landed, mission_state=mission_state, params=self._params
        )
        if event is not None:
            self._disarm(event, view.now_us)
        else:
            self._watch(view)

    def _watch(self, view: VehicleView) -> None:
        """Take the worst action that a new threat asks for.

        Not on the ground: what is found there would no longer be new after the take-off.
        """
        if view.landed:
            return
        threats = self._monitor.update(view, self._params)
        for cause, action in reversed(threats):
            severity = Severity.WARNING if action is Action.WARN else Severity.CRITICAL
            self._say(view.now_us, severity, f"{TEXT_OF[cause]}: {action.name}")
        mode = mode_against(threats, self._mode, view)
        if mode is not None:
            self._mode = mode
            self._failsafe = True

    def _say(self, now_us: int, severity: Severity, text: str) -> None:
        self._texts.publish(StatusText(now_us, severity, text))

    def _publish(self, view: VehicleView) -> None:
        ready = arming_refusal(self._situation(view)) is None
        present = present_bits(view.ages)
        status = VehicleStatus(
            view.now_us,
            self._armed,
            self._mode,
            self._failsafe,
            ready,
            self._armed_since_us,
            present,
            present,
            healthy_bits(view, ready=ready),
        )
        old = self._status.value
        stale = old is None or view.now_us - old.time_us >= STATUS_PERIOD_US
        if old is None or stale or status[1:] != old[1:]:
            self._status.publish(status)
