import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.estimator.flight import HOME
from uav_firmware.lib.rotation import from_euler, rotate_inverse, to_euler
from uav_firmware.modules.estimator.fault_detection.imu_checks import ImuChecks
from uav_firmware.modules.estimator.kalman_filter.alignment import (
    OriginAverage,
    RestAverage,
    TiltAlignment,
)
from uav_firmware.msg.sensors import SensorGps, SensorImu
from uav_firmware.msg.vectors import Vector3

STILL = (0.0, 0.0, 0.0)
LEVEL = (0.0, 0.0, -9.8)


def average(rate: Vector3, force: Vector3, *, noise: float = 0.0) -> TiltAlignment | None:
    rng, rest = np.random.default_rng(1), RestAverage()
    for count in range(260):
        n = noise * rng.standard_normal(6)
        sample = SensorImu(
            4000 * count,
            (rate[0] + 0.02 * n[0], rate[1] + 0.02 * n[1], rate[2] + 0.02 * n[2]),
            (force[0] + n[3], force[1] + n[4], force[2] + n[5]),
        )
        alignment = rest.add(sample)
        if alignment is not None:
            return alignment
    return None


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6))
@settings(max_examples=20)
def test_tilt_comes_from_gravity(roll: float, pitch: float) -> None:
    force = rotate_inverse(from_euler(roll, pitch, 0.0), LEVEL)
    alignment = average(STILL, force)
    assert alignment is not None
    assert to_euler(alignment.q_ned_frd) == pytest.approx((roll, pitch, 0.0), abs=1e-9)


def test_gyro_bias_is_the_mean_rate_at_rest() -> None:
    alignment = average((0.01, -0.02, 0.005), LEVEL, noise=0.3)
    assert alignment is not None
    assert alignment.gyro_bias_frd == pytest.approx((0.01, -0.02, 0.005), abs=2e-3)
    assert 1e-4 <= alignment.gyro_bias_sigma < 2e-3


@pytest.mark.parametrize(
    ("rate", "force", "noise"),
    [
        pytest.param((0.0, 0.0, 0.5), LEVEL, 0.0, id="turning"),
        pytest.param(STILL, (0.0, 0.0, -15.0), 0.0, id="accelerating"),
        pytest.param(STILL, LEVEL, 2.0, id="shaken"),
    ],
)
def test_a_moving_vehicle_is_not_aligned(rate: Vector3, force: Vector3, noise: float) -> None:
    assert average(rate, force, noise=noise) is None


def fix(time_us: int, north_m: float) -> SensorGps:
    latitude, longitude, altitude = HOME[0] + north_m * 9e-6, HOME[1], HOME[2]
    return SensorGps(
        time_us, 0, latitude, longitude, altitude, STILL, 0.5, 0.8, 0.1, 3, 12, 0.7, 1.1
    )  # fmt: skip


def test_origin_is_the_mean_of_a_window_of_fixes() -> None:
    origin = OriginAverage(1.0)
    places = [origin.add(fix(100_000 * count, count % 2)) for count in range(11)]
    assert places[:10] == [None] * 10
    assert places[10] is not None
    assert places[10][0] == pytest.approx(HOME[0] + 5 / 11 * 9e-6, abs=1e-10)
    assert origin.count == 11


def test_origin_restarts_when_told() -> None:
    origin = OriginAverage(1.0)
    origin.add(fix(0, 50.0))
    origin.restart()
    places = [origin.add(fix(5_000_000 + 100_000 * count, 0.0)) for count in range(11)]
    assert places[:10] == [None] * 10
    assert places[10] == pytest.approx(HOME)


def admitted(guard: ImuChecks, imu: SensorImu) -> tuple[Vector3, Vector3, float] | None:
    sample = guard.admit(imu)
    return None if sample is None else (sample.rate_frd, sample.specific_force_frd, sample.dt)


def test_guard_passes_good_samples_with_their_step() -> None:
    guard = ImuChecks()
    assert admitted(guard, SensorImu(1000, STILL, LEVEL)) == (STILL, LEVEL, 0.0)
    assert admitted(guard, SensorImu(5000, STILL, LEVEL)) == (STILL, LEVEL, 4000 * 1e-6)


@pytest.mark.parametrize(
    "bad",
    [
        SensorImu(5000, (math.nan, 0.0, 0.0), LEVEL),
        SensorImu(5000, STILL, (0.0, math.inf, 0.0)),
        SensorImu(5000, (0.0, -100.0, 0.0), LEVEL),
        SensorImu(5000, STILL, (0.0, 0.0, 1e300)),
    ],
)
def test_guard_replaces_absurd_samples_by_the_last_good_one(bad: SensorImu) -> None:
    guard = ImuChecks()
    guard.admit(SensorImu(1000, (0.1, 0.2, 0.3), LEVEL))
    assert admitted(guard, bad) == ((0.1, 0.2, 0.3), LEVEL, 4000 * 1e-6)
    assert guard.rejected == 1
    assert guard.healthy


def test_guard_needs_one_good_sample_to_start() -> None:
    assert ImuChecks().admit(SensorImu(0, (math.nan, 0.0, 0.0), LEVEL)) is None


@pytest.mark.parametrize("time_us", [1000, 999, -5])
def test_guard_refuses_time_that_stands_or_goes_back(time_us: int) -> None:
    guard = ImuChecks()
    guard.admit(SensorImu(1000, STILL, LEVEL))
    assert guard.admit(SensorImu(time_us, STILL, LEVEL)) is None


def test_guard_bounds_a_gap() -> None:
    guard = ImuChecks()
    guard.admit(SensorImu(0, STILL, LEVEL))
    assert admitted(guard, SensorImu(9_000_000, STILL, LEVEL)) == (STILL, LEVEL, 0.1)


def test_guard_reports_a_dead_sensor_and_its_return() -> None:
    guard = ImuChecks()
    guard.admit(SensorImu(0, STILL, LEVEL))
    for count in range(1, 40):
        guard.admit(SensorImu(4000 * count, (math.nan, 0.0, 0.0), LEVEL))
    assert not guard.healthy
    guard.admit(SensorImu(200_000, STILL, LEVEL))
    assert guard.healthy
