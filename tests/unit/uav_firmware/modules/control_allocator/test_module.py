import pytest

from tests.support.vehicle_status import vehicle_status
from uav_firmware.bus import Queue, Topic
from uav_firmware.modules.control_allocator.module import ControlAllocatorModule
from uav_firmware.modules.control_allocator.params import ControlAllocatorParams
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.setpoints import ControlAllocatorStatus, VehicleTorqueThrustSetpoint
from uav_firmware.msg.status import StatusText, VehicleStatus
from uav_firmware.msg.vectors import Motors, Vector3
from uav_firmware.parameters import Registry

LEVEL: Vector3 = (0.0, 0.0, 0.0)
STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)


class Vehicle:
    """The allocator with its topics."""

    def __init__(self) -> None:
        self.registry = Registry()
        self.registry.add(ControlAllocatorParams)
        self.status: Topic[VehicleStatus] = Topic()
        self.setpoint: Topic[VehicleTorqueThrustSetpoint] = Topic()
        self.allocated: Topic[ControlAllocatorStatus] = Topic()
        self.texts: Queue[StatusText] = Queue()
        self._motors: Topic[ActuatorMotors] = Topic()
        self.module = ControlAllocatorModule(
            torque_thrust=self.setpoint,
            vehicle_status=self.status,
            motors=self._motors,
            allocator_status=self.allocated,
            status_text=self.texts,
            registry=self.registry,
        )

    def motors(self) -> Motors:
        self.module.update(1)
        assert self._motors.value is not None
        return self._motors.value.control

    def wants(self, thrust: float, torque: Vector3 = LEVEL) -> None:
        self.setpoint.publish(VehicleTorqueThrustSetpoint(0, torque, thrust))

    def arms(self) -> None:
        self.status.publish(vehicle_status(armed=True))


def test_motors_stand_until_somebody_says_that_the_vehicle_is_armed() -> None:
    vehicle = Vehicle()
    vehicle.wants(0.8)
    assert vehicle.motors() == STOPPED
    vehicle.status.publish(vehicle_status(armed=False))
    assert vehicle.motors() == STOPPED


def test_disarming_stops_the_motors_in_the_same_step() -> None:
    vehicle = Vehicle()
    vehicle.arms()
    vehicle.wants(0.8)
    assert min(vehicle.motors()) > 0.5
    vehicle.status.publish(vehicle_status(armed=False))
    assert vehicle.motors() == STOPPED


def test_armed_without_thrust_the_motors_idle() -> None:
    vehicle = Vehicle()
    vehicle.arms()
    assert vehicle.motors() == pytest.approx((0.055, 0.055, 0.055, 0.055))
    vehicle.wants(0.0, (0.5, 0.5, 0.5))
    assert vehicle.motors() == pytest.approx((0.055, 0.055, 0.055, 0.055))


def test_in_flight_no_motor_stops() -> None:
    vehicle = Vehicle()
    vehicle.arms()
    vehicle.wants(0.1, (0.9, -0.9, 0.9))
    assert min(vehicle.motors()) >= 0.0549


def test_what_could_not_be_produced_is_reported() -> None:
    vehicle = Vehicle()
    vehicle.arms()
    vehicle.wants(0.5, (0.0, 0.0, 1.0))
    vehicle.motors()
    assert vehicle.allocated.value is not None
    assert vehicle.allocated.value.unallocated_torque_frd[2] > 0.0


def test_rotors_that_cannot_fly_leave_the_former_mix_and_are_told() -> None:
    vehicle = Vehicle()
    vehicle.arms()
    vehicle.wants(0.4, (0.1, 0.1, 0.1))
    before = vehicle.motors()
    for name in ("CA_ROTOR0_KM", "CA_ROTOR1_KM", "CA_ROTOR2_KM", "CA_ROTOR3_KM"):
        vehicle.registry.set(name, 0.0)
    assert vehicle.motors() == before
    assert [text.text for text in vehicle.texts.drain()] == [
        "Geometry not taken: CA_ROTOR*: the rotors cannot turn the vehicle about every axis"
    ]


def test_a_changed_parameter_is_taken_in_flight() -> None:
    vehicle = Vehicle()
    vehicle.arms()
    vehicle.wants(0.4)
    before = vehicle.motors()
    vehicle.registry.set("THR_MDL_FAC", 0.0)
    assert vehicle.motors() == pytest.approx((0.4, 0.4, 0.4, 0.4))
    assert before != vehicle.motors()


@pytest.mark.parametrize("number", [float("nan"), float("inf"), float("-inf")])
def test_a_setpoint_that_is_no_number_keeps_the_former_command(number: float) -> None:
    vehicle = Vehicle()
    vehicle.arms()
    vehicle.wants(0.4)
    before = vehicle.motors()
    for _ in range(3):
        vehicle.wants(0.4, (number, 0.0, 0.0))
        assert vehicle.motors() == before
    assert [text.text for text in vehicle.texts.drain()] == ["Motor command is no number"]
    vehicle.wants(0.6)
    assert vehicle.motors() > before
