import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.position_control.control_math import (
    ThrustLimits,
    acceleration_of,
    shorten_horizontal,
    thrust_vector,
)
from uav_firmware.msg.vectors import Vector3

LIMITS = ThrustLimits(minimum=0.05, maximum=0.9, horizontal_margin=0.15, tilt=math.radians(35.0))
HOVER = 0.25
accelerations = st.tuples(*[st.floats(-50.0, 50.0)] * 3)


def test_no_acceleration_is_the_hover_thrust_straight_up() -> None:
    assert thrust_vector((0.0, 0.0, 0.0), HOVER, LIMITS) == pytest.approx((0.0, 0.0, -HOVER))


@pytest.mark.parametrize(
    ("acceleration", "axis", "sign"),
    [((1.0, 0.0, 0.0), 0, 1), ((0.0, -1.0, 0.0), 1, -1), ((0.0, 0.0, -1.0), 2, -1)],
)
def test_thrust_points_where_the_acceleration_leads(
    acceleration: Vector3, axis: int, sign: int
) -> None:
    hover = thrust_vector((0.0, 0.0, 0.0), HOVER, LIMITS)
    assert sign * (thrust_vector(acceleration, HOVER, LIMITS)[axis] - hover[axis]) > 0.0


@given(accelerations)
def test_thrust_keeps_every_limit(acceleration: Vector3) -> None:
    north, east, down = thrust_vector(acceleration, HOVER, LIMITS)
    assert math.hypot(north, east, down) <= LIMITS.maximum + 1e-9
    assert -down >= LIMITS.minimum - 1e-9
    assert math.atan2(math.hypot(north, east), -down) <= LIMITS.tilt + 1e-9


@given(accelerations)
def test_the_horizontal_direction_is_kept(acceleration: Vector3) -> None:
    north, east, _ = thrust_vector(acceleration, HOVER, LIMITS)
    assert north * acceleration[1] == pytest.approx(east * acceleration[0], abs=1e-6)


def test_height_comes_before_place_but_leaves_a_margin() -> None:
    north, _, down = thrust_vector((20.0, 0.0, -60.0), HOVER, LIMITS)
    assert north == pytest.approx(LIMITS.horizontal_margin, rel=1e-6)
    assert -down == pytest.approx(math.sqrt(0.9**2 - 0.15**2))


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_acceleration_and_thrust_invert_each_other_inside_the_limits(
    acceleration: Vector3,
) -> None:
    thrust = thrust_vector(acceleration, HOVER, LIMITS)
    assert acceleration_of(thrust, HOVER) == pytest.approx(acceleration, abs=1e-9)


def test_gravity_is_what_free_fall_shows() -> None:
    assert acceleration_of((0.0, 0.0, 0.0), HOVER) == (0.0, 0.0, STANDARD_GRAVITY_M_S2)


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.floats(0.1, 10.0))
def test_shortening_keeps_direction_and_limit(x: float, y: float, limit: float) -> None:
    short_x, short_y = shorten_horizontal(x, y, limit)
    assert math.hypot(short_x, short_y) <= limit * (1.0 + 1e-9)
    assert short_x * y == pytest.approx(short_y * x, abs=1e-9)
    assert short_x * x >= 0.0
