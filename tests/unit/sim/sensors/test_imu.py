"""Inertial errors: how large, how they average out, how they saturate."""

import itertools
import math
import statistics

import pytest

from sim.physics.noise import generators, white_sigma
from sim.physics.truth import Truth
from sim.sensors.imu import ACCELEROMETER, GYROSCOPE, Imu
from tests.unit.sim.truths import truth

RATE_HZ = 250
HOVERING = (5000.0, 5000.0, 5000.0, 5000.0)


def imu(*, seed: int = 1, factor: float = 1.0) -> Imu:
    return Imu(generators(seed)["imu"], rate_hz=RATE_HZ, factor=factor)


def gyro_x(instrument: Imu, state: Truth, count: int) -> list[float]:
    return [instrument.read(state).rate_frd[0] for _ in range(count)]


def test_an_ideal_imu_reads_the_truth() -> None:
    state = truth(
        4000,
        inertial_rate_frd=(0.1, -0.2, 0.3),
        specific_force_frd=(1.0, 2.0, -9.0),
        rotor_rpm=HOVERING,
    )
    reading = imu(factor=0.0).read(state)
    assert reading.time_us == 4000
    assert reading.rate_frd == (0.1, -0.2, 0.3)
    assert reading.specific_force_frd == (1.0, 2.0, -9.0)


def test_a_level_imu_at_rest_reads_gravity_upwards() -> None:
    x, y, z = imu().read(truth()).specific_force_frd
    assert z == pytest.approx(-9.8, abs=0.2)
    assert math.hypot(x, y) < 0.2


def test_it_measures_the_rate_against_inertial_space() -> None:
    reading = imu(factor=0.0).read(truth(rate_frd=(1.0, 1.0, 1.0)))
    assert reading.rate_frd == (0.0, 0.0, 0.0)


def test_noise_at_rest_is_that_of_the_data_sheet() -> None:
    readings = gyro_x(imu(), truth(), 20_000)
    assert statistics.pstdev(readings) == pytest.approx(
        white_sigma(GYROSCOPE.density, RATE_HZ), rel=0.05
    )


def test_white_noise_averages_out_with_the_square_root_of_the_time() -> None:
    readings = gyro_x(imu(), truth(), 50_000)
    seconds = [statistics.fmean(readings[i : i + 250]) for i in range(0, 50_000, 250)]
    pairs = itertools.pairwise(seconds)
    allan_deviation = math.sqrt(0.5 * statistics.fmean((b - a) ** 2 for a, b in pairs))
    assert allan_deviation == pytest.approx(GYROSCOPE.density / math.sqrt(2.0), rel=0.15)


def test_a_bias_stays_with_the_flight() -> None:
    instrument = imu(seed=3)
    first = statistics.fmean(gyro_x(instrument, truth(), 5000))
    second = statistics.fmean(gyro_x(instrument, truth(), 5000))
    assert abs(first) > 1e-4
    assert second == pytest.approx(first, abs=1e-4)


def test_biases_differ_between_flights_as_documented() -> None:
    biases = [imu(seed=seed).accelerometer.bias[2] for seed in range(300)]
    assert statistics.pstdev(biases) == pytest.approx(ACCELEROMETER.turn_on_sigma, rel=0.15)
    assert statistics.fmean(biases) == pytest.approx(0.0, abs=0.01)


def test_turning_rotors_shake_it() -> None:
    resting = statistics.pstdev(gyro_x(imu(), truth(), 5000))
    hovering = statistics.pstdev(gyro_x(imu(), truth(rotor_rpm=HOVERING), 5000))
    assert hovering > 5.0 * resting
    assert hovering == pytest.approx(GYROSCOPE.vibration_at_hover, rel=0.1)


def test_one_factor_scales_every_error() -> None:
    state = truth(rotor_rpm=HOVERING)
    full = imu(factor=1.0).read(state).specific_force_frd
    tenth = imu(factor=0.1).read(state).specific_force_frd
    for component, smaller, true in zip(full, tenth, state.specific_force_frd, strict=True):
        assert smaller - true == pytest.approx(0.1 * (component - true))


def test_a_blow_saturates_it() -> None:
    state = truth(specific_force_frd=(500.0, -500.0, -9.8), inertial_rate_frd=(100.0, 0.0, 0.0))
    reading = imu().read(state)
    assert reading.specific_force_frd[:2] == pytest.approx((156.9, -156.9), abs=0.1)
    assert reading.specific_force_frd[2] == pytest.approx(-9.8, abs=2.0)  # Cross-axis: of 700
    assert reading.rate_frd[0] == pytest.approx(math.radians(2000.0))


def mean_rate(instrument: Imu, rate: tuple[float, float, float]) -> list[float]:
    state = truth(inertial_rate_frd=rate)
    samples = [instrument.read(state).rate_frd for _ in range(2000)]
    return [statistics.fmean(axis) for axis in zip(*samples, strict=True)]


def test_a_fast_turn_is_read_wrong_in_scale_and_leaks_into_the_other_axes() -> None:
    leaks, scales = [], []
    for seed in range(60):
        still, turning = (mean_rate(imu(seed=seed), (0.0, 0.0, rate)) for rate in (0.0, 20.0))
        # The bias drifts by much less than 20 rad/s times a per mille
        x, y, z = ((b - a) / 20.0 for a, b in zip(still, turning, strict=True))
        leaks += [x, y]
        scales.append(z - 1.0)
    assert statistics.pstdev(scales) == pytest.approx(GYROSCOPE.scale_sigma, rel=0.3)
    assert statistics.pstdev(leaks) == pytest.approx(GYROSCOPE.cross_axis_sigma, rel=0.3)
