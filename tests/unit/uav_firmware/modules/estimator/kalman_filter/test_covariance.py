"""The two ways to compute the covariance give the same bits, and those of the equations."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_firmware.lib.rotation import from_euler, to_matrix
from uav_firmware.modules.estimator.kalman_filter.covariance import (
    Array,
    Covariance,
    Measurement,
    Transition,
)
from uav_firmware.modules.estimator.kalman_filter.covariance_arrays import ArrayCovariance
from uav_firmware.modules.estimator.kalman_filter.covariance_kernel import KernelCovariance
from uav_firmware.modules.estimator.kalman_filter.state import (
    ACCEL_BIAS,
    ATTITUDE,
    GPS_HEIGHT_BIAS,
    GYRO_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
)
from uav_firmware.msg.vectors import Vector3

SIGMAS = [0.1 + 0.01 * index for index in range(SIZE)]
NOISE = [1e-5 * (index % 4) for index in range(SIZE)]
angles = st.floats(-1.2, 1.2)
impulses = st.tuples(*[st.floats(-0.5, 0.5)] * 3)
rows = st.lists(st.floats(-2.0, 2.0), min_size=SIZE, max_size=SIZE).map(tuple)
measurements = st.builds(Measurement, st.floats(-1.0, 1.0), rows, st.floats(1e-3, 10.0))
Step = tuple[float, float, Vector3, list[Measurement]]
steps = st.tuples(angles, angles, impulses, st.lists(measurements, max_size=3))


def both() -> tuple[Covariance, Covariance]:
    pair = ArrayCovariance(SIGMAS), KernelCovariance(SIGMAS)
    for covariance in pair:
        covariance.set_noise(NOISE)
    return pair


def transition(roll: float, pitch: float, impulse: Vector3) -> Transition:
    return Transition(0.016, impulse, to_matrix(from_euler(roll, pitch, 0.4)), 0.999)


def matrix_of(step: Transition) -> Array:
    """F, as a whole matrix."""
    f, rotation, (x, y, z) = np.eye(SIZE), np.array(step.rotation), step.impulse_ned
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    f[POSITION, VELOCITY] = step.elapsed * np.eye(3)
    f[VELOCITY, ATTITUDE] = -skew
    f[POSITION, ATTITUDE] = -0.5 * step.elapsed * skew
    f[VELOCITY, ACCEL_BIAS] = f[ATTITUDE, GYRO_BIAS] = -step.elapsed * rotation
    f[POSITION, ACCEL_BIAS] = -0.5 * step.elapsed**2 * rotation
    f[GPS_HEIGHT_BIAS, GPS_HEIGHT_BIAS] = step.kept
    return f


@given(st.lists(steps, min_size=1, max_size=6))
@settings(max_examples=50, deadline=None)
def test_loops_and_arrays_give_the_same_bits(
    flight: list[Step],
) -> None:
    arrays, loops = both()
    for roll, pitch, impulse, group in flight:
        for covariance in (arrays, loops):
            covariance.predict(transition(roll, pitch, impulse))
        assert [arrays.expected(m.jacobian) for m in group] == [
            loops.expected(m.jacobian) for m in group
        ]
        assert arrays.fuse(group) == loops.fuse(group)
        assert np.array_equal(arrays.matrix(), loops.matrix())
        assert arrays.variances() == loops.variances()
    assert np.array_equal(loops.matrix(), loops.matrix().T)


@given(angles, angles, impulses)
@settings(max_examples=20, deadline=None)
def test_a_prediction_is_that_of_the_whole_matrices(
    roll: float, pitch: float, impulse: Vector3
) -> None:
    for covariance in both():
        step = transition(roll, pitch, impulse)
        covariance.predict(step)
        before, f = covariance.matrix(), matrix_of(step)
        covariance.predict(step)
        expected = f @ before @ f.T + np.diag(NOISE)
        assert covariance.matrix() == pytest.approx(expected, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("number", [0, 1])
def test_a_measurement_of_a_broken_covariance_is_left_out(number: int) -> None:
    covariance, row = both()[number], (1.0,) + (0.0,) * (SIZE - 1)
    for broken in (-1.0, math.nan):
        covariance.replace(broken * np.eye(SIZE))
        assert covariance.fuse([Measurement(1.0, row, 0.5)]) == [0.0] * SIZE


@pytest.mark.parametrize("number", [0, 1])
def test_what_is_replaced_is_given_back(number: int) -> None:
    covariance = both()[number]
    matrix = np.arange(SIZE * SIZE, dtype=float).reshape(SIZE, SIZE)
    covariance.replace(matrix + matrix.T)
    assert np.array_equal(covariance.matrix(), matrix + matrix.T)
    assert covariance.variance(3) == covariance.variances()[3] == 2.0 * matrix[3, 3]
