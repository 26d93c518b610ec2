"""The MAVLink module: translates between datagrams and topics."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from uav_firmware.cal.files import Card
from uav_firmware.cal.link import Address, Link
from uav_firmware.cal.storage import Storage
from uav_firmware.modules.mavlink.commands.preflight_commands import PowerAction
from uav_firmware.modules.mavlink.dispatcher import Dispatcher
from uav_firmware.modules.mavlink.missions.plan_checks import RULES, PlanChecker, PlanRules
from uav_firmware.modules.mavlink.telemetry.changes import ChangeDetector, ReachedReporter
from uav_firmware.modules.mavlink.telemetry.context import BatteryThresholds, Context
from uav_firmware.modules.mavlink.telemetry.sensors import VibrationMeter
from uav_firmware.modules.mavlink.telemetry.streams import LinkParams, default_intervals_us
from uav_firmware.modules.mavlink.transmitter import Transmitter
from uav_firmware.modules.mavlink.wire.addressing import OWN_COMPONENTS, Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, parse
from uav_firmware.modules.mavlink.wire.peers import Peer, PeerTable
from uav_firmware.modules.mavlink.wire.reception import Reception, SigningOptions
from uav_firmware.modules.mavlink.wire.signing_setup import SigningSetup
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.mission import PlanType
from uav_firmware.parameters import Registry, UnknownParameterError
from uav_firmware.topics import Topics

READS: Final = (
    "sensor_imu", "sensor_baro", "sensor_mag", "sensor_gps", "battery_status", "sensor_hygrometer",
    "sensor_ground", "sensor_range", "sensor_truth", "vehicle_attitude", "vehicle_local_position",
    "vehicle_global_position", "estimator_status", "wind", "vehicle_status", "land_detected",
    "home_position", "mission", "mission_progress", "plan_check_result", "geofence_status",
    "orbit_status", "camera_event", "camera_status", "camera_lens", "gimbal_status",
    "tracking_state", "trajectory_setpoint", "vehicle_attitude_setpoint", "vehicle_rates_setpoint",
    "actuator_motors", "log_stream", "parameter_save_result", "vehicle_command_ack", "status_text",
)  # fmt: skip
WRITES: Final = (
    "mission", "plan_check_request", "manual_control_setpoint", "offboard_setpoint", "fence",
    "rally_points", "follow_target", "payload_order", "ground_station_heartbeat",
    "log_stream_request", "refused_frames", "parameter_save_request", "vehicle_command",
    "status_text",
)  # fmt: skip
MAX_MESSAGES_PER_CALL: Final = 128
"""Messages beyond this are dropped, which bounds the work of a step during a flood."""
_TICK_US: Final = 20_000
"""50 Hz, the rate of the commander."""
_HOUSEKEEPING_US: Final = 1_000_000


class MavlinkModule:
    """Serves MAVLink for the vehicle's autopilot and camera component.

    `serve`, `resume` and `update` are called 125 times a second; after the first, the navigator
    checks plans and the parameter storage starts to save. All but the last may be called in
    between, whenever a datagram has arrived, so that a transfer is not slowed to one message per
    step.
    """

    def __init__(
        self,
        *,
        link: Link,
        system_id: int,
        registry: Registry,
        topics: Topics,
        peers: Sequence[Peer],
        storage: Storage | None = None,
        boot_time_utc_us: int = 0,
        params: LinkParams | None = None,
        card: Card | None = None,
        request_power: Callable[[PowerAction], None] | None = None,
        signing: SigningOptions | None = None,
        plan_rules: Mapping[PlanType, PlanRules] = RULES,
    ) -> None:
        """Open channels to the configured peers.

        Args:
            link: Carries the datagrams.
            system_id: MAVLink system id of the vehicle, 1 to 250.
            registry: The vehicle's parameters.
            topics: Connections to the bus.
            peers: Configured peers, which get telemetry from the start.
            storage: Stores plans across restarts; without one they are lost at exit.
            boot_time_utc_us: World time at vehicle time zero [us since 1970]; 0 unknown.
            params: Modes of the links; PX4's defaults if not given.
            request_power: Called when a peer reboots the vehicle or shuts it down.
            card: Files and logs; without one only the parameters are served as files.
            signing: Clock, storage and setup of signatures.
            plan_rules: Which items and stored plans are accepted, by type of plan.

        Raises:
            ValueError: if the system id is outside 1..250, or a peer's key is invalid.
            SigningStoreError: if the stored state of the signatures is invalid.
        """
        if not 1 <= system_id <= 250:
            raise ValueError(f"system_id: {system_id} is outside 1..250")
        self._link = link
        self._system_id = system_id
        self._own = {(system_id, component) for component in OWN_COMPONENTS}
        self._registry = registry
        self._topics = topics
        self._boot_time_utc_us = boot_time_utc_us
        self._peers = PeerTable(peers, default_intervals_us(params or LinkParams()))
        self._transmitter = Transmitter(link, system_id, self._peers)
        self._changes = ChangeDetector(topics)
        self._texts = StatusTexts()
        options = signing or SigningOptions()
        self._reception = Reception(
            options,
            registry=registry,
            configured=peers,
            peers=self._peers,
            topics=topics,
        )
        self.refused = self._reception.refused
        self._signing_setup = SigningSetup(
            system_id=system_id,
            trust=options.setup,
            security=self._reception.security,
            store=self._reception.store,
            clock=self._reception.clock,
            vehicle_status=topics.vehicle_status,
            texts=self._texts,
        )
        self._reached = ReachedReporter()
        self._vibration = VibrationMeter()
        self._dispatcher = Dispatcher(
            system_id=system_id,
            registry=registry,
            topics=topics,
            peers=self._peers,
            checker=PlanChecker(
                topics.plan_check_request,
                topics.plan_check_result,
                home=lambda: topics.home_position.value,
                registry=registry,
                rules=plan_rules,
            ),
            storage=storage,
            context=self._context,
            texts=self._texts,
            card=card,
            request_power=request_power,
            set_up_signing=self._signing_setup.handle,
        )
        self._battery_thresholds = BatteryThresholds(0.0, 0.0, 0.0)
        self._parameter_version = -1
        self._tick_us = 0
        self._housekeeping_us = 0

    def update(self, now_us: int) -> None:
        """Send everything that is due at `now_us` [us since boot]."""
        if now_us >= self._tick_us:
            self._tick_us = now_us + _TICK_US
            self._tick(now_us)
        self._transmitter.send(self._dispatcher.tick_logs(now_us))
        if self._peers.is_any_due(now_us):
            self._transmitter.stream(self._context(now_us))

    def shortest_interval_us(self, now_us: int) -> int:
        """Shortest interval [us] of a stream to an active peer; one second without one."""
        return self._peers.shortest_interval_us(now_us)

    def serve(self, now_us: int) -> None:
        """Process the received datagrams, up to `MAX_MESSAGES_PER_CALL` messages."""
        taken = 0
        for datagram, address in self._link.receive():
            left = MAX_MESSAGES_PER_CALL - taken
            if left <= 0:
                self.refused.flood += 1
                continue
            parsed = parse(datagram)
            self.refused.flood += len(parsed.messages) > left
            self.refused.malformed += parsed.faults
            taken += len(parsed.messages) + parsed.faults
            for message in parsed.messages[:left]:
                self._handle_message(message, address, now_us)

    def resume(self, now_us: int) -> None:
        """Continue with what the navigator and the parameter storage have answered."""
        self._transmitter.send(self._dispatcher.resume(now_us))

    def _handle_message(self, message: Message, address: Address, now_us: int) -> None:
        """Serve one message if it is admitted."""
        sender = Sender(message.get_srcSystem(), message.get_srcComponent(), address)
        if sender.identity in self._own:
            return  # Returned by a router, which must not become a peer
        if self._reception.admit(message, address, now_us) is None:
            return
        self._transmitter.send(self._dispatcher.handle(message, sender, now_us))

    def _tick(self, now_us: int) -> None:
        """Send answers, retries and changes at 50 Hz."""
        self._transmitter.send(self._due(now_us))
        changed = self._changes.take()
        if changed:
            self._transmitter.broadcast(changed, self._context(now_us))
        self._vibration.update(self._topics.sensor_imu.value, now_us)
        self._reception.tick()
        if now_us >= self._housekeeping_us:
            self._housekeeping_us = now_us + _HOUSEKEEPING_US
            self._peers.note_unreachable(self._link.refused_addresses(), now_us)
            self._dispatcher.drop_peers(self._peers.close_timed_out(now_us))
            self._reception.report(now_us)

    def _due(self, now_us: int) -> list[Outgoing]:
        """Protocol messages due now: answers, retries, status texts."""
        outgoing = self._dispatcher.tick(now_us)
        outgoing += self._signing_setup.tick()
        outgoing += self._reached.tick(self._topics.mission_progress.value, now_us)
        for text in self._topics.status_text.drain():
            outgoing += self._texts.encode(text.severity, text.text)
        return outgoing

    def _context(self, now_us: int) -> Context:
        if self._registry.version != self._parameter_version:
            self._parameter_version = self._registry.version
            self._battery_thresholds = BatteryThresholds(
                low=self._threshold("BAT_LOW_THR", 0.15),
                critical=self._threshold("BAT_CRIT_THR", 0.07),
                emergency=self._threshold("BAT_EMERGEN_THR", 0.05),
            )
        return Context(
            topics=self._topics,
            now_us=now_us,
            boot_time_utc_us=self._boot_time_utc_us,
            system_id=self._system_id,
            battery_thresholds=self._battery_thresholds,
            vibration_frd=self._vibration.level_frd,
        )

    def _threshold(self, name: str, default: float) -> float:
        """A battery threshold of the commander, or PX4's default if it is not declared."""
        try:
            return self._registry.get(name)
        except UnknownParameterError:
            return default
