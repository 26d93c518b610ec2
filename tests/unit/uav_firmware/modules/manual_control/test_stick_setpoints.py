"""Stick laws: direction first, then magnitude."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from uav_firmware.lib.rotation import rotate, tilt_of, to_euler
from uav_firmware.modules.manual_control.stick_setpoints import (
    DescentSlope,
    ThrottleCurve,
    attitude,
    body_rates,
    climb_velocity,
    thrust,
    tilt_acceleration,
)
from uav_firmware.modules.manual_control.stick_shaping import limited_to_circle
from uav_firmware.msg.control_mode import ManualControlSetpoint

TILT = math.radians(35.0)
CURVE = ThrottleCurve(least=0.08, hover=0.225, most=0.9)
SLOPE = DescentSlope(high=10.0, low=5.0, fast=1.5, slow=0.7, braking=2.0)
sticks = st.floats(-1.0, 1.0)
yaws = st.floats(-math.pi, math.pi)


def test_forward_lowers_the_nose_and_right_lowers_the_right_side() -> None:
    _, pitch, _ = to_euler(attitude(1.0, 0.0, 0.0, TILT))
    roll, _, _ = to_euler(attitude(0.0, 1.0, 0.0, TILT))
    assert pitch == pytest.approx(-TILT)
    assert roll == pytest.approx(TILT)


@given(sticks, sticks, yaws)
def test_tilt_is_proportional_to_deflection_and_heading_stays(
    x: float, y: float, yaw: float
) -> None:
    forward, right = limited_to_circle(x, y)
    q = attitude(forward, right, yaw, TILT)
    assert tilt_of(q) == pytest.approx(math.hypot(forward, right) * TILT, abs=1e-6)
    assert math.cos(to_euler(q)[2] - yaw) > math.cos(TILT * TILT)


@given(sticks, sticks, yaws)
def test_attitude_and_acceleration_give_the_same_tilt(x: float, y: float, yaw: float) -> None:
    forward, right = limited_to_circle(x, y)
    up = rotate(attitude(forward, right, yaw, TILT), (0.0, 0.0, -1.0))
    north, east, down = tilt_acceleration(forward, right, yaw, TILT)
    assert down == 0.0
    assert (north, east) == pytest.approx(
        (-up[0] / up[2] * 9.80665, -up[1] / up[2] * 9.80665), abs=1e-6
    )


def test_up_climbs_and_down_descends() -> None:
    assert climb_velocity(1.0, 3.0, 1.5) == -3.0
    assert climb_velocity(-1.0, 3.0, 1.5) == 1.5
    assert climb_velocity(0.0, 3.0, 1.5) == 0.0


@given(sticks)
@example(-1.0)
@example(1.0)
def test_thrust_rises_with_the_stick_and_hovers_in_the_centre(up: float) -> None:
    assert thrust(0.0, CURVE, landed=False) == CURVE.hover
    share = thrust(up, CURVE, landed=False)
    assert CURVE.least <= share <= CURVE.most
    assert (share > CURVE.hover) == (up > 0.0) or abs(up) < 1e-12


def test_stick_down_on_the_ground_gives_zero_thrust() -> None:
    assert thrust(-1.0, CURVE, landed=True) == 0.0
    assert thrust(-0.5, CURVE, landed=True) > 0.0


def test_body_rates_have_the_signs_of_the_sticks() -> None:
    limits = (1.0, 2.0, 3.0)
    assert body_rates(ManualControlSetpoint(0, 0.0, 1.0, 0.0, 0.0), limits)[0] == 1.0
    assert body_rates(ManualControlSetpoint(0, 1.0, 0.0, 0.0, 0.0), limits)[1] == -2.0
    assert body_rates(ManualControlSetpoint(0, 0.0, 0.0, 0.0, 1.0), limits)[2] == 3.0


@given(st.floats(-5.0, 50.0), st.floats(-5.0, 50.0))
def test_descent_is_slower_near_the_ground(a: float, b: float) -> None:
    low, high = sorted((a, b))
    assert SLOPE.slow <= SLOPE.limit(low) <= SLOPE.limit(high) <= SLOPE.fast


@given(st.floats(1.0, 50.0), st.floats(1.0, 30.0), st.floats(0.5, 4.0), st.floats(-5.0, 60.0))
def test_a_descent_can_always_slow_down_in_time(
    high: float, low: float, fast: float, height: float
) -> None:
    """Also where the heights of the slope leave no way between them, or are exchanged."""
    slope = DescentSlope(high, low, fast, slow=0.5, braking=2.0)
    way = (slope.limit(height) ** 2 - 0.5**2) / (2.0 * 2.0)
    assert way <= max(0.0, height - low) + 1e-9
    assert 0.5 <= slope.limit(height) <= fast
