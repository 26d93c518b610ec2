"""Drag and airspeed are inverse to each other; each term by itself is what it should be."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.drag import DragModel

F450 = DragModel(87.0, 87.0, 0.295)
DENSITY = 1.15
speeds = st.floats(-60.0, 60.0)
ballistic = st.floats(1.0, 200.0)


def drag_of(model: DragModel, airspeed: tuple[float, float], density: float) -> tuple[float, float]:
    """Deceleration [m/s^2] along x and y of an airspeed along them."""
    x, y = model.factors_per_s(math.hypot(*airspeed), density)
    return x * airspeed[0], y * airspeed[1]


@given(speeds, speeds, ballistic, ballistic, st.floats(0.01, 1.0), st.floats(0.4, 1.4))
def test_the_airspeed_of_a_drag_is_the_airspeed_that_makes_it(
    forward: float,
    right: float,
    along_x: float,
    along_y: float,
    momentum: float,
    density: float,
) -> None:
    model, airspeed = DragModel(along_x, along_y, momentum), (forward, right)
    drag = drag_of(model, airspeed, density)
    assert model.airspeed_xy(drag, density) == pytest.approx(airspeed, rel=1e-6, abs=1e-6)


@given(st.floats(0.0, 30.0), st.floats(0.0, 30.0))
def test_more_airspeed_more_drag(one: float, other: float) -> None:
    slow, fast = sorted((one, other))
    assert drag_of(F450, (slow, 0.0), DENSITY) <= drag_of(F450, (fast, 0.0), DENSITY)


def test_six_metres_a_second_make_two_metres_a_second_squared() -> None:
    # Rotors 4 * 0.1 N s/m, body 0.0161 m^2, 1.4 kg
    assert drag_of(F450, (6.0, 0.0), DENSITY)[0] == pytest.approx(1.714 + 0.238, rel=0.005)


def test_without_rotors_it_is_the_law_of_the_square_along_each_axis() -> None:
    narrow = DragModel(50.0, 25.0, 0.0)
    assert drag_of(narrow, (10.0, 0.0), 1.0) == pytest.approx((1.0, 0.0))
    assert drag_of(narrow, (0.0, -10.0), 1.0) == pytest.approx((0.0, -2.0))
