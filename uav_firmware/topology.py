"""The vehicle on one page: modules, their connections, rates and order."""

from collections.abc import Callable, Sequence
from typing import Final

from uav_firmware.cal.camera import CameraCarrier
from uav_firmware.cal.faults import FaultInjector
from uav_firmware.cal.files import Card
from uav_firmware.cal.link import Link
from uav_firmware.cal.log_store import LogStore
from uav_firmware.cal.storage import Storage
from uav_firmware.cal.vehicle import Vehicle
from uav_firmware.module_errors import ModuleErrors
from uav_firmware.modules.attitude_control.module import AttitudeControlModule
from uav_firmware.modules.attitude_control.params import AttitudeControlParams
from uav_firmware.modules.battery.module import BatteryModule
from uav_firmware.modules.commander.module import CommanderModule
from uav_firmware.modules.console.module import ConsoleModule
from uav_firmware.modules.control_allocator.module import ControlAllocatorModule
from uav_firmware.modules.control_allocator.params import ControlAllocatorParams
from uav_firmware.modules.estimator.module import EstimatorModule
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.modules.failure_detector.module import FailureDetectorModule
from uav_firmware.modules.land_detector.module import LandDetectorModule
from uav_firmware.modules.land_detector.params import LandDetectorParams
from uav_firmware.modules.logger.definitions import Identity
from uav_firmware.modules.logger.module import LoggerModule
from uav_firmware.modules.logger.params import LoggerParams
from uav_firmware.modules.manual_control.module import ManualControlModule
from uav_firmware.modules.manual_control.params import ManualControlParams
from uav_firmware.modules.mavlink.commands.preflight_commands import PowerAction
from uav_firmware.modules.mavlink.commands.vehicle_facts import vehicle_facts
from uav_firmware.modules.mavlink.files.service import IMAGES_URL
from uav_firmware.modules.mavlink.module import MavlinkModule
from uav_firmware.modules.mavlink.telemetry.link import FLIGHT_SW_VERSION
from uav_firmware.modules.mavlink.telemetry.streams import LinkParams
from uav_firmware.modules.mavlink.wire.link_security import SigningParams
from uav_firmware.modules.mavlink.wire.peers import Peer
from uav_firmware.modules.mavlink.wire.reception import SigningOptions
from uav_firmware.modules.mavlink.wire.signing_setup import SetupTrust
from uav_firmware.modules.navigator.module import NavigatorModule
from uav_firmware.modules.offboard.module import OffboardModule
from uav_firmware.modules.parameter_storage.module import ParameterStorageModule
from uav_firmware.modules.payload.module import PERIOD_US as PAYLOAD_PERIOD_US
from uav_firmware.modules.payload.module import PayloadModule
from uav_firmware.modules.position_control.module import PositionControlModule
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.modules.rate_control.module import RateControlModule
from uav_firmware.modules.rate_control.params import RateControlParams
from uav_firmware.modules.rotor_loss_control.module import RotorLossControlModule
from uav_firmware.modules.sensors.module import SensorsModule
from uav_firmware.modules.vehicle_io.module import VehicleIoModule
from uav_firmware.msg.control_mode import ControlSource
from uav_firmware.parameters import Registry
from uav_firmware.scheduler import RateGroup, Scheduler
from uav_firmware.topics import Topics

_POSITION_PERIOD_US: Final = 16_000  # 62.5 Hz: navigator and position control
_SLOW_PERIOD_US: Final = 20_000  # 50 Hz: commander, land detector
_LINK_PERIOD_US: Final = 8_000  # 125 Hz; a paced vehicle also answers datagrams while it waits
_FAILURE_PERIOD_US: Final = 8_000  # 125 Hz, as often as the speed controllers report
_BATTERY_PERIOD_US: Final = 100_000  # 10 Hz, as often as the power monitor measures
_CONSOLE_PERIOD_US: Final = 100_000  # 10 Hz
_STORAGE_PERIOD_US: Final = 1_000_000  # 1 Hz

_HARDWARE: Final = "vehicle_io"
_LINK: Final = "mavlink"
_NAVIGATOR: Final = "navigator"
_PARAMETERS: Final = "parameter_storage"

_PILOTED_BATCH_US: Final = 20_000  # Under sticks or streamed setpoints
_TELEMETRY_BATCH_US: Final = 40_000  # However fast the requested telemetry

_PARAMETER_GROUPS: Final = (
    EstimatorParams,
    LandDetectorParams,
    PositionControlParams,
    AttitudeControlParams,
    RateControlParams,
    ControlAllocatorParams,
    LoggerParams,
    ManualControlParams,
    LinkParams,
    SigningParams,
)


class Autopilot:
    """The whole flight stack on one vehicle; `scheduler.step` runs one control step."""

    def __init__(
        self,
        vehicle: Vehicle,
        link: Link,
        storage: Storage,
        *,
        system_id: int,
        peers: Sequence[Peer],
        boot_time_utc_us: int,
        write_line: Callable[[int, str], None],
        log_store: LogStore | None = None,
        card: Card | None = None,
        request_power: Callable[[PowerAction], None] | None = None,
        world_us: Callable[[], int] | None = None,
        setup_signing: SetupTrust = SetupTrust.NEVER,
        on_error: Callable[[str, Exception], None] | None = None,
    ) -> None:
        """Connect the modules; `on_error` receives their errors, which are reported without it."""
        self.vehicle = vehicle
        self.topics = topics = Topics()
        self.registry = registry = Registry()
        for group in _PARAMETER_GROUPS:
            registry.add(group)
        registry.declare(vehicle_facts(system_id, vehicle.fitted.compasses))
        self.vehicle_io = VehicleIoModule(
            vehicle,
            motors=topics.actuator_motors,
            imus=topics.sensor_imus,
            baros=topics.sensor_baros,
            mags=topics.sensor_mags,
            gps=topics.sensor_gps,
            battery=topics.sensor_battery,
            esc=topics.sensor_esc,
            range_finder=topics.sensor_range,
            hygrometer=topics.sensor_hygrometer,
            ground=topics.sensor_ground,
            truth=topics.sensor_truth,
        )
        self.battery = BatteryModule(
            registry,
            sensor_battery=topics.sensor_battery,
            battery_status=topics.battery_status,
        )
        self.sensors = SensorsModule(
            registry,
            imus=topics.sensor_imus,
            baros=topics.sensor_baros,
            mags=topics.sensor_mags,
            attitude=topics.vehicle_attitude,
            local_position=topics.vehicle_local_position,
            estimator_status=topics.estimator_status,
            imu=topics.sensor_imu,
            baro=topics.sensor_baro,
            mag=topics.sensor_mag,
            imu_shift=topics.imu_shift,
            sensors_status=topics.sensors_status,
            status_text=topics.status_text,
        )
        self.estimator = EstimatorModule(
            imu=topics.sensor_imu,
            baro=topics.sensor_baro,
            mag=topics.sensor_mag,
            gps=topics.sensor_gps,
            attitude=topics.vehicle_attitude,
            local_position=topics.vehicle_local_position,
            global_position=topics.vehicle_global_position,
            estimator_status=topics.estimator_status,
            landed=topics.land_detected,
            imu_shift=topics.imu_shift,
            sensors_status=topics.sensors_status,
            torque_thrust=topics.vehicle_torque_thrust_setpoint,
            registry=registry,
        )
        self.navigator = NavigatorModule(registry, topics)
        self.commander = CommanderModule(
            registry,
            topics,
            inject=_injection_of(vehicle),
        )
        self.manual_control = ManualControlModule(
            registry,
            manual_control_setpoint=topics.manual_control_setpoint,
            vehicle_control_mode=topics.vehicle_control_mode,
            vehicle_status=topics.vehicle_status,
            vehicle_local_position=topics.vehicle_local_position,
            land_detected=topics.land_detected,
            home_position=topics.home_position,
            terrain_estimate=topics.terrain_estimate,
            trajectory_setpoint=topics.trajectory_setpoint,
            vehicle_attitude_setpoint=topics.vehicle_attitude_setpoint,
            vehicle_rates_setpoint=topics.vehicle_rates_setpoint,
        )
        self.offboard = OffboardModule(
            registry,
            offboard_setpoint=topics.offboard_setpoint,
            vehicle_control_mode=topics.vehicle_control_mode,
            vehicle_status=topics.vehicle_status,
            vehicle_local_position=topics.vehicle_local_position,
            land_detected=topics.land_detected,
            trajectory_setpoint=topics.trajectory_setpoint,
            vehicle_attitude_setpoint=topics.vehicle_attitude_setpoint,
            vehicle_rates_setpoint=topics.vehicle_rates_setpoint,
        )
        self.land_detector = LandDetectorModule(
            attitude=topics.vehicle_attitude,
            local_position=topics.vehicle_local_position,
            torque_thrust=topics.vehicle_torque_thrust_setpoint,
            trajectory=topics.trajectory_setpoint,
            vehicle_status=topics.vehicle_status,
            land_detected=topics.land_detected,
            vehicle_control_mode=topics.vehicle_control_mode,
            hover_thrust_estimate=topics.hover_thrust_estimate,
            range_finder=topics.sensor_range,
            terrain_estimate=topics.terrain_estimate,
            registry=registry,
        )
        self.position_control = PositionControlModule(
            trajectory=topics.trajectory_setpoint,
            local_position=topics.vehicle_local_position,
            vehicle_status=topics.vehicle_status,
            land_detected=topics.land_detected,
            attitude_setpoint=topics.vehicle_attitude_setpoint,
            vehicle_control_mode=topics.vehicle_control_mode,
            hover_thrust_estimate=topics.hover_thrust_estimate,
            registry=registry,
        )
        self.attitude_control = AttitudeControlModule(
            attitude=topics.vehicle_attitude,
            attitude_setpoint=topics.vehicle_attitude_setpoint,
            rates_setpoint=topics.vehicle_rates_setpoint,
            vehicle_control_mode=topics.vehicle_control_mode,
            registry=registry,
        )
        self.rate_control = RateControlModule(
            attitude=topics.vehicle_attitude,
            rates_setpoint=topics.vehicle_rates_setpoint,
            allocator_status=topics.control_allocator_status,
            torque_thrust=topics.vehicle_torque_thrust_setpoint,
            registry=registry,
        )
        self.failure_detector = FailureDetectorModule(
            registry,
            motors=topics.actuator_motors,
            esc=topics.sensor_esc,
            imu=topics.sensor_imu,
            baro=topics.sensor_baro,
            attitude=topics.vehicle_attitude,
            attitude_setpoint=topics.vehicle_attitude_setpoint,
            torque_thrust=topics.vehicle_torque_thrust_setpoint,
            hover_thrust_estimate=topics.hover_thrust_estimate,
            land_detected=topics.land_detected,
            vehicle_control_mode=topics.vehicle_control_mode,
            vehicle_status=topics.vehicle_status,
            sensors_status=topics.sensors_status,
            failure_status=topics.failure_detector_status,
            status_text=topics.status_text,
        )
        self.rotor_loss_control = RotorLossControlModule(
            registry,
            attitude=topics.vehicle_attitude,
            attitude_setpoint=topics.vehicle_attitude_setpoint,
            local_position=topics.vehicle_local_position,
            trajectory=topics.trajectory_setpoint,
            failure_status=topics.failure_detector_status,
            rotor_loss_thrust=topics.rotor_loss_thrust,
        )
        self.control_allocator = ControlAllocatorModule(
            torque_thrust=topics.vehicle_torque_thrust_setpoint,
            vehicle_status=topics.vehicle_status,
            motors=topics.actuator_motors,
            rotor_loss_thrust=topics.rotor_loss_thrust,
            allocator_status=topics.control_allocator_status,
            status_text=topics.status_text,
            registry=registry,
        )
        self.payload = PayloadModule(
            registry,
            system_id=system_id,
            boot_time_utc_us=boot_time_utc_us,
            orders=topics.payload_order,
            region_of_interest=topics.region_of_interest,
            attitude=topics.vehicle_attitude,
            local_position=topics.vehicle_local_position,
            home=topics.home_position,
            vehicle_status=topics.vehicle_status,
            trajectory_setpoint=topics.trajectory_setpoint,
            command_ack=topics.vehicle_command_ack,
            status_text=topics.status_text,
            camera_event=topics.camera_event,
            camera_status=topics.camera_status,
            camera_lens=topics.camera_lens,
            gimbal_status=topics.gimbal_status,
            tracking_state=topics.tracking_state,
            device=vehicle.camera if isinstance(vehicle, CameraCarrier) else None,
            recorder=vehicle.recorder if isinstance(vehicle, CameraCarrier) else None,
            seeker=vehicle.seeker if isinstance(vehicle, CameraCarrier) else None,
            streamer=vehicle.streamer if isinstance(vehicle, CameraCarrier) else None,
            images_url=IMAGES_URL,
        )
        # Behind all that declare parameters: a stored value without a declaration is dropped
        self.parameter_storage = ParameterStorageModule(
            storage,
            registry=registry,
            save_request=topics.parameter_save_request,
            save_result=topics.parameter_save_result,
            status_text=topics.status_text,
            time_us=self._time_us,
        )
        self.mavlink = MavlinkModule(
            link=link,
            system_id=system_id,
            registry=registry,
            topics=topics,
            storage=storage,
            peers=peers,
            boot_time_utc_us=boot_time_utc_us,
            params=registry.read(LinkParams),
            card=card,
            request_power=request_power,
            signing=SigningOptions(
                world_us=world_us or (lambda: boot_time_utc_us + vehicle.time_us),
                storage=storage,
                setup=setup_signing,
            ),
        )
        self.console = ConsoleModule(
            write_line,
            status_text=topics.status_text.second,
            vehicle_status=topics.vehicle_status,
            land_detected=topics.land_detected,
            mission_progress=topics.mission_progress,
            time_us=self._time_us,
        )
        self.logger = LoggerModule(
            log_store,
            topics=topics,
            registry=registry,
            identity=Identity(system_id, FLIGHT_SW_VERSION),
            boot_time_utc_us=boot_time_utc_us,
            step_us=vehicle.step_us,
            time_us=self._time_us,
        )
        errors = ModuleErrors(topics, write_line=write_line, time_us=self._time_us)
        self._on_error = errors.report if on_error is None else on_error
        self._serving: tuple[tuple[str, Callable[[], None]], ...] = (
            (_LINK, lambda: self.mavlink.serve(self.vehicle.time_us)),
            (_NAVIGATOR, self.navigator.check_plans),
            (_PARAMETERS, self.parameter_storage.serve_requests),
            (_LINK, lambda: self.mavlink.resume(self.vehicle.time_us)),
        )
        self.scheduler = Scheduler(
            vehicle.step_us, self._rate_groups(vehicle.step_us), self._take_error
        )

    def serve_link(self) -> None:
        """Answer what has arrived on the link, between two steps."""
        for module, serve in self._serving:
            try:
                serve()
            except Exception as error:  # noqa: BLE001  # as the scheduler's
                self._take_error(module, error)

    def _take_error(self, module: str, error: Exception) -> None:
        """Let the others go on without a module; without sensors and motors nothing can."""
        if module == _HARDWARE:
            raise error
        self._on_error(module, error)

    def is_command_pending(self) -> bool:
        """Whether a command of a peer waits for the next steps."""
        topics = self.topics
        queues = (topics.vehicle_command, topics.payload_order, topics.vehicle_command_ack)
        return any(len(queue) > 0 for queue in queues)

    def batch_us(self) -> int:
        """Longest vehicle time [us] that may run without a wait for the wall clock.

        Sticks and streamed setpoints take effect at once; otherwise the telemetry with the
        shortest interval is sent in time.
        """
        mode = self.topics.vehicle_control_mode.value
        if mode is not None and mode.source is not ControlSource.NAVIGATOR:
            return _PILOTED_BATCH_US
        return max(self.mavlink.shortest_interval_us(self._time_us()), _TELEMETRY_BATCH_US)

    def _time_us(self) -> int:
        return self.vehicle.time_us

    def _run_commander(self) -> None:
        """Answer commands, with the geofence's check of their targets, within one step."""
        self.commander.update(self.vehicle.time_us)
        while self.topics.target_check_request:
            try:
                self.navigator.check_targets()
            except Exception as error:  # noqa: BLE001  # as the scheduler's
                self._take_error(_NAVIGATOR, error)
                break
            self.commander.resume()
        self.commander.finish()

    def _run_mavlink(self) -> None:
        """Acknowledge a short plan in the step in which its last item has arrived."""
        self.serve_link()
        self.mavlink.update(self.vehicle.time_us)

    def _rate_groups(self, step_us: int) -> tuple[RateGroup, ...]:
        """Modules and their rates; within a step they run in this order, sensors to motors."""
        vehicle = self.vehicle
        return (
            RateGroup(_HARDWARE, step_us, self.vehicle_io.update),
            RateGroup("truth", _SLOW_PERIOD_US, self.vehicle_io.update_truth),
            RateGroup("sensors", step_us, self.sensors.update),
            RateGroup("estimator", step_us, self.estimator.update),
            RateGroup("battery", _BATTERY_PERIOD_US, self.battery.update, 2),
            RateGroup("land_detector", _SLOW_PERIOD_US, self.land_detector.update, 1),
            RateGroup("commander", _SLOW_PERIOD_US, self._run_commander),
            RateGroup(
                _NAVIGATOR, _POSITION_PERIOD_US, lambda: self.navigator.update(vehicle.time_us)
            ),
            RateGroup("manual_control", _POSITION_PERIOD_US, self.manual_control.update),
            RateGroup("offboard", _POSITION_PERIOD_US, self.offboard.update),
            RateGroup("position_control", _POSITION_PERIOD_US, self.position_control.update),
            RateGroup("attitude_control", step_us, self.attitude_control.update),
            RateGroup("rate_control", step_us, self.rate_control.update),
            RateGroup(
                "failure_detector",
                _FAILURE_PERIOD_US,
                lambda: self.failure_detector.update(vehicle.time_us),
            ),
            RateGroup("rotor_loss_control", step_us, self.rotor_loss_control.update),
            RateGroup(
                "control_allocator",
                step_us,
                lambda: self.control_allocator.update(vehicle.time_us),
            ),
            RateGroup(_LINK, _LINK_PERIOD_US, self._run_mavlink, 1),
            RateGroup(
                "payload",
                PAYLOAD_PERIOD_US,
                lambda: self.payload.update(vehicle.time_us),
                2,
            ),
            RateGroup("console", _CONSOLE_PERIOD_US, self.console.update, 3),
            RateGroup(_PARAMETERS, _STORAGE_PERIOD_US, self.parameter_storage.update, 4),
            RateGroup("logger", step_us, self.logger.update),
        )


def _injection_of(vehicle: Vehicle) -> Callable[[int, int, int], bool]:
    """Failure injection of the vehicle; refuses all failures where it has none."""
    if isinstance(vehicle, FaultInjector):
        return vehicle.inject
    return lambda _unit, _failure_type, _instance: False
