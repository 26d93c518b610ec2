import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.rotation_vectors import from_rotation_vector, to_rotation_vector
from uav_firmware.lib.rotation import (
    from_euler,
    multiply,
    normalise,
    tilt_of,
    yaw_of,
)
from uav_firmware.modules.attitude_control.controller import (
    AttitudeGains,
    error_quaternion,
    rate_setpoint,
)
from uav_firmware.msg.vectors import Quaternion, Vector3

GAINS = AttitudeGains(p_frd=(6.5, 6.5, 2.8), yaw_weight=0.4, rate_limit_frd=(4.0, 4.0, 2.0))
NO_LIMITS = GAINS._replace(rate_limit_frd=(1e3, 1e3, 1e3))
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)

components = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(components, components, components, components)
    .filter(lambda q: sum(c * c for c in q) > 0.01)
    .map(normalise)
)


def test_a_wanted_right_roll_turns_right() -> None:
    assert rate_setpoint(LEVEL, from_euler(0.1, 0.0, 0.0), 0.0, GAINS)[0] > 0.0


def test_a_wanted_nose_up_turns_up() -> None:
    assert rate_setpoint(LEVEL, from_euler(0.0, 0.1, 0.0), 0.0, GAINS)[1] > 0.0


def test_a_wanted_heading_to_the_right_turns_right() -> None:
    assert rate_setpoint(LEVEL, from_euler(0.0, 0.0, 0.1), 0.0, GAINS)[2] > 0.0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_small_error_gives_the_gain_times_the_angle(axis: int) -> None:
    rotation = [0.0, 0.0, 0.0]
    rotation[axis] = 0.01
    wanted = from_rotation_vector((rotation[0], rotation[1], rotation[2]))
    rate = rate_setpoint(LEVEL, wanted, 0.0, GAINS)
    assert rate[axis] == pytest.approx(GAINS.p_frd[axis] * 0.01, rel=1e-3)
    assert max(abs(r) for i, r in enumerate(rate) if i != axis) < 1e-6


@given(quaternions, quaternions)
def test_both_signs_of_a_quaternion_are_the_same_attitude(
    present: Quaternion, wanted: Quaternion
) -> None:
    negative = (-wanted[0], -wanted[1], -wanted[2], -wanted[3])
    if abs(error_quaternion(present, wanted)[0]) < 1e-9:
        return  # exactly half a turn: both ways round are equally short
    assert rate_setpoint(present, wanted, 0.0, GAINS) == pytest.approx(
        rate_setpoint(present, negative, 0.0, GAINS), abs=1e-9
    )


@given(quaternions, quaternions)
def test_rates_stay_within_their_limits(present: Quaternion, wanted: Quaternion) -> None:
    rates = rate_setpoint(present, wanted, 3.0, GAINS)
    for rate, limit in zip(rates, GAINS.rate_limit_frd, strict=True):
        assert abs(rate) <= limit


@given(quaternions)
def test_no_error_means_no_rate(attitude: Quaternion) -> None:
    assert rate_setpoint(attitude, attitude, 0.0, GAINS) == pytest.approx((0, 0, 0), abs=1e-9)


def test_every_attitude_is_reached_from_every_other() -> None:
    steps = [-3.0, -1.5, 0.0, 1.0, 2.5]
    attitudes = [
        from_euler(roll, pitch, yaw)
        for roll, pitch, yaw in itertools.product(steps, [-1.2, 0.3, 1.0], steps)
    ]
    for present, wanted in zip(attitudes, attitudes[7:] + attitudes[:7], strict=True):
        settled = _settle(present, wanted, seconds=8.0)
        error = to_rotation_vector(error_quaternion(settled, wanted))
        assert math.dist(error, (0.0, 0.0, 0.0)) < 0.02


def test_the_thrust_is_righted_before_the_heading() -> None:
    wanted = from_euler(0.3, 0.0, 1.5)
    part_way = _settle(LEVEL, wanted, seconds=0.4)
    assert tilt_of(multiply(part_way, LEVEL)) > 0.2
    assert yaw_of(part_way) < 1.2


def test_a_yaw_rate_is_turned_about_the_worlds_axis() -> None:
    on_its_side = from_euler(math.pi / 2.0, 0.0, 0.0)
    rates = rate_setpoint(on_its_side, on_its_side, 1.0, GAINS)
    assert rates == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)


def _settle(present: Quaternion, wanted: Quaternion, *, seconds: float) -> Quaternion:
    """Turn a body that follows its rates at once."""
    dt = 0.01
    for _ in range(round(seconds / dt)):
        rate = rate_setpoint(present, wanted, 0.0, NO_LIMITS)
        turn: Vector3 = (rate[0] * dt, rate[1] * dt, rate[2] * dt)
        present = normalise(multiply(present, from_rotation_vector(turn)))
    return present
