import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib import rotation
from uav_firmware.msg.vectors import Quaternion, Vector3

angles = st.floats(-math.pi, math.pi)
components = st.floats(-100.0, 100.0)
vectors = st.tuples(components, components, components)
quaternions = st.builds(rotation.from_euler, angles, st.floats(-math.pi / 2, math.pi / 2), angles)
QUARTER = math.pi / 2


def same_rotation(left: Quaternion, right: Quaternion) -> bool:
    return abs(abs(sum(a * b for a, b in zip(left, right, strict=True))) - 1.0) < 1e-9


def elementary(axis: int, angle: float) -> np.ndarray:
    cosine, sine = math.cos(angle), math.sin(angle)
    first, second = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second], matrix[second, first] = -sine, sine
    return matrix


@pytest.mark.parametrize(
    ("attitude", "forward_ned"),
    [
        pytest.param((0.0, 0.0, QUARTER), (0.0, 1.0, 0.0), id="yaw right looks east"),
        pytest.param((0.0, QUARTER / 2, 0.0), (0.7071, 0.0, -0.7071), id="pitch up lifts nose"),
        pytest.param((QUARTER, 0.0, 0.0), (1.0, 0.0, 0.0), id="roll keeps the nose"),
    ],
)
def test_nose_goes_where_the_pilot_expects(attitude: Vector3, forward_ned: Vector3) -> None:
    nose = rotation.rotate(rotation.from_euler(*attitude), (1.0, 0.0, 0.0))
    assert nose == pytest.approx(forward_ned, abs=1e-4)


def test_roll_right_lowers_the_right_side() -> None:
    right = rotation.rotate(rotation.from_euler(0.3, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert right[2] > 0.0


@given(angles, st.floats(-1.57, 1.57), angles)
def test_euler_angles_are_elementary_turns_yaw_pitch_roll(
    roll: float, pitch: float, yaw: float
) -> None:
    expected = elementary(2, yaw) @ elementary(1, pitch) @ elementary(0, roll)
    matrix = rotation.to_matrix(rotation.from_euler(roll, pitch, yaw))
    assert np.allclose(matrix, expected, atol=1e-12)


@given(angles, st.floats(-1.55, 1.55), angles)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    back = rotation.to_euler(rotation.from_euler(roll, pitch, yaw))
    assert abs(rotation.wrap_pi(back[0] - roll)) < 1e-9
    assert abs(back[1] - pitch) < 1e-9
    assert abs(rotation.wrap_pi(back[2] - yaw)) < 1e-9


@given(quaternions, vectors)
def test_rotation_keeps_length_and_inverse_undoes_it(q: Quaternion, vector: Vector3) -> None:
    turned = rotation.rotate(q, vector)
    assert math.hypot(*turned) == pytest.approx(math.hypot(*vector), abs=1e-9)
    assert rotation.rotate_inverse(q, turned) == pytest.approx(vector, abs=1e-9)


@given(quaternions, quaternions, vectors)
def test_product_turns_by_the_right_factor_first(
    left: Quaternion, right: Quaternion, vector: Vector3
) -> None:
    product = rotation.rotate(rotation.multiply(left, right), vector)
    assert product == pytest.approx(rotation.rotate(left, rotation.rotate(right, vector)), abs=1e-9)


@given(quaternions, vectors)
def test_matrix_and_quaternion_agree(q: Quaternion, vector: Vector3) -> None:
    matrix = rotation.to_matrix(q)
    assert np.array(matrix) @ vector == pytest.approx(rotation.rotate(q, vector), abs=1e-9)
    assert same_rotation(rotation.from_matrix(matrix), q)


@given(quaternions)
def test_conjugate_is_the_inverse(q: Quaternion) -> None:
    assert rotation.multiply(q, rotation.conjugate(q)) == pytest.approx(
        rotation.IDENTITY, abs=1e-12
    )


@given(vectors, angles)
def test_thrust_attitude_pulls_along_the_thrust(thrust: Vector3, yaw: float) -> None:
    length = math.hypot(*thrust)
    q = rotation.from_thrust_direction_and_yaw(thrust, yaw)
    if length > 1e-6:
        up = rotation.rotate(q, (0.0, 0.0, -1.0))
        assert up == pytest.approx([c / length for c in thrust], abs=1e-6)


@given(st.floats(-8, 8), st.floats(-8, 8), st.floats(-20, -1), angles)
def test_thrust_attitude_has_the_yaw(n: float, e: float, d: float, yaw: float) -> None:
    q = rotation.from_thrust_direction_and_yaw((n, e, d), yaw)
    forward = rotation.rotate(q, (1.0, 0.0, 0.0))
    # The nose lies in the vertical plane of the yaw direction.
    assert forward[0] * math.sin(yaw) - forward[1] * math.cos(yaw) == pytest.approx(0, abs=1e-9)
    assert forward[0] * math.cos(yaw) + forward[1] * math.sin(yaw) > 0.0


def test_accelerating_north_while_facing_north_lowers_the_nose() -> None:
    q = rotation.from_thrust_direction_and_yaw((3.0, 0.0, -9.8), 0.0)
    assert rotation.to_euler(q)[1] < -0.2


@pytest.mark.parametrize("thrust", [(0.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
def test_no_thrust_direction_is_upright(thrust: Vector3) -> None:
    q = rotation.from_thrust_direction_and_yaw(thrust, 1.0)
    assert rotation.to_euler(q) == pytest.approx((0.0, 0.0, 1.0))


@given(angles, angles)
def test_tilt_is_zero_only_when_level(roll: float, yaw: float) -> None:
    assert rotation.tilt_of(rotation.from_euler(roll, 0.0, yaw)) == pytest.approx(
        abs(roll), abs=1e-6
    )


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_point_the_same_way(angle: float) -> None:
    wrapped = rotation.wrap_pi(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@pytest.mark.parametrize(
    "q", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0), (math.inf, 0, 0, 0)]
)
def test_a_quaternion_without_direction_is_refused(q: Quaternion) -> None:
    with pytest.raises(ValueError, match="no direction"):
        rotation.normalise(q)


@given(quaternions, st.floats(0.01, 100.0))
def test_normalising_undoes_scaling(q: Quaternion, scale: float) -> None:
    w, x, y, z = q
    assert rotation.normalise((w * scale, x * scale, y * scale, z * scale)) == pytest.approx(q)


@pytest.mark.parametrize(
    ("yaw_deg", "expected"), [(0.0, (1.0, 0.0)), (90.0, (0.0, 1.0)), (180.0, (-1.0, 0.0))]
)
def test_forward_follows_the_heading(yaw_deg: float, expected: tuple[float, float]) -> None:
    assert rotation.rotate_by_yaw(1.0, 0.0, math.radians(yaw_deg)) == pytest.approx(
        expected, abs=1e-12
    )
