"""A MAVLink module on an in-memory link, with topics of a vehicle and scripted peers."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from uav_firmware.cal.link import Address, Link
from uav_firmware.cal.storage import Storage
from uav_firmware.modules.mavlink.commands.preflight_commands import PowerAction
from uav_firmware.modules.mavlink.missions.plan_checks import PlanRules
from uav_firmware.modules.mavlink.module import MavlinkModule
from uav_firmware.modules.mavlink.telemetry.streams import LinkParams
from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack, parse
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.modules.mavlink.wire.reception import SigningOptions
from uav_firmware.modules.mavlink.wire.signature import Signer
from uav_firmware.modules.navigator.mission.review import PlanChecks
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
    WindEstimate,
)
from uav_firmware.msg.geofence import FenceAction, FenceBreach, GeofenceStatus
from uav_firmware.msg.guidance import OrbitStatus
from uav_firmware.msg.mission import MissionItem, MissionRejection, PlanReview, PlanType
from uav_firmware.msg.payload import (
    CameraLens,
    CameraMode,
    CameraStatus,
    Controller,
    GimbalStatus,
    ImageStatus,
    TrackingMode,
    TrackingState,
    TrackingStatus,
    VideoStream,
)
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorGps,
    SensorGround,
    SensorHygrometer,
    SensorImu,
    SensorRange,
    SensorTruth,
)
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import (
    HomePosition,
    LandDetected,
    LandedState,
    NavigationState,
    ParameterSaveResult,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

Check = Callable[[Sequence[MissionItem]], MissionRejection | None]

STEP_US = 4000
TICK_US = 20_000
GROUND: Address = ("192.0.2.2", 14550)
BROKER: Address = ("192.0.2.3", 14540)
UNKNOWN_PEER: Address = ("192.0.2.9", 50000)
SYSTEM = 7

LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M = 40.4434, -3.7382, 650.0
ZERO = (0.0, 0.0, 0.0)


def empty_topics() -> Topics:
    """Topics on which nothing has been published."""
    return Topics()


def status(
    state: NavigationState = NavigationState.AUTO_LOITER,
    *,
    armed: bool = False,
    failsafe: bool = False,
    ready: bool = True,
) -> VehicleStatus:
    """A vehicle's status with every sensor present and healthy."""
    bits = 0b101111
    return VehicleStatus(
        time_us=0,
        armed=armed,
        navigation_state=state,
        failsafe=failsafe,
        preflight_checks_pass=ready,
        armed_since_us=0,
        sensors_present=bits,
        sensors_enabled=bits,
        sensors_health=bits,
    )


LOCAL = VehicleLocalPosition(
    time_us=0,
    position_ned=(3.0, 4.0, -10.0),
    velocity_ned=(1.0, -2.0, 0.5),
    acceleration_ned=ZERO,
    heading=math.radians(-90.0),
    origin_latitude_deg=LATITUDE_DEG,
    origin_longitude_deg=LONGITUDE_DEG,
    origin_altitude_amsl_m=ALTITUDE_M,
    horizontal_accuracy_m=0.5,
    vertical_accuracy_m=0.8,
    position_valid=True,
    altitude_valid=True,
    velocity_valid=True,
    heading_valid=True,
)


GIMBAL = GimbalStatus(
    time_us=0,
    pitch=math.radians(-30.0),
    yaw=math.radians(100.0),
    heading=math.radians(90.0),
    rate_pitch_yaw=(0.1, 0.2),
    heading_rate=0.05,
    yaw_locked=False,
    neutral=False,
    primary=Controller(255, 190),
    secondary=Controller(0, 0),
    pitch_range=(math.radians(-90.0), math.radians(30.0)),
)
CAMERA = CameraStatus(
    time_us=0,
    mode=CameraMode.IMAGE,
    image_status=ImageStatus.IDLE,
    image_interval_s=0.0,
    image_count=3,
    recording_since_us=-1,
    report_interval_us=0,
    total_mib=1000.0,
    used_mib=250.0,
    stream=VideoStream(
        "http://127.0.0.1:14581/stream", running=True, rate_hz=4.0, width_px=480, height_px=360
    ),
)
TRACKING = TrackingState(
    time_us=0,
    status=TrackingStatus.ACTIVE,
    mode=TrackingMode.RECTANGLE,
    centre=(0.5, 0.6),
    extent=(0.1, 0.2),
    latitude_deg=LATITUDE_DEG,
    longitude_deg=LONGITUDE_DEG,
    altitude_amsl_m=ALTITUDE_M,
    velocity_ned=ZERO,
    distance_m=12.0,
    heading=math.nan,
)


def flying_topics() -> Topics:
    """Topics of a vehicle in the air, 10 m above home."""
    topics = empty_topics()
    topics.vehicle_attitude.publish(VehicleAttitude(0, (0.5, 0.5, 0.5, 0.5), (0.1, 0.2, 0.3)))
    topics.vehicle_local_position.publish(LOCAL)
    topics.vehicle_global_position.publish(
        VehicleGlobalPosition(0, LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M + 10.0, 0.5, 0.8)
    )
    topics.estimator_status.publish(
        EstimatorStatus(0, 831, 0.1, 0.2, 0.3, 0.4, 0.5, 0.8, ZERO, aligned=True)
    )
    topics.sensor_gps.publish(
        SensorGps(
            time_us=0,
            time_utc_us=0,
            latitude_deg=LATITUDE_DEG,
            longitude_deg=LONGITUDE_DEG,
            altitude_amsl_m=ALTITUDE_M + 10.0,
            velocity_ned=(1.0, -2.0, 0.5),
            horizontal_accuracy_m=0.9,
            vertical_accuracy_m=1.4,
            speed_accuracy_m_s=0.2,
            fix_type=3,
            satellites_used=14,
            hdop=0.7,
            vdop=1.1,
            altitude_ellipsoid_m=ALTITUDE_M + 61.6,
        )
    )
    topics.sensor_imu.publish(SensorImu(0, ZERO, (0.0, 0.0, -9.81)))
    topics.sensor_baro.publish(SensorBaro(0, 93_000.0, 21.5))
    topics.sensor_range.publish(SensorRange(0, 10.0, 0.1, 40.0))
    topics.sensor_hygrometer.publish(SensorHygrometer(4_900_000, 21.37, 54.32))
    topics.sensor_ground.publish(SensorGround(4_900_000, 0.23, 17.5, 65_000.0))
    topics.battery_status.publish(BatteryStatus(0, 11.8, 14.5, 1.2, 5.0, 0.76))
    topics.vehicle_status.publish(status(armed=True))
    topics.land_detected.publish(
        LandDetected(
            0,
            landed=False,
            ground_contact=False,
            landed_state=LandedState.IN_AIR,
            has_low_throttle=False,
        )
    )
    topics.home_position.publish(
        HomePosition(0, LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M, ZERO, 0.0)
    )
    topics.trajectory_setpoint.publish(
        TrajectorySetpoint(0, (3.0, 8.0, -10.0), (math.nan,) * 3, (math.nan,) * 3, 0.0, math.nan)
    )
    topics.vehicle_attitude_setpoint.publish(
        VehicleAttitudeSetpoint(0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.3)
    )
    topics.vehicle_rates_setpoint.publish(VehicleRatesSetpoint(0, (0.1, -0.2, 0.3), 0.3))
    topics.orbit_status.publish(
        OrbitStatus(
            0,
            active=True,
            radius_m=-10.0,
            latitude_deg=LATITUDE_DEG,
            longitude_deg=LONGITUDE_DEG,
            altitude_amsl_m=ALTITUDE_M + 10.0,
            speed_m_s=3.0,
            turned=1.0,
        )
    )
    topics.gimbal_status.publish(GIMBAL)
    topics.camera_lens.publish(CameraLens(4.5, 6.3, 4.725, 2048, 1536))
    topics.camera_status.publish(CAMERA)
    topics.tracking_state.publish(TRACKING)
    topics.geofence_status.publish(
        GeofenceStatus(0, FenceBreach.NONE, FenceBreach.NONE, FenceAction.HOLD, 12.0, 0, 0)
    )
    topics.wind.publish(WindEstimate(0, 3.0, -4.0))
    topics.actuator_motors.publish(ActuatorMotors(0, (0.5, 0.5, 0.5, 0.5)))
    topics.sensor_truth.publish(
        SensorTruth(
            time_us=0,
            latitude_deg=LATITUDE_DEG,
            longitude_deg=LONGITUDE_DEG,
            altitude_amsl_m=ALTITUDE_M + 10.0,
            velocity_ned=(1.0, -2.0, 0.5),
            q_ned_frd=(1.0, 0.0, 0.0, 0.0),
            rate_frd=ZERO,
            acceleration_frd=(0.0, 0.0, -9.81),
            airspeed_m_s=2.2,
        )
    )
    return topics


Review = Callable[[Sequence[MissionItem]], PlanReview]


def rules_of(check: Check) -> dict[PlanType, PlanRules]:
    """Accept every item, and the stored plans that a function accepts."""
    return dict.fromkeys(
        PlanType, PlanRules(lambda _item, _home: None, lambda items, _: check(items))
    )


def accept_all(_items: Sequence[MissionItem]) -> None:
    """Accept every plan."""


def reviewing(check: Check) -> Review:
    """Check a plan in one call."""

    def review(items: Sequence[MissionItem]) -> PlanReview:
        yield 1
        return check(items)

    return review


class MemoryLink:
    """Datagrams in lists."""

    def __init__(self) -> None:
        self.incoming: list[tuple[bytes, Address]] = []
        self.sent: list[tuple[bytes, Address]] = []
        self.unreachable: set[Address] = set()  # Addresses that refuse datagrams
        self._refused: set[Address] = set()

    def receive(self) -> list[tuple[bytes, Address]]:
        arrived, self.incoming = self.incoming, []
        return arrived

    def send(self, datagram: bytes, address: Address) -> None:
        self.sent.append((datagram, address))
        if address in self.unreachable:
            self._refused.add(address)

    def refused_addresses(self) -> list[Address]:
        refused, self._refused = list(self._refused), set()
        return refused

    def close(self) -> None:
        pass


class MavlinkHarness:
    """Sends messages as a peer, advances time, returns received messages."""

    def __init__(
        self,
        *,
        topics: Topics | None = None,
        registry: Registry | None = None,
        check: Check = accept_all,
        review: Review | None = None,
        save: Callable[[], None] = lambda: None,
        link: Link | None = None,
        params: LinkParams | None = None,
        power: Callable[[PowerAction], None] | None = None,
        storage: Storage | None = None,
        peers: Sequence[Peer] | None = None,
        signing: SigningOptions | None = None,
    ) -> None:
        self.topics = topics or flying_topics()
        self.registry = registry or Registry()
        self.memory = MemoryLink()
        self.now_us = 0
        self.module = MavlinkModule(
            link=link or self.memory,
            system_id=SYSTEM,
            registry=self.registry,
            topics=self.topics,
            plan_rules=rules_of(check),
            storage=storage,
            peers=peers
            or (
                Peer(address=GROUND, profile=Profile.GROUND_STATION),
                Peer(address=BROKER, profile=Profile.ONBOARD),
            ),
            signing=signing,
            boot_time_utc_us=1_700_000_000_000_000,
            params=params,
            request_power=power,
        )
        self._save = save
        self._sequence = 0
        self._navigator = PlanChecks(
            self.topics.plan_check_request,
            self.topics.plan_check_result,
            lambda _type, items: (review or reviewing(check))(items),
        )

    def send(
        self,
        message: Any,
        *,
        source: Address = GROUND,
        system: int = 255,
        component: int = 190,
        sequence: int | None = None,
        signer: Signer | None = None,
    ) -> None:
        """Queue a message with the next sequence number; it is read in the next step."""
        self._sequence = (self._sequence + 1) & 0xFF
        number = self._sequence if sequence is None else sequence
        datagram = frame(pack(message), number, system, component, signed=signer is not None)
        if signer is not None:
            datagram = signer.sign(datagram, 0)
        self.memory.incoming.append((datagram, source))

    def run(self, duration_us: int = TICK_US) -> None:
        """Advance vehicle time in control steps."""
        end_us = self.now_us + duration_us
        while self.now_us < end_us:
            self.now_us += STEP_US
            self.module.serve(self.now_us)
            if self.topics.plan_check_request or self.now_us % TICK_US == 0:
                self._navigator.update()
            self._serve_save_requests()
            self.module.resume(self.now_us)
            self.module.update(self.now_us)

    def _serve_save_requests(self) -> None:
        """Answer as the parameter storage does; an OSError of `save` is a failure."""
        for request in self.topics.parameter_save_request.drain():
            fault = ""
            try:
                self._save()
            except OSError as error:
                fault = error.strerror or str(error)
            self.topics.parameter_save_result.publish(
                ParameterSaveResult(request.request_id, fault)
            )

    def received(
        self, name: str | None = None, *, at: Address = GROUND, component: int = 1
    ) -> list[Any]:
        """Messages sent to a peer since the last call, of one type if a name is given.

        Of the autopilot, unless another component is given.
        """
        matching = [sent for sent in self.memory.sent if sent[1] == at and sent[0][6] == component]
        self.memory.sent = [
            sent for sent in self.memory.sent if sent[1] != at or sent[0][6] != component
        ]
        received = [m for data, _ in matching for m in parse(data).messages]
        return [m for m in received if name is None or m.get_type() == name]

    def request(self, message: Any, answer: str, **sender: Any) -> list[Any]:
        """Send a message, run one tick, and return the answers of one type."""
        source = sender.get("source", GROUND)
        self.received(at=source)
        self.send(message, **sender)
        self.run()
        return self.received(answer, at=source)

    def commands(self) -> list[VehicleCommand]:
        """Commands that reached the commander since the last call."""
        return self.topics.vehicle_command.drain()

    def answer(self, command: VehicleCommand, result: int, progress: int = 0) -> None:
        """Answer a command as the commander does."""
        self.topics.vehicle_command_ack.publish(
            VehicleCommandAck(self.now_us, command.command, result, progress, command.token)
        )


def command_long(number: int, *parameters: float, **header: int) -> Any:
    """COMMAND_LONG with missing parameters 0."""
    p = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(
        header.get("target_system", SYSTEM),
        header.get("target_component", 1),
        number,
        header.get("confirmation", 0),
        *p,
    )


def command_int(number: int, *parameters: float, frame: int = 0, **header: int) -> Any:
    """COMMAND_INT with missing parameters 0; parameters 5 and 6 are integers."""
    p = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_int_message(
        header.get("target_system", SYSTEM),
        header.get("target_component", 1),
        frame,
        number,
        0,
        0,
        *p[:4],
        int(p[4]),
        int(p[5]),
        p[6],
    )


def mission_item(seq: int, command: int = 16, **fields: Any) -> Any:
    """MISSION_ITEM_INT: a waypoint at 10 m above home by default."""
    values: dict[str, Any] = {
        "target_system": SYSTEM,
        "target_component": 1,
        "seq": seq,
        "frame": 6,
        "command": command,
        "current": int(seq == 0),
        "autocontinue": 1,
        "param1": 0.0,
        "param2": 0.0,
        "param3": 0.0,
        "param4": math.nan,
        "x": 404_434_000 + seq,
        "y": -37_382_000 - seq,
        "z": 10.0,
        "mission_type": 0,
    }
    return mavlink.MAVLink_mission_item_int_message(**{**values, **fields})


def mission_count(count: int, mission_type: int = 0) -> Any:
    return mavlink.MAVLink_mission_count_message(SYSTEM, 1, count, mission_type)
