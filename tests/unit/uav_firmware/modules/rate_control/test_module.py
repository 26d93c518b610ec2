import math
from collections.abc import Mapping

import pytest

from uav_firmware.bus import Topic
from uav_firmware.modules.rate_control.module import RateControlModule
from uav_firmware.modules.rate_control.params import RateControlParams
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.setpoints import (
    ControlAllocatorStatus,
    VehicleRatesSetpoint,
    VehicleTorqueThrustSetpoint,
)
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

STILL: Vector3 = (0.0, 0.0, 0.0)


class Vehicle:
    """The rate controller with its topics; time passes in steps of 4 ms."""

    def __init__(self) -> None:
        self.registry = Registry()
        self.registry.add(RateControlParams)
        self._attitude: Topic[VehicleAttitude] = Topic()
        self._wanted: Topic[VehicleRatesSetpoint] = Topic()
        self._allocated: Topic[ControlAllocatorStatus] = Topic()
        self._result: Topic[VehicleTorqueThrustSetpoint] = Topic()
        self._now_us = 0
        self.module = RateControlModule(
            attitude=self._attitude,
            rates_setpoint=self._wanted,
            allocator_status=self._allocated,
            torque_thrust=self._result,
            registry=self.registry,
        )

    def step(
        self, wanted: Vector3, thrust: float, *, after_us: int = 4000, rate: Vector3 = STILL
    ) -> Vector3:
        self._now_us += after_us
        self._attitude.publish(VehicleAttitude(self._now_us, (1.0, 0.0, 0.0, 0.0), rate))
        self._wanted.publish(VehicleRatesSetpoint(self._now_us, wanted, thrust))
        self.module.update()
        assert self._result.value is not None
        assert self._result.value.thrust == thrust
        return self._result.value.torque_frd


def test_without_thrust_there_is_no_torque() -> None:
    vehicle = Vehicle()
    for _ in range(100):
        assert vehicle.step((1.0, 1.0, 1.0), 0.0) == STILL


def test_what_was_integrated_is_forgotten_on_the_ground() -> None:
    vehicle = Vehicle()
    first = vehicle.step((0.5, 0.0, 0.0), 0.3)
    for _ in range(100):
        charged = vehicle.step((0.5, 0.0, 0.0), 0.3)
    vehicle.step((0.5, 0.0, 0.0), 0.0)
    assert charged[0] > first[0]
    assert vehicle.step((0.5, 0.0, 0.0), 0.3) == first


def test_a_pause_starts_afresh() -> None:
    vehicle = Vehicle()
    vehicle.step((0.5, 0.0, 0.0), 0.3)
    assert vehicle.step((0.5, 0.0, 0.0), 0.3, after_us=1_000_000) == STILL


def test_a_changed_gain_is_taken_in_flight() -> None:
    vehicle = Vehicle()
    before = vehicle.step((0.5, 0.0, 0.0), 0.3)
    vehicle.registry.set("MC_ROLLRATE_P", 0.16)
    assert vehicle.step((0.5, 0.0, 0.0), 0.3)[0] > 1.9 * before[0]


@pytest.mark.parametrize(("axis", "name"), [(0, "ROLL"), (1, "PITCH"), (2, "YAW")])
def test_a_multiplier_scales_every_gain_of_its_axis(axis: int, name: str) -> None:
    """QGroundControl tunes the rates by it (PX4TuningComponentCopterRate.qml)."""

    def torques(changes: Mapping[str, float]) -> list[Vector3]:
        vehicle = Vehicle()
        for parameter, value in changes.items():
            vehicle.registry.set(parameter, value)
        turning = [0.02 * math.sin(step) for step in range(50)]
        return [vehicle.step((0.1, 0.1, 0.1), 0.3, rate=(r, r, r)) for r in turning]

    names = [f"MC_{name}RATE_{gain}" for gain in "PID"]
    gains = {each: float(Vehicle().registry.get(each)) for each in names}
    multiplied = torques({f"MC_{name}RATE_K": 1.5})
    scaled, usual = torques({each: 1.5 * gains[each] for each in names}), torques({})
    for other in range(3):
        new, expected, old = ([torque[other] for torque in t] for t in (multiplied, scaled, usual))
        assert new == pytest.approx(expected, rel=1e-5)
        assert (new == old) == (other != axis)
