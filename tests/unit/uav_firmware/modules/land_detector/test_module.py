from dataclasses import dataclass, field

import pytest

from tests.support.estimates import local_position
from tests.support.vehicle_status import vehicle_status
from uav_firmware.bus import Topic
from uav_firmware.modules.land_detector.module import LandDetectorModule
from uav_firmware.modules.land_detector.params import LandDetectorParams
from uav_firmware.modules.manual_control.params import ManualControlParams
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.msg.control_mode import ControlLevel, ControlSource, VehicleControlMode
from uav_firmware.msg.estimate import (
    HoverThrustEstimate,
    TerrainEstimate,
    VehicleAttitude,
    VehicleLocalPosition,
)
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.setpoints import TrajectorySetpoint, VehicleTorqueThrustSetpoint
from uav_firmware.msg.status import LandDetected, LandedState, NavigationState, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

ZERO: Vector3 = (0.0, 0.0, 0.0)
NAN = float("nan")
HOVER, IDLE = 0.225, 0.06
STEP_US = 20_000


@dataclass
class Vehicle:
    """The land detector with its topics; time passes in steps of 20 ms."""

    attitude: Topic[VehicleAttitude] = field(default_factory=Topic)
    estimate: Topic[VehicleLocalPosition] = field(default_factory=Topic)
    thrust: Topic[VehicleTorqueThrustSetpoint] = field(default_factory=Topic)
    trajectory: Topic[TrajectorySetpoint] = field(default_factory=Topic)
    status: Topic[VehicleStatus] = field(default_factory=Topic)
    land: Topic[LandDetected] = field(default_factory=Topic)
    control: Topic[VehicleControlMode] = field(default_factory=Topic)
    hover: Topic[HoverThrustEstimate] = field(default_factory=Topic)
    range_finder: Topic[SensorRange] = field(default_factory=Topic)
    ground: Topic[TerrainEstimate] = field(default_factory=Topic)
    believed_hover: float = HOVER  # MPC_THR_HOVER
    led_down: float | None = None  # [m/s] Streamed by the navigator; None: silent
    now_us: int = 0

    def __post_init__(self) -> None:
        registry = Registry()
        registry.add(LandDetectorParams)
        registry.add(PositionControlParams)
        registry.add(ManualControlParams)
        registry.set("MPC_THR_HOVER", self.believed_hover)
        self.status.publish(vehicle_status(armed=True))
        self.module = LandDetectorModule(
            attitude=self.attitude,
            local_position=self.estimate,
            torque_thrust=self.thrust,
            trajectory=self.trajectory,
            vehicle_status=self.status,
            land_detected=self.land,
            vehicle_control_mode=self.control,
            hover_thrust_estimate=self.hover,
            range_finder=self.range_finder,
            terrain_estimate=self.ground,
            registry=registry,
        )

    def pass_time(
        self, seconds: float, *, thrust: float, height: float, sink_speed: float = 0.0
    ) -> LandDetected:
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.now_us += STEP_US
            self.attitude.publish(VehicleAttitude(self.now_us, (1.0, 0.0, 0.0, 0.0), ZERO))
            self.estimate.publish(
                local_position(
                    time_us=self.now_us,
                    position_ned=(0.0, 0.0, -height),
                    velocity_ned=(0.0, 0.0, sink_speed),
                )
            )
            self.thrust.publish(VehicleTorqueThrustSetpoint(self.now_us, ZERO, thrust))
            if self.led_down is not None:
                wanted = (NAN, NAN, NAN), (0.0, 0.0, self.led_down), ZERO
                self.trajectory.publish(TrajectorySetpoint(self.now_us, *wanted, NAN, NAN))
            self.module.update()
        assert self.land.value is not None
        return self.land.value

    def fly(self) -> None:
        """Take off and climb."""
        self.pass_time(0.5, thrust=0.0, height=0.0)
        self.pass_time(0.5, thrust=0.3, height=0.5, sink_speed=-1.0)
        self.pass_time(0.5, thrust=HOVER, height=5.0)


def test_a_flight_is_seen_from_start_to_end() -> None:
    vehicle = Vehicle()
    assert vehicle.pass_time(0.5, thrust=0.0, height=0.0).landed
    climbing = vehicle.pass_time(0.5, thrust=0.3, height=0.5, sink_speed=-1.0)
    assert climbing.landed_state is LandedState.TAKEOFF
    hovering = vehicle.pass_time(0.5, thrust=HOVER, height=5.0)
    assert hovering.landed_state is LandedState.IN_AIR
    vehicle.trajectory.publish(
        TrajectorySetpoint(0, (0.0, 0.0, NAN), (0.0, 0.0, 0.5), ZERO, NAN, NAN)
    )
    sinking = vehicle.pass_time(0.5, thrust=HOVER, height=1.0, sink_speed=0.5)
    assert sinking.landed_state is LandedState.LANDING
    assert vehicle.pass_time(1.0, thrust=IDLE, height=0.0).landed_state is LandedState.ON_GROUND


def test_ground_contact_comes_before_the_landing() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    touching = vehicle.pass_time(0.5, thrust=IDLE, height=0.0)
    assert touching.ground_contact
    assert not touching.landed


def test_hovering_is_no_landing_however_long() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    assert not vehicle.pass_time(30.0, thrust=HOVER, height=5.0).ground_contact


def test_a_descent_at_low_thrust_is_no_landing() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    assert not vehicle.pass_time(3.0, thrust=IDLE, height=5.0, sink_speed=1.5).ground_contact


def test_a_landing_on_higher_ground_is_seen_too() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    assert vehicle.pass_time(1.0, thrust=IDLE, height=4.0).landed


@pytest.mark.parametrize("believed", [0.225, 0.5, 0.8])
def test_a_level_flight_is_no_landing_whatever_the_weight_is_believed_to_be(
    believed: float,
) -> None:
    vehicle = Vehicle(believed_hover=believed)
    vehicle.fly()
    vehicle.led_down = 0.0
    assert not vehicle.pass_time(10.0, thrust=IDLE, height=5.0, sink_speed=0.1).ground_contact


@pytest.mark.parametrize("believed", [0.1, 0.5, 0.8])
def test_a_slow_descent_is_judged_by_the_hover_thrust_that_was_learnt(believed: float) -> None:
    vehicle = Vehicle(believed_hover=believed)
    vehicle.fly()
    vehicle.hover.publish(HoverThrustEstimate(vehicle.now_us, HOVER, valid=True))
    vehicle.led_down = 0.3
    assert not vehicle.pass_time(10.0, thrust=HOVER, height=5.0).ground_contact
    assert vehicle.pass_time(1.0, thrust=IDLE, height=0.0).landed


@pytest.mark.parametrize("believed", [0.1, 0.5, 0.8])
def test_a_take_off_is_seen_whatever_the_weight_is_believed_to_be(believed: float) -> None:
    vehicle = Vehicle(believed_hover=believed)
    vehicle.fly()
    assert vehicle.land.value is not None
    assert vehicle.land.value.landed_state is LandedState.IN_AIR


@pytest.mark.parametrize("level", [ControlLevel.ATTITUDE, ControlLevel.RATES])
def test_where_a_throttle_leads_it_has_to_be_down(level: ControlLevel) -> None:
    vehicle = Vehicle(believed_hover=0.8)
    vehicle.fly()
    vehicle.control.publish(VehicleControlMode(vehicle.now_us, ControlSource.MANUAL, level))
    assert not vehicle.pass_time(10.0, thrust=0.5 * HOVER, height=5.0).ground_contact
    assert vehicle.pass_time(1.0, thrust=0.08, height=0.0).landed


def test_a_throttle_that_may_lift_the_vehicle_is_reported_before_it_rises() -> None:
    vehicle = Vehicle()
    assert vehicle.pass_time(0.5, thrust=IDLE, height=0.0).has_low_throttle
    report = vehicle.pass_time(0.1, thrust=HOVER, height=0.0)
    assert report.landed
    assert not report.has_low_throttle
    assert vehicle.pass_time(0.1, thrust=IDLE, height=0.0).has_low_throttle


def test_a_disarmed_vehicle_has_a_low_throttle_whatever_was_set_last() -> None:
    vehicle = Vehicle()
    vehicle.pass_time(0.1, thrust=HOVER, height=0.0)
    vehicle.status.publish(vehicle_status(armed=False))
    assert vehicle.pass_time(0.1, thrust=HOVER, height=0.0).has_low_throttle


def test_land_mode_leads_to_landing_at_any_height() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    vehicle.status.publish(vehicle_status(armed=True, navigation_state=NavigationState.AUTO_LAND))
    vehicle.trajectory.publish(
        TrajectorySetpoint(0, (0.0, 0.0, NAN), (0.0, 0.0, 0.7), ZERO, NAN, NAN)
    )
    state = vehicle.pass_time(0.2, thrust=HOVER, height=40.0, sink_speed=0.7).landed_state
    assert state is LandedState.LANDING


def test_a_disarmed_vehicle_is_on_the_ground() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    vehicle.status.publish(vehicle_status(armed=False))
    assert vehicle.pass_time(0.1, thrust=0.0, height=5.0).landed


def test_it_is_repeated_once_a_second_and_not_more_often() -> None:
    vehicle = Vehicle()
    vehicle.fly()
    before = vehicle.land.count
    vehicle.pass_time(5.0, thrust=HOVER, height=5.0)
    assert vehicle.land.count - before == 5
