"""Attitudes: signs first, then what holds for all of them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.truth import Quaternion, Vector3, body_from_ned, quaternion_from_euler

NORTH: Vector3 = (1.0, 0.0, 0.0)
DOWN: Vector3 = (0.0, 0.0, 1.0)

angles = st.floats(-math.pi, math.pi)
tilts = st.floats(-math.pi / 2, math.pi / 2)
components = st.floats(-100.0, 100.0)


def test_nose_to_the_east_sees_north_on_its_left() -> None:
    q = quaternion_from_euler(0.0, 0.0, math.pi / 2)
    assert body_from_ned(q, NORTH) == pytest.approx((0.0, -1.0, 0.0), abs=1e-12)


def test_nose_up_sees_down_behind() -> None:
    x, _, z = body_from_ned(quaternion_from_euler(0.0, 0.3, 0.0), DOWN)
    assert x < 0.0 < z


def test_right_side_down_sees_down_on_the_right() -> None:
    _, y, z = body_from_ned(quaternion_from_euler(0.3, 0.0, 0.0), DOWN)
    assert min(y, z) > 0.0


@given(angles, tilts, angles)
def test_an_attitude_is_a_unit_quaternion_with_its_scalar_not_negative(
    roll: float, pitch: float, yaw: float
) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    assert q[0] >= 0.0
    assert math.hypot(*q) == pytest.approx(1.0)


@given(angles, tilts, angles)
def test_the_nose_points_where_the_euler_angles_say(roll: float, pitch: float, yaw: float) -> None:
    nose_ned = (
        math.cos(pitch) * math.cos(yaw),
        math.cos(pitch) * math.sin(yaw),
        -math.sin(pitch),
    )
    q = quaternion_from_euler(roll, pitch, yaw)
    assert body_from_ned(q, nose_ned) == pytest.approx(NORTH, abs=1e-9)


@given(angles, tilts, angles, st.tuples(components, components, components))
def test_turning_a_vector_keeps_its_length(
    roll: float, pitch: float, yaw: float, vector: Vector3
) -> None:
    q: Quaternion = quaternion_from_euler(roll, pitch, yaw)
    assert math.hypot(*body_from_ned(q, vector)) == pytest.approx(math.hypot(*vector), abs=1e-9)
