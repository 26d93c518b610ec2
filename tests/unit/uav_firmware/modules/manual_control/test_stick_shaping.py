"""Shapes of the sticks: odd, rising, within range, without a step."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.manual_control.stick_shaping import (
    Curves,
    limited_to_circle,
    shaped,
    with_dead_zone,
    with_expo,
)
from uav_firmware.msg.control_mode import ManualControlSetpoint

deflections = st.floats(-1.0, 1.0)
shares = st.floats(0.0, 1.0)
zones = st.floats(0.0, 0.8)


@given(deflections, zones, shares)
def test_shaping_is_odd(stick: float, zone: float, expo: float) -> None:
    there = with_expo(with_dead_zone(stick, zone), expo)
    back = with_expo(with_dead_zone(-stick, zone), expo)
    assert there == -back


@given(deflections, deflections, zones, shares)
def test_shaping_is_monotonic(a: float, b: float, zone: float, expo: float) -> None:
    low, high = sorted((a, b))
    below, above = (with_expo(with_dead_zone(stick, zone), expo) for stick in (low, high))
    assert below <= above + 1e-12


@given(zones, shares)
def test_ends_and_centre_are_fixed(zone: float, expo: float) -> None:
    assert with_expo(with_dead_zone(1.0, zone), expo) == pytest.approx(1.0)
    assert with_dead_zone(0.99 * zone, zone) == 0.0
    assert with_dead_zone(zone + 1e-6, zone) < 1e-4


@given(deflections, deflections)
def test_two_axes_together_are_limited_to_one(x: float, y: float) -> None:
    inside = limited_to_circle(x, y)
    assert math.hypot(*inside) <= 1.0 + 1e-12
    assert inside[0] * y == pytest.approx(inside[1] * x)


@given(deflections, deflections, deflections, deflections)
def test_shaped_sticks_are_within_range(x: float, y: float, z: float, r: float) -> None:
    curves = Curves(0.1, 0.6, 0.6, 0.6)
    result = shaped(ManualControlSetpoint(5, x, y, z, r), curves)
    assert result.time_us == 5
    assert all(-1.0 <= axis <= 1.0 for axis in result[1:])
