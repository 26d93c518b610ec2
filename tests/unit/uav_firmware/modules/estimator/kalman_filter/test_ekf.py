import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.rotation_vectors import to_rotation_vector
from tests.unit.uav_firmware.modules.estimator.flight import Array
from uav_firmware.lib.rotation import conjugate, from_euler, multiply
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.ekf import COVARIANCE_STEPS, ErrorStateEkf, Noise
from uav_firmware.modules.estimator.kalman_filter.state import (
    ATTITUDE,
    DOWN,
    GPS_HEIGHT_BIAS,
    HEADING,
    POSITION,
    SIZE,
    VELOCITY,
    NominalState,
)
from uav_firmware.msg.vectors import Vector3

DT = 0.004
QUIET = Noise(
    accel=0.0, gyro=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0, baro_bias_walk=0.0,
    heading_bias_walk=0.0, gps_height_sigma=0.0, gps_height_time=120.0,
)  # fmt: skip
NOISY = Noise(
    accel=0.3, gyro=0.01, accel_bias_walk=0.01, gyro_bias_walk=0.001, baro_bias_walk=0.03,
    heading_bias_walk=0.001, gps_height_sigma=0.3, gps_height_time=120.0,
)  # fmt: skip
angles = st.floats(-1.2, 1.2)
rates = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
forces = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-20, 0))


def make(noise: Noise = QUIET, *, roll: float = 0.1, pitch: float = -0.2) -> ErrorStateEkf:
    state = NominalState(from_euler(roll, pitch, 0.5))
    state.velocity_ned, state.position_ned = (1.0, -2.0, 0.5), (3.0, 4.0, -5.0)
    return ErrorStateEkf(state, np.full(SIZE, 0.1), noise, 9.8)


def run(ekf: ErrorStateEkf, rate: Vector3, force: Vector3, steps: int) -> NominalState:
    for _ in range(steps):
        ekf.predict(rate, force, DT)
    return ekf.state


def difference(left: NominalState, right: NominalState) -> Array:
    """Error state that leads from `right` to `left`."""
    turn = multiply(left.q_ned_frd, conjugate(right.q_ned_frd))
    pairs = (
        ("position_ned", "velocity_ned"),
        ("accel_bias_frd", "gyro_bias_frd"),
    )
    first, last = (
        [
            a - b
            for name in names
            for a, b in zip(getattr(left, name), getattr(right, name), strict=True)
        ]
        for names in pairs
    )
    slow = [
        getattr(left, name) - getattr(right, name)
        for name in ("baro_bias_m", "heading_bias", "gps_height_bias_m")
    ]
    wind = [a - b for a, b in zip(left.wind_ne, right.wind_ne, strict=True)]
    return np.array([*first, *to_rotation_vector(turn), *last, *slow, *wind])


@given(rates, forces, angles, angles)
@settings(max_examples=30)
def test_transition_is_the_derivative_of_the_motion(
    rate: Vector3, force: Vector3, roll: float, pitch: float
) -> None:
    steps, size = COVARIANCE_STEPS, 1e-5
    reference = make(roll=roll, pitch=pitch)
    run(reference, rate, force, steps)
    expected, transition = np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE))
    for column in range(SIZE):
        disturbed = make(roll=roll, pitch=pitch)
        error = np.zeros(SIZE)
        error[column] = size
        disturbed.state.inject(error.tolist())
        alone = np.eye(SIZE)[column]
        disturbed.covariance = np.outer(alone, alone) + 1e-9 * np.eye(SIZE)
        run(disturbed, rate, force, steps)
        spread = disturbed.covariance[column]
        transition[:, column] = spread / math.sqrt(spread[column])
        expected[:, column] = difference(disturbed.state, reference.state) / size
    # Within a step of 16 ms the body turns: second order in the step is left out.
    assert np.allclose(transition, expected, atol=5e-3)
    assert np.allclose(transition[VELOCITY, ATTITUDE], expected[3:6, 6:9], atol=1e-4)


def test_standing_still_stays_still() -> None:
    ekf = make(roll=0.0, pitch=0.0)
    ekf.state.velocity_ned = (0.0, 0.0, 0.0)
    state = run(ekf, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8), 1000)
    assert state.velocity_ned == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert state.position_ned == pytest.approx((3.0, 4.0, -5.0), abs=1e-12)


def test_more_thrust_climbs() -> None:
    state = run(make(roll=0.0, pitch=0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -10.8), 250)
    assert state.velocity_ned[2] == pytest.approx(0.5 - 1.0, abs=1e-9)
    assert state.position_ned[2] == pytest.approx(-5.0 + 0.5 - 0.5, abs=1e-6)


def test_turning_right_increases_the_heading() -> None:
    ekf = make(roll=0.0, pitch=0.0)
    run(ekf, (0.0, 0.0, 0.4), (0.0, 0.0, -9.8), 250)
    start = from_euler(0.0, 0.0, 0.5)
    turn = to_rotation_vector(multiply(conjugate(start), ekf.state.q_ned_frd))
    assert turn == pytest.approx((0.0, 0.0, 0.4), abs=1e-9)


def test_known_biases_are_taken_off() -> None:
    ekf = make(roll=0.0, pitch=0.0)
    ekf.state.velocity_ned = (0.0, 0.0, 0.0)
    ekf.state.gyro_bias_frd, ekf.state.accel_bias_frd = (0.1, -0.2, 0.3), (0.4, -0.5, 0.6)
    run(ekf, (0.1, -0.2, 0.3), (0.4, -0.5, -9.2), 250)
    assert ekf.state.velocity_ned == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert ekf.state.q_ned_frd == pytest.approx(from_euler(0.0, 0.0, 0.5), abs=1e-9)


@given(st.lists(st.tuples(st.integers(0, SIZE - 1), st.floats(-1, 1)), max_size=20), rates)
@settings(max_examples=30)
def test_covariance_stays_symmetric_and_positive(
    fusions: list[tuple[int, float]], rate: Vector3
) -> None:
    ekf = make(NOISY)
    for index, innovation in fusions:
        run(ekf, rate, (0.5, 0.2, -9.8), COVARIANCE_STEPS)
        row = np.zeros(SIZE)
        row[index] = 1.0
        ekf.fuse((Measurement(innovation, tuple(row), 0.01),))
    assert np.allclose(ekf.covariance, ekf.covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(ekf.covariance).min() > 0.0
    assert ekf.restarts == 0


@given(st.integers(0, SIZE - 1), st.floats(-2.0, 2.0), st.floats(1e-3, 10.0))
@settings(max_examples=30)
def test_a_measurement_only_adds_knowledge(index: int, innovation: float, variance: float) -> None:
    ekf = make(NOISY)
    run(ekf, (0.1, 0.2, 0.3), (0.5, 0.2, -9.8), 20)
    before = ekf.covariance.copy()
    row = np.zeros(SIZE)
    row[index] = 1.0
    ekf.fuse((Measurement(innovation, tuple(row), variance),))
    assert np.linalg.eigvalsh(before - ekf.covariance).min() > -1e-9
    assert ekf.sigma(index) <= math.sqrt(variance)


def test_equal_doubt_meets_in_the_middle() -> None:
    ekf = make()
    row = np.zeros(SIZE)
    row[DOWN] = 1.0
    ekf.fuse((Measurement(1.0, tuple(row), 0.1**2),))
    assert ekf.state.position_ned[2] == pytest.approx(-4.5)
    assert ekf.sigma(DOWN) == pytest.approx(0.1 / math.sqrt(2.0))


def test_a_group_is_fused_as_if_at_once() -> None:
    together, apart = make(NOISY), make(NOISY)
    for ekf in (together, apart):
        run(ekf, (0.1, 0.2, 0.3), (0.5, 0.2, -9.8), 20)
    rows = np.zeros((2, SIZE))
    rows[0, [0, 3]] = 1.0, -0.5
    rows[1, [0, 4]] = 1.0, 0.3
    together.fuse([Measurement(0.2, tuple(row), 0.01) for row in rows])
    h, p, r = rows, apart.covariance, np.eye(2) * 0.01
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
    apart.state.inject((gain @ np.array([0.2, 0.2])).tolist())
    assert np.allclose(together.covariance, p - gain @ h @ p, atol=1e-12)
    assert np.allclose(difference(together.state, apart.state), 0.0, atol=1e-9)


def test_heading_alone_turns_only_the_heading() -> None:
    ekf = make(roll=0.3, pitch=-0.2)
    row = np.zeros(SIZE)
    row[HEADING] = 1.0
    ekf.fuse((Measurement(0.1, tuple(row), 1e-6),))
    turn = multiply(ekf.state.q_ned_frd, conjugate(from_euler(0.3, -0.2, 0.5)))
    assert to_rotation_vector(turn) == pytest.approx((0.0, 0.0, 0.1), abs=1e-4)


def test_forgetting_cuts_correlation() -> None:
    ekf = make(NOISY)
    run(ekf, (0.1, 0.2, 0.3), (0.5, 0.2, -9.8), 100)
    ekf.forget(POSITION, 2.0)
    assert np.allclose(ekf.covariance[POSITION, POSITION], 4.0 * np.eye(3))
    assert not ekf.covariance[POSITION, 3:].any()


def test_a_broken_covariance_is_set_up_anew() -> None:
    ekf = make(NOISY)
    broken = ekf.covariance
    broken[3, 3] = math.nan
    ekf.covariance = broken
    run(ekf, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8), COVARIANCE_STEPS)
    assert ekf.restarts == 1
    assert np.allclose(ekf.covariance, 0.01 * np.eye(SIZE))


def test_the_error_of_gps_height_is_forgotten_in_its_time() -> None:
    """Unwatched, it fades by 1/e in its correlation time, and its doubt becomes what it was."""
    ekf = make(replace(NOISY, gps_height_time=2.0))
    ekf.state.gps_height_bias_m = 1.0
    run(ekf, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8), round(2.0 / DT))
    assert ekf.state.gps_height_bias_m == pytest.approx(math.exp(-1.0), rel=0.01)
    run(ekf, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8), round(20.0 / DT))
    assert ekf.sigma(GPS_HEIGHT_BIAS) == pytest.approx(NOISY.gps_height_sigma, rel=0.01)


def test_biases_stay_within_limits() -> None:
    state = NominalState()
    state.accel_bias_frd, state.gyro_bias_frd = (3.0, -3.0, 0.1), (1.0, -1.0, 0.01)
    state.limit_biases(0.4, 0.15)
    assert state.accel_bias_frd == (0.4, -0.4, 0.1)
    assert state.gyro_bias_frd == (0.15, -0.15, 0.01)
