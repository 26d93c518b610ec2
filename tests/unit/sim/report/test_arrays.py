"""Arithmetic of tracks on tracks whose answer is known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.truth import quaternion_from_euler
from sim.report.arrays import (
    Array,
    closest_in_order,
    euler,
    largest,
    resample,
    resample_attitude,
    rms,
    tilt_between,
    wrapped,
)

ANGLE = st.floats(-3.0, 3.0)
LEAN = st.floats(-1.4, 1.4)


def attitude(roll: float, pitch: float, yaw: float) -> Array:
    return np.array([quaternion_from_euler(roll, pitch, yaw)])


@given(ANGLE, LEAN, ANGLE)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    found = [float(angle[0]) for angle in euler(attitude(roll, pitch, yaw))]
    assert found == pytest.approx([roll, pitch, yaw], abs=1e-6)


@given(LEAN, ANGLE, ANGLE)
def test_heading_is_no_tilt(lean: float, yaw: float, other_yaw: float) -> None:
    tilt = tilt_between(attitude(lean, 0.0, yaw), attitude(lean, 0.0, other_yaw))
    assert tilt[0] == pytest.approx(0.0, abs=1e-7)


@given(LEAN, LEAN, ANGLE)
def test_tilt_is_the_difference_of_leans(one: float, other: float, yaw: float) -> None:
    tilt = tilt_between(attitude(one, 0.0, yaw), attitude(other, 0.0, yaw))
    assert tilt[0] == pytest.approx(abs(one - other), abs=1e-7)


@given(st.floats(-50.0, 50.0))
def test_a_wrapped_angle_is_the_same_angle(angle: float) -> None:
    found = float(wrapped(np.array([angle]))[0])
    assert -math.pi < found <= math.pi + 1e-9
    assert math.cos(found - angle) == pytest.approx(1.0)


def test_heading_errors_do_not_jump_at_south() -> None:
    assert wrapped(np.radians([179.0 - -179.0]))[0] == pytest.approx(math.radians(-2.0))


def test_resampling_is_linear_between_and_constant_beyond() -> None:
    found = resample(
        np.array([0.0, 1.0]), np.array([[0.0, 10.0], [2.0, 20.0]]), np.array([-1, 0.5, 9])
    )
    assert found.tolist() == [[0.0, 10.0], [1.0, 15.0], [2.0, 20.0]]


@given(ANGLE, ANGLE)
def test_attitudes_between_do_not_care_for_the_quaternions_sign(yaw: float, turn: float) -> None:
    one, other = attitude(0.0, 0.0, yaw)[0], attitude(0.0, 0.0, yaw + 0.01 * turn)[0]
    times, middle = np.array([0.0, 1.0]), np.array([0.5])
    same = resample_attitude(times, np.array([one, other]), middle)
    flipped = resample_attitude(times, np.array([one, -other]), middle)
    assert np.allclose(same, flipped)
    assert np.linalg.norm(same) == pytest.approx(1.0)
    assert euler(same)[2][0] == pytest.approx(yaw + 0.005 * turn, abs=1e-6)


def test_root_mean_square_and_largest_leave_out_what_is_not_known() -> None:
    values = np.array([3.0, math.nan, -4.0])
    assert rms(values) == pytest.approx(math.sqrt(12.5))
    assert largest(values) == 4.0
    vectors = np.array([[3.0, 4.0], [0.0, 0.0]])
    assert rms(vectors) == pytest.approx(math.sqrt(12.5))
    assert largest(vectors) == 5.0


def test_of_nothing_nothing_is_known() -> None:
    assert math.isnan(rms(np.array([])))
    assert math.isnan(largest(np.array([math.nan])))


def test_a_crossing_track_passes_points_in_their_turn() -> None:
    # Out along x, back over the same places: the first point is passed twice.
    track = np.array([[x, 0.0] for x in (0.0, 1.0, 2.0, 3.0, 2.0, 1.1, 0.0)])
    first, far, back = np.array([1.0, 0.2]), np.array([3.0, 0.0]), np.array([1.0, 0.2])
    assert closest_in_order(track, [first, far, back]) == [1, 3, 5]


def test_no_points_no_passages() -> None:
    assert closest_in_order(np.zeros((5, 2)), []) == []


@given(
    st.lists(st.tuples(ANGLE, ANGLE), min_size=1, max_size=8),
    st.lists(st.tuples(ANGLE, ANGLE), min_size=1, max_size=3),
)
def test_no_other_choice_in_order_is_closer(
    track_list: list[tuple[float, float]], point_list: list[tuple[float, float]]
) -> None:
    track, points = np.array(track_list), [np.array(point) for point in point_list]

    def cost(rows: list[int]) -> float:
        return sum(
            float(np.linalg.norm(track[row] - point))
            for row, point in zip(rows, points, strict=True)
        )

    def choices(begin: int, count: int) -> list[list[int]]:
        if count == 0:
            return [[]]
        return [
            [row, *rest] for row in range(begin, len(track)) for rest in choices(row, count - 1)
        ]

    rows = closest_in_order(track, points)
    assert rows == sorted(rows)
    assert cost(rows) == pytest.approx(min(cost(choice) for choice in choices(0, len(points))))
