"""MAVLink's numbers break the same parts as the lines of the console."""

import pytest

from sim.fault_schedule import Fault
from sim.faults.injection import EFFECTS, Failure, Unit, faults_of, kinds_of
from sim.faults.notation import read_order
from tests.support.cases import failures

NOW_US = 5_000_000
SAME = (
    (Unit.DISTANCE_SENSOR, Failure.OFF, 1, ("rangefinder_loss",)),
    (Unit.DISTANCE_SENSOR, Failure.STUCK, 1, ("rangefinder_frozen",)),
    (Unit.DISTANCE_SENSOR, Failure.WRONG, 1, ("rangefinder_blocked distance_m=0.3",)),
    (Unit.BATTERY, Failure.GARBAGE, 0, ("battery_monitor_loss",)),
    (Unit.MOTOR, Failure.OFF, 2, ("motor_loss motor=2",)),
    (Unit.GYRO, Failure.OFF, 0, ("gyro_loss instance=all",)),
    (Unit.GYRO, Failure.OFF, 1, ("gyro_loss",)),
    (Unit.MAG, Failure.STUCK, 2, ("mag_frozen instance=1",)),
    (Unit.BARO, Failure.WRONG, 3, ("baro_bias up_m=5 instance=2",)),
    (Unit.CAMERA, Failure.OFF, 0, ("camera_failure",)),
    (Unit.GPS, Failure.OFF, 0, ("gps_loss",)),
    (Unit.HYGROMETER, Failure.OFF, 0, ("humidity_failure",)),
    (Unit.GPS, Failure.STUCK, 0, ("gps_frozen",)),
    (
        Unit.MOTOR,
        Failure.WRONG,
        0,
        tuple(f"motor_loss motor={motor} efficiency=0.6" for motor in range(1, 5)),
    ),
    (Unit.GPS, Failure.WRONG, 0, ("gps_jump north_m=40 east_m=40",)),
    (Unit.AIR, Failure.WRONG, 0, ("wind_gust speed_m_s=18",)),
    (Unit.HYGROMETER, Failure.GARBAGE, 0, ("humidity_invalid",)),
)
"""The faults that raise the ten alarms."""


@pytest.mark.parametrize(("unit", "failure", "instance", "lines"), SAME)
def test_a_number_means_what_a_line_means(
    unit: Unit, failure: Failure, instance: int, lines: tuple[str, ...]
) -> None:
    meant = tuple(read_order(line, NOW_US) for line in lines)
    assert faults_of(unit, failure, instance, NOW_US) == meant


def check_effect(unit: Unit, failure: Failure) -> None:
    faults = faults_of(unit, failure, 0, NOW_US)
    assert faults
    assert all(isinstance(fault, Fault) and fault.kind in kinds_of(unit) for fault in faults)


def test_every_injected_fault_can_be_removed() -> None:
    assert failures(check_effect, sorted(EFFECTS)) == []


@pytest.mark.parametrize(
    ("unit", "failure", "instance"),
    [
        (55, 1, 0),
        (Unit.GPS, 7, 0),
        (Unit.GPS, Failure.OFF, 2),
        (Unit.MOTOR, Failure.OFF, 5),
        (Unit.GYRO, 1, 4),
    ],
)
def test_what_there_is_not_cannot_be_broken(unit: int, failure: int, instance: int) -> None:
    assert faults_of(unit, failure, instance, NOW_US) is None
