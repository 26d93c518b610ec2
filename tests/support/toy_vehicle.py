"""A kinematic vehicle under navigator and commander: no physics, no noise, flat ground.

It follows the set-point with a first-order lag, stands on the ground at home's height, and
publishes what estimator, sensors and land detector would.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.commander.module import CommanderModule
from uav_firmware.modules.commander.topics import CommanderTopics
from uav_firmware.modules.navigator.module import NavigatorModule
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.control_mode import (
    ManualControlSetpoint,
    OffboardSetpoint,
    VehicleControlMode,
)
from uav_firmware.msg.estimate import (
    AidSource,
    EstimateResets,
    EstimatorStatus,
    VehicleAttitude,
    VehicleLocalPosition,
    WindEstimate,
)
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import Fence, GeofenceStatus, RallyPoints
from uav_firmware.msg.guidance import FollowTarget, OrbitStatus
from uav_firmware.msg.mission import (
    Mission,
    MissionItem,
    MissionProgress,
    NavigatorRequest,
    NavigatorStatus,
)
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorGps,
    SensorImu,
    SensorMag,
    SensorRange,
)
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import (
    Command,
    HomePosition,
    LandDetected,
    LandedState,
    NavigationState,
    StatusText,
    StorageStatus,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

NAN = math.nan
HOME = (40.44340, -3.73820, 650.0)
STEP_US = 4_000


def item(seq: int, command: int, **fields: float) -> MissionItem:
    """Mission item at home's place unless told otherwise; altitude relative to home."""
    values = {f"param{n}": 0.0 for n in range(1, 5)} | {"x": 0.0, "y": 0.0, "z": 0.0} | fields
    frame = int(values.pop("frame", 3 if command < 90 and command != 20 else 2))
    return MissionItem(
        seq, command, frame, seq == 0, values.pop("autocontinue", 1.0) == 1.0, **values
    )


def at(north: float, east: float) -> dict[str, float]:
    """Latitude and longitude [deg] of a place about home [m], as fields of an item."""
    latitude, longitude, _ = LocalFrame(*HOME).to_geodetic((north, east, 0.0))
    return {"x": latitude, "y": longitude}


def waypoint(
    seq: int, north: float, east: float, height: float = 5.0, **fields: float
) -> MissionItem:
    """Waypoint with the nose along the path and an acceptance radius of 1 m."""
    wishes = {"param2": 1.0, "param4": NAN, "z": height, **at(north, east), **fields}
    return item(seq, 16, **wishes)


def takeoff(seq: float = 0, height: float = 5.0, **fields: float) -> MissionItem:
    """Take-off on the spot."""
    return item(int(seq), 22, **{"param4": NAN, "x": NAN, "y": NAN, "z": height, **fields})


@dataclass
class ToyVehicle:
    """Vehicle, navigator and commander on one set of topics."""

    lag_s: float = 0.15
    now_us: int = 0
    position: Vector3 = (0.0, 0.0, 0.0)
    velocity: Vector3 = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    position_valid: bool = True
    altitude_valid: bool = True
    dead_reckoning: bool = False
    aligned: bool = True
    battery: float = 1.0
    fix_type: int = 3
    gyro_broken: bool = False  # Biased beyond its limit
    gyro_jump_us: int | None = None
    imu_is_dead: bool = False  # It speaks, and holds no number
    satellites: int = 12
    accuracy: float = 0.1  # [m] Of the estimated position
    innovation: float = 0.0  # Test ratio of the GPS velocity
    drift: Vector3 = (0.0, 0.0, 0.0)  # [m/s] Of a vehicle that stands
    wind: Vector3 = (0.0, 0.0, 0.0)
    roll: float = 0.0
    resets: EstimateResets = field(default_factory=EstimateResets)
    stopped: AidSource = field(
        default_factory=lambda: AidSource(0)
    )  # Sources that the estimator does not use
    silent: set[str] = field(default_factory=set)  # Sensors that have failed
    registry: Registry = field(default_factory=Registry)
    track: list[Vector3] = field(default_factory=list)
    setpoints: list[TrajectorySetpoint] = field(default_factory=list)
    reached: list[int] = field(default_factory=list)
    acks: list[VehicleCommandAck] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.commands: Queue[VehicleCommand] = Queue()
        self.answers: Queue[VehicleCommandAck] = Queue()
        self.attitude: Topic[VehicleAttitude] = Topic()
        self.local_position: Topic[VehicleLocalPosition] = Topic()
        self.estimator: Topic[EstimatorStatus] = Topic()
        self.land: Topic[LandDetected] = Topic()
        self.progress: Topic[MissionProgress] = Topic()
        self.navigator_status: Topic[NavigatorStatus] = Topic()
        self.imu: Topic[SensorImu] = Topic()
        self.baro: Topic[SensorBaro] = Topic()
        self.mag: Topic[SensorMag] = Topic()
        self.gps: Topic[SensorGps] = Topic()
        self.battery_topic: Topic[BatteryStatus] = Topic()
        self.heartbeat: Topic[int] = Topic()
        self.status: Topic[VehicleStatus] = Topic()
        self.home: Topic[HomePosition] = Topic()
        self.requests: Queue[NavigatorRequest] = Queue()
        self.status_text: Queue[StatusText] = Queue()
        self.mission: Topic[Mission] = Topic()
        self.fence: Topic[Fence] = Topic()
        self.rally_points: Topic[RallyPoints] = Topic()
        self.geofence_status: Topic[GeofenceStatus] = Topic()
        self.follow_target: Topic[FollowTarget] = Topic()
        self.failure: Topic[FailureDetectorStatus] = Topic()
        self.range_finder: Topic[SensorRange] = Topic()
        self.sticks: Topic[ManualControlSetpoint] = Topic()
        self.orbit_status: Topic[OrbitStatus] = Topic()
        self.setpoint: Topic[TrajectorySetpoint] = Topic()
        self.registry.add(PositionControlParams)
        self.navigator = NavigatorModule(
            self.registry,
            failure_detector_status=self.failure,
            manual_control_setpoint=self.sticks,
            vehicle_local_position=self.local_position,
            vehicle_status=self.status,
            land_detected=self.land,
            home_position=self.home,
            mission=self.mission,
            navigator_request=self.requests,
            trajectory_setpoint=self.setpoint,
            mission_progress=self.progress,
            navigator_status=self.navigator_status,
            follow_target=self.follow_target,
            orbit_status=self.orbit_status,
            fence=self.fence,
            rally_points=self.rally_points,
            geofence_status=self.geofence_status,
            vehicle_command=self.commands,
            status_text=self.status_text,
        )
        self.stream: Topic[OffboardSetpoint] = Topic()
        self.control: Topic[VehicleControlMode] = Topic()
        self.storage: Topic[StorageStatus] = Topic()
        self.wind_estimate: Topic[WindEstimate] = Topic()
        self.commander = CommanderModule(
            self.registry,
            CommanderTopics(
                vehicle_command=self.commands,
                vehicle_command_ack=self.answers,
                vehicle_attitude=self.attitude,
                vehicle_local_position=self.local_position,
                estimator_status=self.estimator,
                land_detected=self.land,
                mission=self.mission,
                mission_progress=self.progress,
                navigator_status=self.navigator_status,
                geofence_status=self.geofence_status,
                failure_detector_status=self.failure,
                storage_status=self.storage,
                sensor_imu=self.imu,
                sensor_baro=self.baro,
                sensor_mag=self.mag,
                sensor_gps=self.gps,
                sensor_range=self.range_finder,
                battery_status=self.battery_topic,
                ground_station_heartbeat=self.heartbeat,
                manual_control_setpoint=self.sticks,
                offboard_setpoint=self.stream,
                vehicle_status=self.status,
                vehicle_control_mode=self.control,
                home_position=self.home,
                wind=self.wind_estimate,
                navigator_request=self.requests,
                status_text=self.status_text,
            ),
            refusal_of=self.navigator.refusal_of,
        )
        self._grounded_us = 10_000_000  # [us] Time on the ground with nothing pulling up

    @property
    def height(self) -> float:
        """Height above home [m]."""
        return -self.position[2]

    @property
    def armed(self) -> bool:
        return self.status.value is not None and self.status.value.armed

    @property
    def mode(self) -> NavigationState:
        assert self.status.value is not None
        return self.status.value.navigation_state

    @property
    def state(self) -> int:
        assert self.progress.value is not None
        return self.progress.value.state

    @property
    def landed(self) -> bool:
        return self._grounded_us > 500_000

    def upload(self, *items: MissionItem, mission_id: int = 7) -> None:
        self.mission.publish(Mission(self.now_us, mission_id, items))

    def send(self, command: int, *params: float, frame: int = 0) -> int:
        """Send a command, let it be answered, give the result."""
        p1, p2, p3, p4, p5, p6, p7 = (*params, *(0.0,) * (7 - len(params)))
        before = len(self.acks)
        self.commands.publish(
            VehicleCommand(self.now_us, command, p1, p2, p3, p4, p5, p6, p7, frame, 255, 190, 42)
        )
        self.run(0.1)
        finals = [ack for ack in self.acks[before:] if ack.result != 5]
        assert len(finals) == 1, finals
        assert finals[0].command == command
        assert finals[0].token == 42
        return finals[0].result

    def arm(self) -> int:
        return self.send(Command.COMPONENT_ARM_DISARM, 1.0)

    def set_mode(self, sub_mode: int) -> int:
        return self.send(Command.DO_SET_MODE, 1.0, 4.0, float(sub_mode))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.step()

    def run_until(self, condition: Callable[["ToyVehicle"], bool], limit_s: float = 300.0) -> None:
        """Run until a condition holds; a failure names the state that was left."""
        for _ in range(round(limit_s * 1e6 / STEP_US)):
            if condition(self):
                return
            self.step()
        raise AssertionError(f"not within {limit_s} s: {self.status.value} {self.progress.value}")

    def step(self) -> None:
        """One control step."""
        self.now_us += STEP_US
        self._move(STEP_US * 1e-6)
        self._sense()
        self.commander.update(self.now_us)
        self.navigator.update(self.now_us)
        self._record()

    def reset(self, north_m: float, east_m: float, down_m: float = 0.0) -> None:
        """Let the estimate leap; the vehicle has not moved."""
        step, former = (north_m, east_m, down_m), self.resets
        x, y, z = (a + b for a, b in zip(self.position, step, strict=True))
        self.position = (x, y, z)
        setpoint = self.setpoint.value
        if setpoint is not None:  # As the position controller does
            x, y, z = (a + b for a, b in zip(setpoint.position_ned, step, strict=True))
            self.setpoint.publish(setpoint._replace(position_ned=(x, y, z)))
        n, e, d = (a + b for a, b in zip(former.position_total_ned, step, strict=True))
        self.resets = former._replace(
            xy_count=former.xy_count + 1,
            position_delta_ned=step,
            position_total_ned=(n, e, d),
        )

    def _move(self, dt: float) -> None:
        setpoint = self.setpoint.value
        if setpoint is None or not self.armed:
            self.velocity = self.drift
            self._grounded_us += STEP_US
            return
        velocity = [0.0, 0.0, 0.0]
        for axis in range(3):
            wanted = setpoint.velocity_ned[axis]
            error = setpoint.position_ned[axis] - self.position[axis]
            velocity[axis] = wanted if math.isnan(error) else wanted + error / max(self.lag_s, dt)
        if self.height <= 0.0 and velocity[2] >= 0.0:
            velocity = [0.0, 0.0, 0.0]
            self._grounded_us += STEP_US
        else:
            velocity = [v + w for v, w in zip(velocity, self.wind, strict=True)]
            self._grounded_us = 0
        # Lag of the velocity itself, so that feed-forward does not make tracking perfect.
        share = min(1.0, dt / max(self.lag_s, dt))
        north, east, down = (
            old + share * (new - old) for old, new in zip(self.velocity, velocity, strict=True)
        )
        self.velocity = (north, east, down)
        x, y, z = (p + v * dt for p, v in zip(self.position, self.velocity, strict=True))
        self.position = (x, y, min(z, 0.0))
        self.yaw = setpoint.yaw

    def _sense(self) -> None:
        now, valid = self.now_us, self.position_valid
        q = from_euler(self.roll, 0.0, self.yaw)
        self.attitude.publish(VehicleAttitude(now, q, (0.0, 0.0, 0.0)))
        self.local_position.publish(
            VehicleLocalPosition(
                now,
                self.position,
                self.velocity,
                (0.0, 0.0, 0.0),
                self.yaw,
                *HOME,
                horizontal_accuracy_m=self.accuracy,
                vertical_accuracy_m=0.1,
                position_valid=valid,
                altitude_valid=self.altitude_valid,
                velocity_valid=valid,
                heading_valid=self.aligned,
                resets=self.resets,
                dead_reckoning=self.dead_reckoning,
            )
        )
        self.estimator.publish(
            EstimatorStatus(
                now,
                0,
                self.innovation,
                0.0,
                0.0,
                0.0,
                0.1,
                0.1,
                (0.0, 0.0, 0.0),
                self.aligned,
                self.gyro_broken,
                self.gyro_jump_us,
                stopped=self.stopped,
            )
        )
        state = LandedState.ON_GROUND if self.landed else LandedState.IN_AIR
        self.land.publish(LandDetected(now, self.landed, self.landed, state))
        self._sense_instruments()

    def _sense_instruments(self) -> None:
        now = self.now_us
        if "imu" not in self.silent:
            rate = math.nan if self.imu_is_dead else 0.0
            self.imu.publish(SensorImu(now, (rate, rate, rate), (0.0, 0.0, -9.81)))
        if "baro" not in self.silent:
            self.baro.publish(SensorBaro(now, 93700.0, 20.0))
        if "mag" not in self.silent:
            self.mag.publish(SensorMag(now, (0.2, 0.0, 0.4)))
        if "gps" not in self.silent:
            self.gps.publish(
                SensorGps(
                    now,
                    0,
                    *HOME,
                    self.velocity,
                    1.0,
                    1.0,
                    0.1,
                    self.fix_type,
                    self.satellites,
                    0.8,
                    1.0,
                )
            )
        if "battery" not in self.silent:
            self.battery_topic.publish(BatteryStatus(now, 15.0, 5.0, 0.0, 5.0, self.battery))

    def _record(self) -> None:
        self.track.append(self.position)
        if self.setpoint.value is not None:
            self.setpoints.append(self.setpoint.value)
        progress = self.progress.value
        if progress is not None and progress.reached_count > len(self.reached):
            self.reached.append(progress.seq_reached)
        self.acks.extend(self.answers.drain())
        self.texts.extend(text.text for text in self.status_text.drain())
