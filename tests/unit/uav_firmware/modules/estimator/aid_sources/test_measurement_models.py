"""Measurement models of barometer, compass and rest; gates."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.atmosphere import pressure_from_altitude
from uav_firmware.lib.rotation import from_euler, rotate_inverse
from uav_firmware.modules.estimator.aid_sources.barometer import (
    FrozenDetector,
    height_measurement,
    pressure_altitude,
)
from uav_firmware.modules.estimator.aid_sources.gnss_fusion import VelocityPlausibility
from uav_firmware.modules.estimator.aid_sources.magnetometer import (
    heading_measurement,
    read_compass,
)
from uav_firmware.modules.estimator.aid_sources.rest import held_position, zero_velocity
from uav_firmware.modules.estimator.fault_detection.motion import RestDetector
from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf, Noise
from uav_firmware.modules.estimator.kalman_filter.gate import Aid
from uav_firmware.modules.estimator.kalman_filter.state import (
    BARO_BIAS,
    DOWN,
    HEADING,
    SIZE,
    NominalState,
)

QUIET = Noise(
    accel=0.0, gyro=0.0, accel_bias_walk=0.0, gyro_bias_walk=0.0, baro_bias_walk=0.0,
    heading_bias_walk=0.0, gps_height_sigma=0.0, gps_height_time=120.0,
)  # fmt: skip
angles = st.floats(-3.1, 3.1)
tilts = st.floats(-0.7, 0.7)


def field_ned(declination: float) -> tuple[float, float, float]:
    return (0.26 * math.cos(declination), 0.26 * math.sin(declination), 0.37)


def test_higher_than_expected_pushes_up() -> None:
    state = NominalState()
    state.position_ned = (0.0, 0.0, -10.0)
    measured = height_measurement(state, 11.0, 0.2)[0]
    assert measured.innovation == pytest.approx(1.0)
    assert measured.jacobian[DOWN] == -1.0
    assert measured.jacobian[BARO_BIAS] == 1.0


def test_a_known_bias_is_expected() -> None:
    state = NominalState()
    state.baro_bias_m = 2.0
    assert height_measurement(state, 2.0, 0.2)[0].innovation == pytest.approx(0.0)


@pytest.mark.parametrize("pressure", [math.nan, math.inf, -math.inf, 0.0, -1.0, 10.0, 2e5])
def test_no_barometer_shows_this(pressure: float) -> None:
    assert pressure_altitude(pressure) is None


@given(st.floats(-400.0, 9000.0))
def test_pressure_altitude_follows_the_standard_atmosphere(altitude: float) -> None:
    assert pressure_altitude(pressure_from_altitude(altitude)) == pytest.approx(altitude, abs=1e-6)


def test_exact_repetition_is_frozen_until_it_changes() -> None:
    frozen = FrozenDetector()
    seen = [frozen.is_frozen(93000.0, time_us) for time_us in range(0, 3_000_000, 40_000)]
    assert not any(seen[:50])
    assert all(seen[51:])
    assert not frozen.is_frozen(93000.1, 3_040_000)


@given(tilts, tilts, angles, st.floats(-0.5, 0.5), st.floats(-1.0, 1.0))
def test_compass_error_is_the_heading_error(
    roll: float, pitch: float, yaw: float, declination: float, error: float
) -> None:
    field = rotate_inverse(from_euler(roll, pitch, yaw), field_ned(declination))
    compass = read_compass(field, from_euler(roll, pitch, yaw - error), declination)
    assert compass is not None
    assert compass.error == pytest.approx(error, abs=1e-9)


def test_compass_does_not_speak_about_tilt() -> None:
    compass = read_compass(field_ned(0.0), from_euler(0.0, 0.0, -0.1), 0.0)
    assert compass is not None
    measured = heading_measurement(compass, 0.0, 0.05, 0.02)[0]
    assert measured.innovation == pytest.approx(0.1)
    assert measured.jacobian[HEADING] == 1.0
    assert not any(measured.jacobian[6:8])
    assert measured.variance == pytest.approx(0.05**2 + (0.37 / 0.26 * 0.02) ** 2)


def test_compass_innovation_goes_the_short_way_round() -> None:
    compass = read_compass(field_ned(0.0), from_euler(0.0, 0.0, 3.1), 0.0)
    assert compass is not None
    assert heading_measurement(compass, 0.1, 0.05, 0.0)[0].innovation == pytest.approx(
        math.tau - 3.2, abs=1e-9
    )


@pytest.mark.parametrize(
    "field",
    [
        (math.nan, 0.2, 0.3),
        (math.inf, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (5.0, 0.0, 0.0),
        (0.0, 0.01, 0.5),
    ],
)
def test_no_heading_from_a_field_that_is_not_the_earths(field: tuple[float, float, float]) -> None:
    assert read_compass(field, from_euler(0.0, 0.0, 0.0), 0.0) is None


def test_zero_velocity_pulls_towards_zero() -> None:
    state = NominalState()
    state.velocity_ned = (0.5, -0.2, 0.1)
    assert [m.innovation for m in zero_velocity(state, 0.1)] == pytest.approx([-0.5, 0.2, -0.1])


def test_held_position_may_leave_the_height_alone() -> None:
    state = NominalState()
    state.position_ned = (1.0, 2.0, 3.0)
    held = held_position(state, (0.0, 0.0, 0.0), 10.0, 2)
    assert [m.innovation for m in held] == pytest.approx([-1.0, -2.0])


@pytest.mark.parametrize(
    ("rate", "acceleration", "at_rest"),
    [
        ((0.01, 0.0, 0.0), (0.3, 0.0, 0.2), True),
        ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), False),
        ((0.0, 0.0, 0.0), (0.0, 3.0, 0.0), False),
    ],
)
def test_rest_is_small_rate_and_small_acceleration(
    rate: tuple[float, float, float], acceleration: tuple[float, float, float], *, at_rest: bool
) -> None:
    detector = RestDetector()
    for _ in range(250):
        detector.update(rate, acceleration)
    assert detector.at_rest is at_rest


def make_ekf() -> ErrorStateEkf:
    return ErrorStateEkf(NominalState(), np.ones(SIZE), QUIET, 9.8)


def north(innovation: float) -> Measurement:
    row = np.zeros(SIZE)
    row[0] = 1.0
    return Measurement(innovation, tuple(row), 3.0)  # with the state's variance of 1: deviation 2


@given(st.floats(-20.0, 20.0))
def test_ratio_is_innovation_over_gate_times_deviation(innovation: float) -> None:
    ekf, aid = make_ekf(), Aid(gate=3.0)
    accepted = aid.fuse(ekf, (north(innovation),), 0)
    assert aid.ratio == pytest.approx(abs(innovation) / 6.0)
    assert accepted == (abs(innovation) <= 6.0)
    corrected = 0.25 * innovation if accepted else 0.0
    assert ekf.state.position_ned[0] == pytest.approx(corrected)


def test_one_bad_component_rejects_the_group() -> None:
    ekf, aid = make_ekf(), Aid(gate=3.0)
    assert not aid.fuse(ekf, (north(0.1), north(100.0)), 0)
    assert ekf.state.position_ned == (0.0, 0.0, 0.0)


def test_rejection_is_timed_from_its_first_to_the_next_acceptance() -> None:
    ekf, aid = make_ekf(), Aid(gate=3.0)
    assert aid.age_s(0) == math.inf
    aid.fuse(ekf, (north(100.0),), 1_000_000)
    aid.fuse(ekf, (north(100.0),), 2_000_000)
    assert aid.rejected_s(4_000_000) == pytest.approx(3.0)
    aid.fuse(ekf, (north(0.0),), 5_000_000)
    assert aid.rejected_s(6_000_000) == 0.0
    assert not aid.rejecting
    assert aid.age_s(6_000_000) == pytest.approx(1.0)


def velocity_innovations(north: float, east: float, down: float) -> list[Measurement]:
    return [Measurement(value, (0.0,) * SIZE, 0.01) for value in (north, east, down)]


@given(st.floats(-20.0, 20.0), st.floats(0.05, 1.0))
def test_a_bias_that_jumps_changes_the_velocity_plausibly(
    bias_m_s2: float, elapsed_s: float
) -> None:
    plausibility = VelocityPlausibility()
    grown = [
        plausibility.update(
            velocity_innovations(0.0, step * elapsed_s * bias_m_s2, 0.0),
            round(step * elapsed_s * 1e6),
        )
        for step in range(5)
    ]
    assert all(grown)


@given(st.floats(7.0, 60.0), st.integers(0, 2), st.sampled_from([-1.0, 1.0]))
def test_a_velocity_that_leaps_is_no_motion_of_a_vehicle(
    leap_m_s: float, axis: int, side: float
) -> None:
    plausibility = VelocityPlausibility()
    leapt = [0.0, 0.0, 0.0]
    leapt[axis] = side * leap_m_s
    judged = [
        plausibility.update(velocity_innovations(*values), 1_000_000 + step * 200_000)
        for step, values in enumerate([(0.0, 0.0, 0.0), leapt, leapt, (0.0, 0.0, 0.0)])
    ]
    assert judged == [True, False, True, False]
