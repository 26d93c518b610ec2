import math

import pytest

from tests.support.estimates import local_position
from tests.support.vehicle_status import vehicle_status
from uav_firmware.bus import Topic
from uav_firmware.lib.rotation import tilt_of, to_euler, yaw_of
from uav_firmware.modules.position_control.module import PositionControlModule
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.msg.estimate import EstimateResets, VehicleLocalPosition
from uav_firmware.msg.setpoints import TrajectorySetpoint, VehicleAttitudeSetpoint
from uav_firmware.msg.status import LandDetected, LandedState, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

NAN = math.nan
ZERO: Vector3 = (0.0, 0.0, 0.0)
STEP_US = 16_000


class Vehicle:
    """The position controller, in the air at the origin; time passes in steps of 16 ms."""

    def __init__(self) -> None:
        self.registry = Registry()
        self.registry.add(PositionControlParams)
        self.trajectory: Topic[TrajectorySetpoint] = Topic()
        self.estimate: Topic[VehicleLocalPosition] = Topic()
        self.status: Topic[VehicleStatus] = Topic()
        self.land: Topic[LandDetected] = Topic()
        self._wanted: Topic[VehicleAttitudeSetpoint] = Topic()
        self.module = PositionControlModule(
            trajectory=self.trajectory,
            local_position=self.estimate,
            vehicle_status=self.status,
            land_detected=self.land,
            attitude_setpoint=self._wanted,
            registry=self.registry,
        )
        self._now_us = 1_000_000
        self.status.publish(vehicle_status(armed=True))
        self.land.publish(
            LandDetected(
                0,
                landed=False,
                ground_contact=False,
                landed_state=LandedState.IN_AIR,
                has_low_throttle=False,
            )
        )

    def wants(self, position: Vector3, yaw: float = NAN) -> None:
        """Give a setpoint as old as the newest estimate."""
        self.trajectory.publish(TrajectorySetpoint(self._now_us, position, ZERO, ZERO, yaw, NAN))

    def step(self, steps: int = 1, **estimate: object) -> VehicleAttitudeSetpoint:
        for _ in range(steps):
            self._now_us += STEP_US
            self.estimate.publish(local_position(time_us=self._now_us, **estimate))
            self.module.update()
        assert self._wanted.value is not None
        return self._wanted.value


def test_a_place_to_the_north_leans_the_nose_down() -> None:
    vehicle = Vehicle()
    vehicle.wants((5.0, 0.0, 0.0), yaw=0.0)
    roll, pitch, _ = to_euler(vehicle.step(3).q_ned_frd)
    assert pitch < -0.05
    assert abs(roll) < 1e-6


def test_a_place_to_the_east_leans_to_the_right() -> None:
    vehicle = Vehicle()
    vehicle.wants((0.0, 5.0, 0.0), yaw=0.0)
    assert to_euler(vehicle.step(3).q_ned_frd)[0] > 0.05


def test_a_place_above_takes_more_thrust() -> None:
    vehicle = Vehicle()
    vehicle.wants(ZERO)
    level = vehicle.step(3).thrust
    vehicle.wants((0.0, 0.0, -5.0))
    assert vehicle.step().thrust > level


def test_tilt_stays_within_its_parameter() -> None:
    vehicle = Vehicle()
    vehicle.registry.set("MPC_TILTMAX_AIR", 20.0)
    vehicle.wants((500.0, 0.0, 0.0))
    assert tilt_of(vehicle.step(3).q_ned_frd) <= math.radians(20.0) + 1e-6


def test_without_a_wanted_yaw_the_former_one_is_kept() -> None:
    vehicle = Vehicle()
    vehicle.wants(ZERO, yaw=1.0)
    vehicle.step(3)
    vehicle.wants(ZERO)
    assert yaw_of(vehicle.step(3).q_ned_frd) == pytest.approx(1.0)


def test_a_stale_setpoint_is_not_followed() -> None:
    vehicle = Vehicle()
    vehicle.wants((5.0, 0.0, -5.0))
    following = vehicle.step(3)
    sinking = vehicle.step(60)
    assert tilt_of(sinking.q_ned_frd) < 0.4 * tilt_of(following.q_ned_frd)
    assert sinking.thrust < following.thrust


def test_disarmed_there_is_no_thrust() -> None:
    vehicle = Vehicle()
    vehicle.wants((0.0, 0.0, -5.0))
    vehicle.status.publish(vehicle_status(armed=False))
    assert vehicle.step(200).thrust == 0.0


def test_without_position_it_does_not_lean() -> None:
    vehicle = Vehicle()
    vehicle.wants((5.0, 5.0, 0.0))
    blind = vehicle.step(3, position_valid=False, velocity_valid=False)
    assert tilt_of(blind.q_ned_frd) < 1e-6
    assert blind.thrust > 0.1


def test_an_old_setpoint_moves_with_an_estimate_that_is_reset() -> None:
    step = EstimateResets(
        xy_count=1, z_count=1, position_total_ned=(20.0, -5.0, 3.0), velocity_xy_count=1,
        velocity_total_ned=(2.0, 0.0, 0.0),
    )  # fmt: skip
    still, leapt = Vehicle(), Vehicle()
    for vehicle in (still, leapt):
        vehicle.wants((1.0, 0.0, 0.0), yaw=0.0)
        vehicle.step(3)
    expected = still.step(2)
    found = leapt.step(
        2, position_ned=step.position_total_ned, velocity_ned=(2.0, 0.0, 0.0), resets=step
    )
    assert found.q_ned_frd == pytest.approx(expected.q_ned_frd, abs=1e-6)
    assert found.thrust == pytest.approx(expected.thrust, abs=1e-6)
