"""The estimator in a synthetic flight whose truth is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.support.messages import changed, said
from tests.unit.uav_firmware.modules.estimator.flight import (
    GRAVITY,
    PERFECT,
    Array,
    Errors,
    Flight,
    Readings,
    Rig,
    recorded,
)
from uav_firmware.msg.status import LandDetected, LandedState

FLYING_S = 16.0


def fly(
    flight: Flight, rig: Rig, duration_s: float, *, from_s: float = FLYING_S
) -> tuple[Array, Array]:
    """Errors (position, velocity, attitude) and the one sigma claimed for each, at 50 Hz."""
    errors, sigmas = [], []
    for readings in flight.steps(duration_s):
        rig.feed(readings)
        truth = readings.truth
        if truth.time_us < from_s * 1e6 or truth.time_us % 20_000:
            continue
        errors.append(
            np.concatenate(
                [
                    rig.position_error(truth),
                    rig.velocity_error(truth),
                    rig.attitude_error(truth),
                ]
            )
        )
        core = rig.module.estimator.core
        assert core is not None
        horizontal = rig.position.horizontal_accuracy_m
        sigmas.append(
            [horizontal, horizontal, rig.position.vertical_accuracy_m]
            + [core.ekf.sigma(index) for index in range(3, 9)]
        )
    return np.array(errors), np.array(sigmas)


def rms(errors: Array) -> Array:
    root: Array = np.sqrt((errors**2).mean(axis=0))
    return root


@pytest.mark.thorough
@pytest.mark.parametrize("delay_us", [0, 120_000, 300_000])
def test_perfect_sensors_give_a_perfect_estimate_however_late_gps_is(delay_us: int) -> None:
    flight = Flight(errors=replace(PERFECT, gps_delay_us=delay_us))
    errors, _ = fly(flight, Rig(), 45.0)
    assert np.abs(errors[:, :3]).max() < 0.005
    assert np.abs(errors[:, 3:6]).max() < 0.005
    assert np.abs(errors[:, 6:]).max() < math.radians(0.05)


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_honest_sensors_give_a_good_and_honest_estimate(seed: int) -> None:
    errors, sigmas = fly(Flight(seed), Rig(), 45.0)
    size = rms(errors)
    assert (size[:3] < 0.30).all()
    assert (size[3:6] < 0.05).all()
    assert (size[6:8] < math.radians(0.5)).all()
    assert size[8] < math.radians(1.5)
    assert (np.abs(errors) < 3.0 * sigmas).mean(axis=0).min() > 0.95


@pytest.mark.thorough
def test_claimed_accuracy_is_not_timid() -> None:
    """Claiming ten times the real error would be within 3 sigma as well."""
    squares = []
    for seed in range(11, 14):
        errors, sigmas = fly(Flight(seed), Rig(), 35.0)
        squares.append(((errors / sigmas) ** 2).mean(axis=0))
    mean = np.array(squares).mean(axis=0)
    assert (mean > 0.02).all()
    assert (mean < 2.0).all()


@pytest.mark.thorough
def test_innovations_are_as_large_as_expected() -> None:
    flight, rig, ratios = Flight(6), Rig(), []
    for readings in flight.steps(50.0):
        rig.feed(readings)
        if readings.gps is not None and readings.truth.time_us > FLYING_S * 1e6:
            gps = rig.module.estimator.gps
            ratios.append((gps.velocity.ratio, gps.horizontal.ratio, gps.vertical.ratio))
    normalised = 5.0 * np.array(ratios)  # Standard deviations; the gate is five
    assert (normalised < 3.0).mean(axis=0).min() > 0.95
    assert np.median(normalised[:, 0]) > 0.2


def test_rotors_that_may_lift_the_vehicle_end_its_standing() -> None:
    """Rising slowly it is at rest to the inertial sensor, and not yet seen to fly."""
    rig = Rig()
    standing = {}
    for readings in recorded().steps(10.0):
        if readings.truth.time_us == 9_000_000:
            rig.landed.publish(
                LandDetected(9_000_000, True, True, LandedState.ON_GROUND, has_low_throttle=False)
            )
        rig.feed(readings)
        core = rig.module.estimator.core
        if core is not None:
            standing[readings.truth.time_us] = core.standing
    assert standing[8_900_000]
    assert not standing[9_100_000]


def fallen(readings: Readings, drop_us: int, fall_s: float) -> Readings:
    """The same vehicle dropped at a time, its impact shorter than a sample; truth is left alone."""

    def motion(time_us: int) -> tuple[float, float]:
        """Depth [m] and sink [m/s]."""
        since_s = (time_us - drop_us) * 1e-6
        depth_m = 0.5 * GRAVITY * min(max(since_s, 0.0), fall_s) ** 2
        return depth_m, GRAVITY * since_s if 0.0 < since_s < fall_s else 0.0

    imu, baro, gps = readings.imu, readings.baro, readings.gps
    now_us = readings.truth.time_us
    depth_m, sink_m_s = motion(now_us)
    if sink_m_s > 0.0:
        x, y, z = imu.specific_force_frd
        imu = changed(imu, specific_force_frd=(x, y, z + GRAVITY))
    if baro is not None:
        baro = baro._replace(pressure_pa=baro.pressure_pa + 11.3 * depth_m)
    if gps is not None:
        depth_m, sink_m_s = motion(gps.time_us)
        north, east, down = gps.velocity_ned
        gps = gps._replace(
            altitude_amsl_m=gps.altitude_amsl_m - depth_m,
            velocity_ned=(north, east, down + sink_m_s),
        )
    return readings._replace(imu=imu, baro=baro, gps=gps)


def test_a_vehicle_that_has_fallen_to_the_ground_does_not_fall_on_through_it() -> None:
    """Disarmed in the air it counts as landed; the accelerometer has missed the impact."""
    rig, drop_us, fall_s = Rig(), 8_000_000, 1.2
    depth_m = 0.5 * GRAVITY * fall_s**2
    for readings in recorded(start_s=15.0).steps(10.5):
        rig.feed(fallen(readings, drop_us, fall_s))
        down = rig.position.position_ned[2] if rig.local.value is not None else 0.0
        assert down < depth_m + 0.4 * GRAVITY * fall_s
        if readings.truth.time_us > drop_us + (fall_s + 0.5) * 1e6:
            assert rig.position.velocity_ned[2] == pytest.approx(0.0, abs=0.5)
            assert down == pytest.approx(depth_m, abs=1.0)


@pytest.mark.thorough
@pytest.mark.parametrize("declination_deg", [-4.0, 5.0])
def test_a_wrong_declination_is_found_in_flight(declination_deg: float) -> None:
    flight = Flight(3, errors=replace(Errors(), declination_deg=declination_deg))
    errors, _ = fly(flight, Rig(), 60.0, from_s=40.0)
    assert rms(errors)[8] < math.radians(2.0)
    assert (rms(errors)[6:8] < math.radians(0.5)).all()


@pytest.mark.first_case
@pytest.mark.parametrize("heading", [0.0, 1.5, 3.1, -2.0])
def test_any_heading_is_found_at_rest(heading: float) -> None:
    rig = Rig()
    # At rest a bias of the accelerometer looks like tilt: 0.02 m/s^2 are 0.12 degrees.
    sensors = replace(Errors(), accel_bias=0.02)
    flight = Flight(2, heading=heading, start_s=100.0, errors=sensors)
    errors, _ = fly(flight, rig, 10.0, from_s=9.0)
    assert np.abs(errors[:, 6:8]).max() < math.radians(0.6)
    assert np.abs(errors[:, 8]).max() < math.radians(1.5)
    assert math.cos(rig.position.heading - heading) > math.cos(math.radians(1.5))


@pytest.mark.thorough
def test_at_rest_tilt_is_never_known_better_than_the_accelerometer() -> None:
    """However long GPS is watched: tilt and accelerometer bias look the same there."""
    rig = Rig()
    for readings in Flight(5, start_s=100.0).steps(40.0):
        rig.feed(readings)
    core = rig.module.estimator.core
    assert core is not None
    bias = 0.05  # [m/s^2] EKF2_ABIAS_INIT
    assert min(core.ekf.sigma(6), core.ekf.sigma(7)) > 0.9 * bias / GRAVITY
    assert min(core.ekf.sigma(9), core.ekf.sigma(10)) > 0.9 * bias


def test_gyro_bias_is_found_and_taken_off_the_rate() -> None:
    rig = Rig()
    flight = Flight(4, errors=replace(PERFECT, gyro_bias=0.02), start_s=100.0)
    for readings in flight.steps(8.0):
        rig.feed(readings)
    assert rig.attitude.value is not None
    assert rig.status.value is not None
    assert rig.attitude.value.rate_frd == pytest.approx((0.0, 0.0, 0.0), abs=2e-4)
    assert max(map(abs, rig.status.value.gyro_bias_frd)) > 0.005


def test_acceleration_is_without_gravity() -> None:
    rig = Rig()
    for readings in Flight(errors=PERFECT, start_s=100.0).steps(8.0):
        rig.feed(readings)
    assert rig.position.acceleration_ned == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


@pytest.mark.thorough
def test_the_same_readings_give_the_same_estimate_to_the_last_bit() -> None:
    positions = []
    for _ in range(2):
        rig = Rig()
        for readings in Flight(9, start_s=7.0).steps(12.0):
            rig.feed(readings)
        positions.append(rig.position)
    assert said(positions[0]) == said(positions[1])
