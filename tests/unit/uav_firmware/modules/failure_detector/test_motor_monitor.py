"""Motors judged by their speed: quickly when they stop, never when they are only slow to rise."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.failure_detector.motor_monitor import MotorLimits, MotorMonitor
from uav_firmware.msg.vectors import Motors

DT = 0.008
LIMITS = MotorLimits(
    full_speed_rpm=10650.0, least_command=0.2, least_share=0.7, time_s=0.024, weak_share=0.9
)
HOVER: Motors = (0.42, 0.42, 0.42, 0.42)


def steady_rpm(command: float) -> float:
    return 10650.0 * command * (1.23 - 0.23 * command)


class Rotors:
    """Four rotors with the F450's lag, and their monitor."""

    def __init__(self) -> None:
        self.monitor = MotorMonitor(LIMITS)
        self.speeds = [0.0] * 4
        self.dead: set[int] = set()
        self.grip = 1.0  # Share of the speed that all of them reach

    def run(
        self, seconds: float, command: Motors, lag_s: float = 0.056, *, is_carried: bool = False
    ) -> int:
        failed = 0
        for _ in range(round(seconds / DT)):
            for motor in range(4):
                goal = 0.0 if motor in self.dead else self.grip * steady_rpm(command[motor])
                self.speeds[motor] += (goal - self.speeds[motor]) * (1.0 - math.exp(-DT / lag_s))
            one, two, three, four = self.speeds
            failed = self.monitor.update(
                command, (one, two, three, four), DT, is_carried=is_carried
            )
        return failed


@pytest.mark.parametrize("motor", [0, 1, 2, 3])
def test_a_stopping_motor_is_named_within_a_tenth_of_a_second(motor: int) -> None:
    rotors = Rotors()
    assert rotors.run(1.0, HOVER) == 0
    rotors.dead.add(motor)
    assert rotors.run(0.1, HOVER) == 1 << motor


@pytest.mark.parametrize("said_to_stand", [{0, 1}, {0, 2}, {1, 2, 3}, {0, 1, 2, 3}])
def test_rotors_that_carry_the_vehicle_do_not_stand(said_to_stand: set[int]) -> None:
    rotors = Rotors()
    rotors.run(1.0, HOVER)
    rotors.dead |= said_to_stand
    assert rotors.run(1.0, HOVER, is_carried=True) == 0
    assert rotors.run(1.0, HOVER) == 0  # It descends, or turns: the telemetry is wrong all the same
    rotors.dead.clear()
    assert rotors.run(1.0, HOVER) == 0
    rotors.dead |= said_to_stand
    assert rotors.run(0.2, HOVER) == sum(1 << motor for motor in said_to_stand)


def test_a_single_rotor_that_stands_has_failed_while_the_others_carry_the_vehicle() -> None:
    rotors = Rotors()
    rotors.run(1.0, HOVER)
    rotors.dead.add(2)
    assert rotors.run(0.1, HOVER, is_carried=True) == 0b100


def test_a_motor_that_stops_at_a_blow_is_blocked_first_and_failed_a_tenth_later() -> None:
    monitor = MotorMonitor(LIMITS)
    whole: Motors = tuple(map(steady_rpm, HOVER))  # type: ignore[assignment]  # four of them
    for _ in range(100):
        monitor.update(HOVER, whole, DT)
    seen = []
    for _ in range(25):
        monitor.update(HOVER, (0.0, *whole[1:]), DT, struck=True)
        seen.append((monitor.blocked, monitor.failed))
    assert seen[0] == (0, 0)
    assert seen[3] == (1, 0)
    assert seen[11] == (1, 0)
    assert seen[-1] == (0, 1)


def test_rotors_that_are_all_somewhat_slow_are_a_weak_propulsion_and_no_failed_motor() -> None:
    rotors = Rotors()
    rotors.run(1.0, HOVER)
    before = rotors.monitor.weak
    rotors.grip = 0.8
    rotors.run(2.0, HOVER)
    assert (before, rotors.monitor.weak) == (False, True)
    assert rotors.monitor.failed == 0


def test_one_slow_rotor_is_no_weak_propulsion() -> None:
    rotors = Rotors()
    rotors.run(1.0, HOVER)
    rotors.dead.add(1)
    rotors.run(3.0, HOVER)
    assert not rotors.monitor.weak


@given(
    commands=st.lists(st.tuples(*[st.floats(0.0, 1.0)] * 4), min_size=1, max_size=40),
    lag_s=st.floats(0.02, 0.1),
)
def test_no_commands_make_a_healthy_motor_fail(commands: list[Motors], lag_s: float) -> None:
    rotors = Rotors()
    for command in commands:
        assert rotors.run(0.04, command, lag_s) == 0
        assert not rotors.monitor.weak


IDLE: Motors = (0.055, 0.055, 0.055, 0.055)


def start(monitor: MotorMonitor, stands_s: float) -> int:
    """Rotor 4 stood on three rotors and is ordered to 0.5; it breaks loose after a time."""
    full = steady_rpm(0.5)
    for _ in range(125):
        monitor.update((0.5, 0.5, 0.5, 0.0), (full, full, full, 0.0), DT)
    speed, failed = 0.0, 0
    for number in range(60):
        command = min(0.5, 0.05 * (number + 1))
        if number * DT >= stands_s:
            speed += (steady_rpm(command) - speed) * (1.0 - math.exp(-DT / 0.056))
        failed = monitor.update((0.5, 0.5, 0.5, command), (full, full, full, speed), DT)
    return failed


def test_a_rotor_that_stood_has_time_to_break_loose_and_a_dead_one_is_found() -> None:
    assert start(MotorMonitor(LIMITS), 0.06) == 0
    assert start(MotorMonitor(LIMITS), math.inf) == 8


def test_a_motor_that_is_to_stand_is_not_judged() -> None:
    rotors = Rotors()
    rotors.dead.add(2)
    assert rotors.run(2.0, (0.42, 0.42, 0.0, 0.42)) == 0


@pytest.mark.parametrize("motor", [0, 1, 2, 3])
def test_a_motor_that_stands_while_all_idle_is_found_before_the_take_off(motor: int) -> None:
    rotors = Rotors()
    rotors.dead.add(motor)
    assert rotors.run(0.9, IDLE) == 1 << motor


def test_motors_that_idle_rather_slowly_are_sound() -> None:
    rotors = Rotors()
    rotors.grip = 0.7
    assert rotors.run(5.0, IDLE, lag_s=0.1) == 0


def test_a_failed_motor_stays_failed_until_it_is_forgiven() -> None:
    rotors = Rotors()
    rotors.run(1.0, HOVER)
    rotors.dead.add(0)
    rotors.run(0.2, HOVER)
    rotors.dead.clear()
    assert rotors.run(2.0, HOVER) == 1
    rotors.monitor.rest()
    assert rotors.run(0.2, HOVER) == 1
    rotors.monitor.forgive()
    assert rotors.run(0.2, HOVER) == 0


def test_a_report_that_is_no_number_condemns_nobody() -> None:
    monitor = MotorMonitor(LIMITS)
    for _ in range(100):
        monitor.update(HOVER, (math.nan, math.nan, math.nan, math.nan), DT)
    assert monitor.failed == 0
