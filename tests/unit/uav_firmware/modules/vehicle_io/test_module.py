from uav_firmware.bus import Topic
from uav_firmware.cal.vehicle import Fitted
from uav_firmware.modules.vehicle_io.module import VehicleIoModule
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorBattery,
    SensorEsc,
    SensorGps,
    SensorGround,
    SensorHygrometer,
    SensorImu,
    SensorMag,
    SensorRange,
    SensorTruth,
)
from uav_firmware.msg.vectors import Motors


class Hardware:
    """A vehicle that notes the order in which it is used; its barometer is due every other step."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.motors: Motors | None = None
        self.time_us = 0
        self.step_us = 4000
        self.fitted = Fitted(imus=2, barometers=2)
        self.only_fast = False

    def write_motors(self, control: Motors) -> None:
        self.calls.append("write_motors")
        self.motors = control

    def advance(self) -> None:
        self.calls.append("advance")
        self.time_us += self.step_us

    def read_imu(self, instance: int = 0) -> SensorImu:
        self.calls.append(f"read_imu {instance}")
        return SensorImu(self.time_us, (0.0, 0.0, 0.0), (0.0, 0.0, -9.81))

    def read_baro(self, instance: int = 0) -> SensorBaro | None:
        due = instance == 1 and self.time_us // self.step_us % 2 == 0
        return SensorBaro(self.time_us, 94_000.0, 20.0) if due else None

    def read_mag(self, instance: int = 0) -> SensorMag | None:  # noqa: ARG002  # the protocol's
        return None

    def read_gps(self) -> SensorGps | None:
        return None

    def read_battery(self) -> SensorBattery | None:
        return None

    def read_hygrometer(self) -> SensorHygrometer | None:
        return None

    def read_ground(self) -> SensorGround | None:
        return None

    def read_range(self) -> SensorRange | None:
        return None

    def read_esc(self) -> SensorEsc | None:
        return None

    def read_truth(self) -> SensorTruth | None:
        return None

    def close(self) -> None:
        self.calls.append("close")


class Vehicle:
    """The module on its hardware."""

    def __init__(self) -> None:
        self.hardware = Hardware()
        self.motors: Topic[ActuatorMotors] = Topic()
        self.imus: Topic[tuple[SensorImu, ...]] = Topic()
        self.baros: Topic[tuple[SensorBaro | None, ...]] = Topic()
        self.truth: Topic[SensorTruth] = Topic()
        self.module = VehicleIoModule(
            self.hardware,
            motors=self.motors,
            imus=self.imus,
            baros=self.baros,
            mags=Topic(),
            gps=Topic(),
            battery=Topic(),
            esc=Topic(),
            range_finder=Topic(),
            hygrometer=Topic(),
            ground=Topic(),
            truth=self.truth,
        )


def test_motors_are_written_before_time_passes_and_sensors_read_after() -> None:
    vehicle = Vehicle()
    vehicle.motors.publish(ActuatorMotors(0, (0.1, 0.2, 0.3, 0.4)))
    vehicle.module.update()
    assert vehicle.hardware.calls == ["write_motors", "advance", "read_imu 0", "read_imu 1"]
    assert vehicle.hardware.motors == (0.1, 0.2, 0.3, 0.4)


def test_without_a_command_no_motor_is_written() -> None:
    vehicle = Vehicle()
    vehicle.module.update()
    assert vehicle.hardware.motors is None


def test_a_sensor_is_published_only_when_it_was_due() -> None:
    vehicle = Vehicle()
    for _ in range(10):
        vehicle.module.update()
    assert vehicle.imus.count == 10
    assert vehicle.baros.count == 5
    assert vehicle.baros.value is not None
    assert vehicle.baros.value[0] is None


def test_in_a_step_of_fast_sensors_alone_no_other_is_read() -> None:
    vehicle = Vehicle()
    vehicle.hardware.only_fast = True
    for _ in range(10):
        vehicle.module.update()
    assert vehicle.imus.count == 10
    assert vehicle.baros.count == 0


def test_a_real_vehicle_has_no_truth() -> None:
    vehicle = Vehicle()
    vehicle.module.update()
    vehicle.module.update_truth()
    assert vehicle.truth.count == 0
