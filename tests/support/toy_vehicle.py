"""A kinematic vehicle under navigator and commander: no physics, no noise, flat ground.

It follows the setpoint with a first-order lag, stands on the ground at home's height, and
publishes what estimator, sensors and land detector would.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from tests.support.messages import changed
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.commander.module import CommanderModule
from uav_firmware.modules.navigator.module import NavigatorModule
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.estimate import (
    AidSource,
    EstimateResets,
    EstimatorStatus,
    TerrainEstimate,
    VehicleAttitude,
    VehicleLocalPosition,
)
from uav_firmware.msg.mission import (
    Mission,
    MissionItem,
    MissionRejection,
    ModeTarget,
    PlanCheckRequest,
    PlanType,
    TargetCheckRequest,
)
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorGps,
    SensorImu,
    SensorMag,
)
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import (
    Command,
    LandDetected,
    LandedState,
    NavigationState,
    VehicleCommand,
    VehicleCommandAck,
)
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

NAN = math.nan
HOME = (40.44340, -3.73820, 650.0)
STEP_US = 10_000
"""Period of commander and navigator: the vehicle's own is 4 ms; tests of both need no finer one."""


def item(seq: int, command: int, **fields: float) -> MissionItem:
    """Mission item at the home position by default; altitude relative to home."""
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
    heading_set_us: int | None = None
    imu_is_dead: bool = False  # It sends samples without a number
    satellites: int = 12
    accuracy: float = 0.1  # [m] Of the estimated position
    innovation: float = 0.0  # Test ratio of the GPS velocity
    drift: Vector3 = (0.0, 0.0, 0.0)  # [m/s] Of a vehicle that stands
    wind: Vector3 = (0.0, 0.0, 0.0)
    roll: float = 0.0
    lifting: bool = False  # Its rotors may carry it, on the ground
    ground_m: float | None = None  # Above home, as the range finder measures it; None: it does not
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
        self.topics = topics = Topics()
        self.commands = topics.vehicle_command
        self.answers = topics.vehicle_command_ack
        self.attitude = topics.vehicle_attitude
        self.local_position = topics.vehicle_local_position
        self.estimator = topics.estimator_status
        self.land = topics.land_detected
        self.progress = topics.mission_progress
        self.navigator_status = topics.navigator_status
        self.imu = topics.sensor_imu
        self.baro = topics.sensor_baro
        self.mag = topics.sensor_mag
        self.gps = topics.sensor_gps
        self.battery_topic = topics.battery_status
        self.heartbeat = topics.ground_station_heartbeat
        self.status = topics.vehicle_status
        self.home = topics.home_position
        self.requests = topics.navigator_request
        self.status_text = topics.status_text
        self.mission = topics.mission
        self.fence = topics.fence
        self.rally_points = topics.rally_points
        self.geofence_status = topics.geofence_status
        self.follow_target = topics.follow_target
        self.failure = topics.failure_detector_status
        self.range_finder = topics.sensor_range
        self.sticks = topics.manual_control_setpoint
        self.orbit_status = topics.orbit_status
        self.setpoint = topics.trajectory_setpoint
        self.stream = topics.offboard_setpoint
        self.control = topics.vehicle_control_mode
        self.storage = topics.storage_status
        self.wind_estimate = topics.wind
        self.registry.add(PositionControlParams)
        self.navigator = NavigatorModule(self.registry, topics)
        self.commander = CommanderModule(self.registry, topics)
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
        self.run_commander(self.now_us)
        self.navigator.update(self.now_us)
        self._record()

    def run_commander(self, now_us: int) -> None:
        """One step of the commander, with the navigator's answer to its request."""
        self.commander.update(now_us)
        while self.topics.target_check_request:
            self.navigator.check_targets()
            self.commander.resume()
        self.commander.finish()

    def check_plan(
        self, plan_type: PlanType, items: Sequence[MissionItem]
    ) -> MissionRejection | None:
        """What the navigator answers to the upload of a plan."""
        self.topics.plan_check_request.publish(PlanCheckRequest(1, plan_type, tuple(items)))
        while not self.topics.plan_check_result:
            self.navigator.check_plans()
        (result,) = self.topics.plan_check_result.drain()
        return result.rejection

    def check_mission(self, items: Sequence[MissionItem]) -> MissionRejection | None:
        """What the navigator answers to the upload of a mission."""
        return self.check_plan(PlanType.MISSION, items)

    def check_target(self, target: ModeTarget) -> str:
        """Why the geofence forbids a target; empty when it does not."""
        self.topics.target_check_request.publish(TargetCheckRequest(1, target))
        self.navigator.check_targets()
        (result,) = self.topics.target_check_result.drain()
        return result.refusal

    def reset(self, north_m: float, east_m: float, down_m: float = 0.0) -> None:
        """Let the estimate leap; the vehicle has not moved."""
        step, former = (north_m, east_m, down_m), self.resets
        x, y, z = (a + b for a, b in zip(self.position, step, strict=True))
        self.position = (x, y, z)
        setpoint = self.setpoint.value
        if setpoint is not None:  # As the position controller does
            x, y, z = (a + b for a, b in zip(setpoint.position_ned, step, strict=True))
            self.setpoint.publish(changed(setpoint, position_ned=(x, y, z)))
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
                heading_set_us=self.heading_set_us,
            )
        )
        state = LandedState.ON_GROUND if self.landed else LandedState.IN_AIR
        low_throttle = self.landed and not self.lifting
        self.land.publish(LandDetected(now, self.landed, self.landed, state, low_throttle))
        if self.ground_m is not None:
            self.topics.terrain_estimate.publish(TerrainEstimate(now, -self.ground_m))
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
