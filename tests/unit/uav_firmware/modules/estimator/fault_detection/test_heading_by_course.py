"""The heading by the course of GPS: found when it is wrong, and not seen where it is right."""

import cmath
import math

import numpy as np
import pytest

from tests.unit.uav_firmware.modules.estimator.flight import Readings, Rig, recorded
from uav_firmware.lib.rotation import IDENTITY
from uav_firmware.modules.estimator.fault_detection.heading_by_course import (
    HeadingByCourse,
    InertialCourse,
    Pair,
    is_wrong,
    turn_of,
)
from uav_firmware.msg.sensors import SensorsStatus

FIX_US = 100_000


def moving(
    angle: float, *, late_s: float = 0.0, jump_m_s: float = 0.0, tilt_m_s2: float = 0.0
) -> list[Pair]:
    """Fixes of a vehicle that circles and accelerates, its heading wrong by `angle` [rad]."""
    random = np.random.default_rng(1)

    def velocity(t: float) -> complex:
        return 2.0 * cmath.exp(0.5j * t) + 1.5 * math.sin(0.9 * t)

    pairs = []
    for number in range(100):
        t = 0.1 * number
        noise = complex(*(0.05 * random.standard_normal(2)))
        gps = velocity(t - late_s) + noise + (jump_m_s if t > 5.0 else 0.0)
        inertial = velocity(t) * cmath.exp(-1j * angle) + tilt_m_s2 * t + complex(7.0, -3.0)
        pairs.append(Pair(number * FIX_US, inertial.real, inertial.imag, gps.real, gps.imag))
    return pairs


@pytest.mark.parametrize("angle_deg", [-170.0, -90.0, 60.0, 180.0])
def test_a_heading_that_is_wrong_is_found(angle_deg: float) -> None:
    check, angle = HeadingByCourse(), math.radians(angle_deg)
    found = [turn for pair in moving(angle) if (turn := check.update(pair)) is not None]
    assert found
    assert abs(math.remainder(found[0] - angle, math.tau)) < math.radians(5.0)


def test_a_heading_is_wrong_only_by_several_fixes_on_end() -> None:
    check, pairs = HeadingByCourse(), moving(math.pi / 2.0)
    found = next(n for n, pair in enumerate(pairs) if check.update(pair) is not None)
    windows = (pairs[max(0, end - 26) : end] for end in range(8, found + 2))
    signs = [turn is not None and is_wrong(turn) for turn in map(turn_of, windows)]
    assert signs[-4:] == [True] * 4
    assert not any(signs[:-4])


@pytest.mark.parametrize(
    "pairs",
    [
        moving(0.0),
        moving(0.3),
        moving(0.0, late_s=0.4),
        moving(0.0, jump_m_s=2.0),
        moving(0.0, tilt_m_s2=0.5),
    ],
    ids=["right", "17 degrees off", "late", "jump", "tilt"],
)
def test_nothing_else_looks_like_a_wrong_heading(pairs: list[Pair]) -> None:
    check = HeadingByCourse()
    assert all(check.update(pair) is None for pair in pairs)


def test_a_vehicle_that_stands_in_the_air_says_nothing() -> None:
    check, random = HeadingByCourse(), np.random.default_rng(2)
    for number in range(3000):
        north, east, by_north, by_east = (0.1 * random.standard_normal(4)).tolist()
        assert check.update(Pair(number * FIX_US, north, east, by_north, by_east)) is None


def test_velocities_that_do_not_change_give_no_angle() -> None:
    assert turn_of([Pair(number * FIX_US, 1.0, 2.0, 3.0, 4.0) for number in range(20)]) is None


def test_a_receiver_that_was_silent_begins_anew() -> None:
    check = HeadingByCourse()
    for number, pair in enumerate(moving(1.5)):
        assert check.update(pair._replace(time_us=number * 6 * FIX_US)) is None


def test_the_inertial_course_keeps_the_bias_in_and_a_second_back() -> None:
    course = InertialCourse()
    assert course.at(0) is None
    for step in range(1, 501):  # 1 m/s^2 north by the sensor, of which half is held for bias
        course.add(step * 4000, (0.002, 0.0, 0.0), IDENTITY, (0.5, 0.0, 0.0), 0.004)
    assert course.at(500_000) is None
    for time_us in (1_500_000, 1_507_000, 2_000_000):
        north, east = course.at(time_us) or (0.0, 0.0)
        assert north == pytest.approx(time_us * 1e-6)
        assert east == 0.0


def turned(readings: Readings, angle: float) -> Readings:
    """What a compass measures that is turned about the vertical by an angle [rad]."""
    if readings.mag is None:
        return readings
    x, y, z = readings.mag.field_frd
    cosine, sine = math.cos(angle), math.sin(angle)
    field = (cosine * x - sine * y, sine * x + cosine * y, z)
    return readings._replace(mag=readings.mag._replace(field_frd=field))


@pytest.mark.first_case
@pytest.mark.parametrize("angle_deg", [75.0, 180.0])
def test_a_compass_that_is_wrong_from_the_start_costs_no_position(angle_deg: float) -> None:
    rig, angle = Rig(), math.radians(angle_deg)
    rig.sensors.publish(SensorsStatus(0, 0, 0, 0, 0, gyros_agree=True, accels_agree=True))
    for readings in recorded(1).steps(60.0):
        rig.feed(turned(readings, angle))
    assert rig.status.value is not None
    set_us = rig.status.value.heading_set_us
    assert set_us is not None
    assert set_us < 22_000_000
    assert not rig.status.value.accel_broken
    assert rig.position.position_valid
    assert np.abs(rig.position_error(readings.truth)).max() < 0.8
    assert np.abs(rig.attitude_error(readings.truth)).max() < math.radians(8.0)


def test_a_single_gyroscope_proves_no_heading_wrong() -> None:
    """It may be its bias that has jumped."""
    rig = Rig()
    rig.sensors.publish(SensorsStatus(0, 0, 0, 0, 0, gyros_agree=False, accels_agree=False))
    for readings in recorded(1).steps(30.0):
        rig.feed(turned(readings, math.radians(75.0)))
    assert rig.status.value is not None
    assert rig.status.value.heading_set_us is None
