"""A jump that several gyroscopes show alike is proved by its form; nothing else has that form."""

import cmath
import math
import random
from collections.abc import Callable
from typing import Final

import numpy as np
import pytest

from tests.support.messages import changed
from tests.unit.uav_firmware.modules.estimator.flight import Rig, recorded
from uav_firmware.modules.estimator.fault_detection.common_gyro_jump import (
    CommonJump,
    CommonJumpProof,
)
from uav_firmware.modules.estimator.fault_detection.heading_by_course import Pair
from uav_firmware.msg.sensors import SensorsStatus

FIX_US: Final = 100_000
NOISE_M_S: Final = 0.05
GRAVITY: Final = 9.81
AGREES_M_S: Final = 0.05  # Position and velocity of a receiver

Course = Callable[[float], complex]


def courses() -> tuple[Course, Course]:
    """A hover, and a flight with turns of up to 2 m/s^2 [m/s]."""
    return lambda t: 0.1j * t, lambda t: 4.0 * cmath.exp(0.5j * t) + 0.3 * t


def judge(
    inertial: Course,
    gps: Course,
    *,
    apart_m_s: float = AGREES_M_S,
    turned: Course = lambda _: 0j,
    force_stepped: bool = False,
    seconds: float = 20.0,
) -> tuple[float, CommonJump] | None:
    """When a jump is proved first [s], and which."""
    proof, noise = CommonJumpProof(), random.Random(1)
    for number in range(round(seconds * 1e6 / FIX_US)):
        t = number * FIX_US * 1e-6
        w, g, c = inertial(t), gps(t), turned(t)
        north, east = g.real + noise.gauss(0, NOISE_M_S), g.imag + noise.gauss(0, NOISE_M_S)
        pair = Pair(number * FIX_US, w.real, w.imag, north, east)
        turned_ned = (c.real, c.imag, 0.0)
        jump = proof.update(pair, turned_ned, apart_m_s, 0.05, force_stepped=force_stepped)
        if jump is not None:
            return t, jump
    return None


def jumped(course: Course, rate_deg_s: float, at_s: float = 8.0) -> Course:
    rate = math.radians(rate_deg_s)
    return lambda t: course(t) + 0.5j * GRAVITY * rate * max(0.0, t - at_s) ** 2


@pytest.mark.parametrize("course", courses())
@pytest.mark.parametrize(("rate_deg_s", "within_s"), [(2.0, 4.5), (-3.0, 3.5), (10.0, 2.0)])
def test_a_jump_is_proved_and_measured(course: Course, rate_deg_s: float, within_s: float) -> None:
    found = judge(course, jumped(course, rate_deg_s))
    assert found is not None
    time_s, jump = found
    assert 8.0 < time_s < 8.0 + within_s
    assert jump.rate == pytest.approx(math.radians(abs(rate_deg_s)), rel=0.4)
    assert jump.since_s == pytest.approx(time_s - 8.0, abs=0.7)


def test_what_the_filter_has_turned_meanwhile_is_taken_out() -> None:
    """It follows a third of the tilt that grows."""
    share, rate, (hover, _) = 0.33, math.radians(3.0), courses()
    whole = jumped(hover, 3.0)
    followed = lambda t: hover(t) + share * (whole(t) - hover(t))  # noqa: E731 - a course
    # To the east the velocity grows by a tilt about north
    found = judge(followed, whole, turned=lambda t: share * rate * max(0.0, t - 8.0) + 0j)
    assert found is not None
    assert found[1].rate == pytest.approx(rate, rel=0.3)


@pytest.mark.parametrize("course", courses())
@pytest.mark.parametrize(
    "lie",
    [
        lambda course: lambda t: course(t) + (2.0 - 1.0j if t > 8.0 else 0j),
        lambda course: lambda t: course(t) + 0.8 * t,
        lambda course: lambda t: course(t - 0.6),
        lambda course: lambda t: course(t - 2.0),
        lambda course: lambda t: cmath.exp(0.5j) * course(t),
        lambda course: lambda t: -course(t),
    ],
    ids=["steps", "tilt", "late", "very late", "turned by 29 degrees", "turned round"],
)
def test_nothing_else_is_taken_for_a_jump(course: Course, lie: Callable[[Course], Course]) -> None:
    assert judge(course, lie(course)) is None


@pytest.mark.parametrize("course", courses())
def test_accelerometers_that_jump_alike_are_told_apart_by_their_force(course: Course) -> None:
    biased: Course = lambda t: course(t) + 0.8 * max(0.0, t - 8.0)  # noqa: E731 - a course
    assert judge(course, biased, force_stepped=True) is None
    assert judge(course, jumped(course, 3.0), force_stepped=True) is not None


def test_a_heading_that_is_wrong_while_the_vehicle_runs_away_is_no_jump() -> None:
    away: Course = lambda t: 0.02 * cmath.exp((0.4 + 0.3j) * t)  # noqa: E731 - a course
    assert judge(away, lambda t: 1j * away(t), seconds=15.0) is None


def test_a_velocity_that_its_position_contradicts_is_no_jump() -> None:
    hover, _ = courses()
    assert judge(hover, jumped(hover, 3.0), apart_m_s=math.inf) is None


def test_a_receiver_that_was_silent_begins_anew() -> None:
    proof, gps = CommonJumpProof(), jumped(lambda _: 0j, 3.0, 0.0)
    for number in range(20):
        velocity = gps(0.6 * number)
        pair = Pair(number * 6 * FIX_US, 0.0, 0.0, velocity.real, velocity.imag)
        assert proof.update(pair, (0.0, 0.0, 0.0), AGREES_M_S, 0.05, force_stepped=False) is None


@pytest.mark.first_case
@pytest.mark.parametrize("jump_deg_s", [(3.0, -3.0, 0.0), (0.0, 6.0, 3.0)])
def test_the_filter_follows_several_gyroscopes_that_jump_alike(
    jump_deg_s: tuple[float, float, float],
) -> None:
    rig = Rig()
    rig.sensors.publish(SensorsStatus(0, 0, 0, 0, 0, gyros_agree=True, accels_agree=True))
    for readings in recorded(1).steps(35.0):
        imu = readings.imu
        if readings.truth.time_us > 20_000_000:
            x, y, z = map(math.radians, jump_deg_s)
            p, q, r = imu.rate_frd
            imu = changed(imu, rate_frd=(p + x, q + y, r + z))
        rig.feed(readings._replace(imu=imu))
    assert rig.status.value is not None
    assert rig.status.value.gyro_jump_us is not None
    assert not rig.status.value.accel_broken
    assert rig.position.position_valid
    assert np.abs(rig.position_error(readings.truth)).max() < 0.8
    assert np.abs(rig.attitude_error(readings.truth)[:2]).max() < math.radians(3.0)
