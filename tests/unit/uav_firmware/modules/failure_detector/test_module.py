"""The failure detector on its topics."""

import math

import pytest

from tests.support.vehicle_status import vehicle_status
from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.failure_detector.module import FailureDetectorModule
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.sensors import SensorEsc, SensorImu, SensorsStatus
from uav_firmware.msg.status import LandDetected, LandedState, StatusText, VehicleStatus
from uav_firmware.parameters import Registry

HOVER_RPM = 5000.0
STEP_US = 8000


class Vehicle:
    """The module and what it hears."""

    def __init__(self) -> None:
        self.registry = Registry()
        self.motors: Topic[ActuatorMotors] = Topic()
        self.esc: Topic[SensorEsc] = Topic()
        self.imu: Topic[SensorImu] = Topic()
        self.attitude: Topic[VehicleAttitude] = Topic()
        self.vehicle_status: Topic[VehicleStatus] = Topic()
        self.sensors: Topic[SensorsStatus] = Topic()
        self.status: Topic[FailureDetectorStatus] = Topic()
        self.land: Topic[LandDetected] = Topic()
        self.texts: Queue[StatusText] = Queue()
        self.module = FailureDetectorModule(
            self.registry,
            motors=self.motors,
            esc=self.esc,
            imu=self.imu,
            baro=Topic(),
            attitude=self.attitude,
            attitude_setpoint=Topic(),
            torque_thrust=Topic(),
            hover_thrust_estimate=Topic(),
            land_detected=self.land,
            vehicle_control_mode=Topic(),
            vehicle_status=self.vehicle_status,
            sensors_status=self.sensors,
            failure_status=self.status,
            status_text=self.texts,
        )
        self.now_us = 0
        self.vehicle_status.publish(vehicle_status(armed=True))

    def fly(
        self,
        seconds: float,
        *,
        second_rpm: float = HOVER_RPM,
        roll: float = 0.0,
        third_rpm: float = HOVER_RPM,
        rate: float = 0.0,
        command: float = 0.42,
    ) -> None:
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.now_us += STEP_US
            self.motors.publish(ActuatorMotors(self.now_us, (command,) * 4))
            speeds = (HOVER_RPM, second_rpm, third_rpm, HOVER_RPM)
            self.imu.publish(SensorImu(self.now_us, (rate, 0.0, 0.0), (0.0, 0.0, -9.8)))
            self.esc.publish(SensorEsc(self.now_us, speeds, (2.7, 2.7, 2.7, 2.7)))
            q = from_euler(roll, 0.0, 0.0)
            self.attitude.publish(VehicleAttitude(self.now_us, q, (0.0, 0.0, 0.0)))
            self.module.update(self.now_us)

    def lost(self) -> tuple[bool, bool]:
        """Whether roll and pitch are beyond their limits."""
        assert self.status.value is not None
        return self.status.value.roll_exceeded, self.status.value.pitch_exceeded

    @property
    def failed(self) -> int:
        assert self.status.value is not None
        return self.status.value.failed_motors


def test_a_healthy_vehicle_is_told_of_once_a_second_and_no_word_is_said() -> None:
    vehicle = Vehicle()
    vehicle.fly(5.0)
    assert vehicle.failed == 0
    assert 5 <= vehicle.status.count <= 7
    assert vehicle.texts.drain() == []


def test_without_a_gyroscope_no_motor_is_blamed() -> None:
    vehicle = Vehicle()
    vehicle.fly(2.0)
    vehicle.sensors.publish(SensorsStatus(0, 1, 0, 0, 0, gyro_lost=True))
    vehicle.fly(2.0, second_rpm=500.0)
    assert vehicle.failed == 0
    assert vehicle.texts.drain() == []


def test_a_slow_motor_is_told_of_at_once_and_said_once() -> None:
    vehicle = Vehicle()
    vehicle.fly(2.0)
    vehicle.fly(0.1, second_rpm=500.0)
    assert vehicle.failed == 0b10
    vehicle.fly(2.0, second_rpm=500.0)
    assert [text.text for text in vehicle.texts.drain()] == ["Motor 2 failed"]


@pytest.mark.parametrize("enabled", [0, 1])
def test_rotors_that_stop_at_a_blow_are_a_crash_and_no_failed_motors(enabled: int) -> None:
    vehicle = Vehicle()
    vehicle.registry.set("FD_CRASH_EN", enabled)
    vehicle.fly(2.0, rate=7.0)
    vehicle.fly(0.1, second_rpm=0.0, third_rpm=0.0)
    assert vehicle.status.value is not None
    assert vehicle.status.value.crash == ("has hit something, rotors stand" if enabled else "")
    assert vehicle.failed == (0 if enabled else 0b110)
    texts = [text.text for text in vehicle.texts.drain()]
    assert texts == ([] if enabled else ["Motor 2 failed", "Motor 3 failed"])


def test_behind_a_blow_it_may_be_the_ground_that_carries_the_vehicle() -> None:
    vehicle = Vehicle()
    vehicle.land.publish(LandDetected(0, False, False, LandedState.IN_AIR, False))
    vehicle.fly(2.0, rate=7.0)
    vehicle.fly(0.1, second_rpm=0.0, third_rpm=0.0)
    assert vehicle.status.value is not None
    assert vehicle.status.value.crash == "has hit something, rotors stand"


def test_telemetry_that_contradicts_the_flight_is_no_crash_at_a_blow() -> None:
    vehicle = Vehicle()
    vehicle.land.publish(LandDetected(0, False, False, LandedState.IN_AIR, False))
    vehicle.fly(2.0)
    vehicle.fly(2.0, second_rpm=0.0, third_rpm=0.0)
    vehicle.fly(0.1, second_rpm=0.0, third_rpm=0.0, rate=7.0)
    vehicle.fly(2.0, second_rpm=0.0, third_rpm=0.0)
    assert vehicle.status.value is not None
    assert (vehicle.status.value.crash, vehicle.failed) == ("", 0)


def test_a_standing_motor_of_a_disarmed_vehicle_has_not_failed() -> None:
    vehicle = Vehicle()
    vehicle.vehicle_status.publish(vehicle_status(armed=False))
    vehicle.fly(2.0, second_rpm=0.0)
    assert vehicle.failed == 0


def test_a_failure_outlasts_the_flight_until_it_is_acknowledged() -> None:
    vehicle = Vehicle()
    vehicle.fly(1.0, second_rpm=0.0)
    assert vehicle.failed == 0b10
    vehicle.vehicle_status.publish(vehicle_status(armed=False))
    vehicle.fly(5.0)
    vehicle.vehicle_status.publish(vehicle_status(armed=True))
    vehicle.fly(1.0)
    assert vehicle.failed == 0b10
    disarmed = vehicle_status(armed=False)
    vehicle.vehicle_status.publish(disarmed._replace(failures_cleared_us=vehicle.now_us))
    vehicle.fly(0.1)
    assert vehicle.failed == 0
    vehicle.vehicle_status.publish(vehicle_status(armed=True))
    vehicle.fly(0.5, second_rpm=0.0)
    assert vehicle.failed == 0b10


def test_speed_controllers_that_report_no_speed_are_silent() -> None:
    vehicle = Vehicle()
    silent = []
    for second_rpm in (HOVER_RPM, math.nan, HOVER_RPM):
        vehicle.fly(1.0, second_rpm=second_rpm)
        assert vehicle.status.value is not None
        silent.append(vehicle.status.value.escs_silent)
    assert silent == [False, True, False]


def test_telemetry_that_is_lost_in_flight_is_said_once_per_event() -> None:
    vehicle = Vehicle()
    for second_rpm in (HOVER_RPM, math.nan, HOVER_RPM, math.nan):
        vehicle.fly(2.0, second_rpm=second_rpm)
    text = "ESC telemetry lost: a motor that fails is not recognised"
    assert [said.text for said in vehicle.texts.drain()] == [text, text]
    assert vehicle.failed == 0


def test_telemetry_that_freezes_in_flight_is_said_once() -> None:
    vehicle = Vehicle()
    vehicle.fly(3.0)  # Commands as steady as the speeds prove nothing
    assert not vehicle.texts.drain()
    vehicle.fly(3.0, command=0.43)
    vehicle.fly(3.0, command=0.45)
    (said,) = vehicle.texts.drain()
    assert said.text.startswith("ESC telemetry frozen")
    vehicle.fly(1.0, second_rpm=HOVER_RPM - 1.0)
    vehicle.fly(3.0, command=0.45)
    assert len(vehicle.texts.drain()) == 0
    vehicle.fly(3.0, command=0.42)
    assert len(vehicle.texts.drain()) == 1


def test_telemetry_that_ends_on_the_ground_is_left_to_the_check_before_arming() -> None:
    vehicle = Vehicle()
    vehicle.vehicle_status.publish(vehicle_status())
    for second_rpm in (HOVER_RPM, math.nan):
        vehicle.fly(2.0, second_rpm=second_rpm)
    assert not vehicle.texts.drain()


def test_the_motor_monitor_can_be_switched_off() -> None:
    vehicle = Vehicle()
    vehicle.registry.set("FD_ACT_EN", 0)
    vehicle.fly(1.0, second_rpm=0.0)
    assert vehicle.failed == 0


def test_a_roll_beyond_the_limit_is_told_after_its_time_and_forgotten() -> None:
    vehicle = Vehicle()
    vehicle.fly(0.2, roll=math.radians(70.0))
    assert vehicle.lost() == (False, False)
    vehicle.fly(0.2, roll=math.radians(70.0))
    assert vehicle.lost() == (True, False)
    assert "Attitude beyond limits" in [text.text for text in vehicle.texts.drain()]
    vehicle.fly(0.1, roll=math.radians(10.0))
    assert vehicle.lost() == (False, False)
