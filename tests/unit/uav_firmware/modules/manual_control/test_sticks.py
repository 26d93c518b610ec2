"""Shapes of the sticks: odd, rising, within range, without a step."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.manual_control.sticks import (
    Curves,
    curved,
    dead_zoned,
    in_circle,
    shaped,
    turned,
)
from uav_firmware.msg.control_mode import ManualControlSetpoint

deflections = st.floats(-1.0, 1.0)
shares = st.floats(0.0, 1.0)
zones = st.floats(0.0, 0.8)


@given(deflections, zones, shares)
def test_a_stick_the_other_way_does_the_opposite(stick: float, zone: float, expo: float) -> None:
    there = curved(dead_zoned(stick, zone), expo)
    back = curved(dead_zoned(-stick, zone), expo)
    assert there == -back


@given(deflections, deflections, zones, shares)
def test_more_deflection_never_does_less(a: float, b: float, zone: float, expo: float) -> None:
    low, high = sorted((a, b))
    below, above = (curved(dead_zoned(stick, zone), expo) for stick in (low, high))
    assert below <= above + 1e-12


@given(zones, shares)
def test_the_ends_stay_the_ends_and_the_centre_is_quiet(zone: float, expo: float) -> None:
    assert curved(dead_zoned(1.0, zone), expo) == pytest.approx(1.0)
    assert dead_zoned(0.99 * zone, zone) == 0.0
    assert dead_zoned(zone + 1e-6, zone) < 1e-4


@given(deflections, deflections)
def test_both_sticks_together_are_no_more_than_one(x: float, y: float) -> None:
    inside = in_circle(x, y)
    assert math.hypot(*inside) <= 1.0 + 1e-12
    assert inside[0] * y == pytest.approx(inside[1] * x)


@given(deflections, deflections, deflections, deflections)
def test_shaped_sticks_are_sticks(x: float, y: float, z: float, r: float) -> None:
    curves = Curves(0.1, 0.6, 0.6, 0.6)
    result = shaped(ManualControlSetpoint(5, x, y, z, r), curves)
    assert result.time_us == 5
    assert all(-1.0 <= axis <= 1.0 for axis in result[1:])


@pytest.mark.parametrize(
    ("yaw_deg", "wanted"), [(0.0, (1.0, 0.0)), (90.0, (0.0, 1.0)), (180.0, (-1.0, 0.0))]
)
def test_forward_is_where_the_nose_points(yaw_deg: float, wanted: tuple[float, float]) -> None:
    assert turned(1.0, 0.0, math.radians(yaw_deg)) == pytest.approx(wanted, abs=1e-12)
