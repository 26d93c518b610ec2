"""The magnetometer as a compass."""

import math
import statistics

import pytest

from sim.physics.noise import generators
from sim.sensors.magnetometer import HARD_IRON_SIGMA_GAUSS, WHITE_SIGMA_GAUSS, Magnetometer
from tests.unit.sim.truths import truth

DECLINATION_DEG = 0.607


def magnetometer(*, seed: int = 1, factor: float = 1.0, current_a: float = 0.0) -> Magnetometer:
    return Magnetometer(
        generators(seed)["magnetometer"],
        factor=factor,
        field_ned_gauss=(0.257578, 0.002731, 0.370230),
        supply_current_a=lambda: current_a,
    )


def level_heading_deg(field_frd: tuple[float, float, float]) -> float:
    """Magnetic heading of a level body: the field turns left when the body turns right."""
    return math.degrees(math.atan2(-field_frd[1], field_frd[0])) % 360.0


@pytest.mark.parametrize("yaw_deg", [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 300.0])
def test_a_compass_shows_the_yaw_less_the_declination(yaw_deg: float) -> None:
    reading = magnetometer(factor=0.0).read(truth(yaw_deg=yaw_deg))
    expected = (yaw_deg - DECLINATION_DEG) % 360.0
    assert level_heading_deg(reading.field_frd_gauss) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("yaw_deg", [10.0, 100.0, 190.0, 280.0])
def test_an_honest_compass_is_a_few_degrees_off(yaw_deg: float) -> None:
    errors = []
    for seed in range(50):
        heading = level_heading_deg(
            magnetometer(seed=seed).read(truth(yaw_deg=yaw_deg)).field_frd_gauss
        )
        errors.append((heading - yaw_deg + DECLINATION_DEG + 180.0) % 360.0 - 180.0)
    assert 0.2 < statistics.pstdev(errors) < 2.0


def test_the_field_points_into_the_ground_in_the_northern_hemisphere() -> None:
    assert magnetometer().read(truth()).field_frd_gauss[2] > 0.3


def test_nose_down_brings_the_field_forward() -> None:
    level, nose_down = (
        magnetometer(factor=0.0).read(truth(pitch_deg=pitch_deg)).field_frd_gauss[0]
        for pitch_deg in (0.0, -20.0)
    )
    assert nose_down > level


def test_right_side_down_brings_the_field_to_the_right() -> None:
    assert magnetometer(factor=0.0).read(truth(roll_deg=20.0)).field_frd_gauss[1] > 0.1


def test_noise_and_hard_iron_are_as_documented() -> None:
    instrument = magnetometer()
    samples = [instrument.read(truth()).field_frd_gauss[0] for _ in range(5000)]
    assert statistics.pstdev(samples) == pytest.approx(WHITE_SIGMA_GAUSS, rel=0.05)
    means = []
    for seed in range(200):
        other = magnetometer(seed=seed)
        means.append(statistics.fmean(other.read(truth()).field_frd_gauss[2] for _ in range(50)))
    assert statistics.pstdev(means) == pytest.approx(HARD_IRON_SIGMA_GAUSS, rel=0.2)


def mean_field(instrument: Magnetometer) -> list[float]:
    samples = [instrument.read(truth()).field_frd_gauss for _ in range(500)]
    return [statistics.fmean(axis) for axis in zip(*samples, strict=True)]


def test_the_supply_current_bends_the_field_in_proportion() -> None:
    resting, hovering, climbing = (
        mean_field(magnetometer(current_a=current_a)) for current_a in (0.0, 11.0, 44.0)
    )
    hover_shift = [b - a for a, b in zip(resting, hovering, strict=True)]
    climb_shift = [b - a for a, b in zip(resting, climbing, strict=True)]
    assert math.hypot(*climb_shift) > 4e-3
    assert climb_shift == pytest.approx([4.0 * shift for shift in hover_shift], abs=2e-3)


def test_the_bend_of_many_vehicles_is_as_documented() -> None:
    shifts = []
    for seed in range(300):
        loud = magnetometer(seed=seed, current_a=10_000.0).read(truth()).field_frd_gauss[0]
        shifts.append(loud / 10_000.0)
    assert statistics.pstdev(shifts) == pytest.approx(0.4e-3, rel=0.15)
