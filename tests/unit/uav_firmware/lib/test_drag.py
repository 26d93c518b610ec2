"""Drag and airspeed are inverse to each other; each term by itself is what it should be."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.drag import DragModel

F450 = DragModel(87.0, 0.295)
DENSITY = 1.15


@given(st.floats(0.0, 60.0), st.floats(1.0, 200.0), st.floats(0.0, 1.0), st.floats(0.4, 1.4))
def test_the_airspeed_of_a_drag_is_the_airspeed_that_makes_it(
    airspeed: float, ballistic: float, momentum: float, density: float
) -> None:
    model = DragModel(ballistic, momentum)
    drag = model.drag_m_s2(airspeed, density)
    assert model.airspeed_m_s(drag, density) == pytest.approx(airspeed, rel=1e-9, abs=1e-9)


@given(st.floats(0.0, 30.0), st.floats(0.0, 30.0))
def test_more_airspeed_more_drag(one: float, other: float) -> None:
    slow, fast = sorted((one, other))
    assert F450.drag_m_s2(slow, DENSITY) <= F450.drag_m_s2(fast, DENSITY)


def test_six_metres_a_second_make_two_metres_a_second_squared() -> None:
    # Rotors 4 * 0.1 N s/m, body 0.0161 m^2, 1.4 kg
    assert F450.drag_m_s2(6.0, DENSITY) == pytest.approx(1.714 + 0.238, rel=0.005)


def test_without_rotors_it_is_the_law_of_the_square() -> None:
    assert DragModel(50.0, 0.0).drag_m_s2(10.0, 1.0) == pytest.approx(1.0)
