import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.estimator.aid_sources.gnss_fusion import (
    position_measurements,
    velocity_measurements,
)
from uav_firmware.modules.estimator.kalman_filter.delay import InertialHistory, Past
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf, Noise
from uav_firmware.modules.estimator.kalman_filter.state import (
    GPS_HEIGHT_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
    NominalState,
)
from uav_firmware.msg.vectors import Vector3

STEP_US = 4000
GRAVITY = 9.8
QUIET = Noise(
    accel=0.0, gyro=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0, baro_bias_walk=0.0,
    heading_bias_walk=0.0, gps_height_sigma=0.0, gps_height_time=120.0,
)  # fmt: skip


def flown(
    steps: int, *, wrong_from: int = 0, size: float = 0.0, index: int = 6
) -> tuple[ErrorStateEkf, InertialHistory, list[tuple[Vector3, Vector3]]]:
    """A filter after some hard manoeuvring, its history, and where it was at each step."""
    ekf = ErrorStateEkf(NominalState(from_euler(0.2, -0.1, 1.0)), np.ones(SIZE), QUIET, GRAVITY)
    ekf.state.velocity_ned = (4.0, -3.0, 1.0)
    history = InertialHistory(0, 256)
    states = [(ekf.state.position_ned, ekf.state.velocity_ned)]
    for step in range(1, steps + 1):
        if step == wrong_from + 1 and size:
            error = np.zeros(SIZE)
            error[index] = size
            ekf.state.inject(error.tolist())
        t = step * STEP_US * 1e-6
        rate = (0.5 * math.sin(3 * t), 0.4, -0.3)
        force = (2.0 * math.cos(5 * t), 1.0, -10.0 + 3.0 * math.sin(4 * t))
        history.push(step * STEP_US, ekf.predict(rate, force, STEP_US * 1e-6), STEP_US * 1e-6)
        states.append((ekf.state.position_ned, ekf.state.velocity_ned))
    return ekf, history, states


def recall(ekf: ErrorStateEkf, history: InertialHistory, time_us: int) -> Past:
    past = history.recall(ekf.state, time_us, GRAVITY)
    assert past is not None
    return past


@given(st.integers(0, 100))
@settings(max_examples=25)
def test_the_past_is_as_it_was(step: int) -> None:
    ekf, history, states = flown(100)
    past = recall(ekf, history, step * STEP_US)
    assert past.position_ned == pytest.approx(states[step][0], abs=1e-9)
    assert past.velocity_ned == pytest.approx(states[step][1], abs=1e-9)
    assert past.delay_s == pytest.approx((100 - step) * STEP_US * 1e-6)


def test_between_samples_the_past_lies_between() -> None:
    ekf, history, states = flown(100)
    past = recall(ekf, history, 60 * STEP_US + 1000)
    for axis in range(3):
        expected = 0.75 * states[60][1][axis] + 0.25 * states[61][1][axis]
        assert past.velocity_ned[axis] == pytest.approx(expected, abs=1e-9)


def test_a_correction_made_meanwhile_is_in_the_past_too() -> None:
    ekf, history, states = flown(100)
    error = np.zeros(SIZE)
    error[POSITION], error[VELOCITY] = (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)
    ekf.state.inject(error.tolist())
    past = recall(ekf, history, 50 * STEP_US)
    tau = 50 * STEP_US * 1e-6
    for axis in range(3):
        assert past.velocity_ned[axis] == pytest.approx(states[50][1][axis] + 0.1 * (axis + 1))
        shift = (axis + 1) * (1.0 - 0.1 * tau)
        assert past.position_ned[axis] == pytest.approx(states[50][0][axis] + shift)


@pytest.mark.parametrize("time_us", [-STEP_US, 101 * STEP_US, 10**12])
def test_the_future_and_the_forgotten_are_not_recalled(time_us: int) -> None:
    ekf, history, _ = flown(100)
    assert history.recall(ekf.state, time_us, GRAVITY) is None


def test_what_fell_out_of_the_history_is_not_recalled() -> None:
    ekf, history, _ = flown(400)
    assert history.recall(ekf.state, 100 * STEP_US, GRAVITY) is None
    assert history.recall(ekf.state, 150 * STEP_US, GRAVITY) is not None


@pytest.mark.parametrize("index", [6, 7, 8, 9, 10, 11])
def test_errors_made_since_then_do_not_look_like_errors_of_the_past(index: int) -> None:
    """The same flight with an error of attitude or accelerometer from the time of validity on.

    Back then position and velocity were right, so the rows must see no error in them, although
    the error has grown into both of them since.
    """
    steps, delay, size = 100, 40, 1e-4
    reference, history, _ = flown(steps)
    wrong, _, _ = flown(steps, wrong_from=steps - delay, size=size, index=index)
    past = recall(reference, history, (steps - delay) * STEP_US)
    error = np.zeros(SIZE)
    error[POSITION] = np.subtract(wrong.state.position_ned, reference.state.position_ned)
    error[VELOCITY] = np.subtract(wrong.state.velocity_ned, reference.state.velocity_ned)
    error[index] = size
    rows = [m.jacobian for m in position_measurements(past, (0.0, 0.0, 0.0), 0.0, 1.0, 1.0)]
    rows += [m.jacobian for m in velocity_measurements(past, (0.0, 0.0, 0.0), 1.0)]
    assert np.abs(error[VELOCITY]).max() > 0.1 * size
    assert np.array(rows) @ error == pytest.approx(np.zeros(6), abs=0.02 * size)


def test_innovation_is_measured_minus_expected() -> None:
    ekf, history, states = flown(100)
    past = recall(ekf, history, 80 * STEP_US)
    north = position_measurements(past, (states[80][0][0] + 0.7, 0.0, 0.0), 0.0, 0.3, 0.5)[0]
    assert north.innovation == pytest.approx(0.7)
    assert north.variance == pytest.approx(0.09)
    down = velocity_measurements(past, (0.0, 0.0, states[80][1][2] - 0.2), 0.1)[2]
    assert down.innovation == pytest.approx(-0.2)


def test_a_known_error_of_gps_height_is_expected() -> None:
    """A receiver that reads half a metre high, and is known to, moves nothing."""
    ekf, history, states = flown(100)
    past = recall(ekf, history, 80 * STEP_US)
    north, east, down = states[80][0]
    measured = position_measurements(past, (north, east, down - 0.5), 0.5, 0.3, 0.5)[2]
    assert measured.innovation == pytest.approx(0.0, abs=1e-6)
    assert measured.jacobian[GPS_HEIGHT_BIAS] == -1.0
