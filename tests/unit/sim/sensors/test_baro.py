"""Barometric errors, and which way pressure goes."""

import itertools
import statistics

import pytest

from sim.config import SimulationConfig
from sim.physics.noise import generators
from sim.sensors.baro import OFFSET_SIGMA_PA, SUCTION_SHARE, WHITE_SIGMA_PA, Barometer
from sim.simulation import Simulation
from tests.unit.sim.truths import truth


def baro(*, seed: int = 1, factor: float = 1.0) -> Barometer:
    return Barometer(generators(seed)["baro"], factor=factor)


def test_an_ideal_barometer_reads_the_truth() -> None:
    reading = baro(factor=0.0).read(truth(20_000, pressure_pa=90_000.0))
    assert (reading.time_us, reading.pressure_pa) == (20_000, 90_000.0)


def test_the_board_is_warmer_than_the_air() -> None:
    assert 10.0 < baro().read(truth(temperature_c=10.0)).temperature_c < 30.0


def test_noise_within_a_second_is_that_of_the_data_sheet() -> None:
    instrument = baro()
    pressures = [instrument.read(truth()).pressure_pa for _ in range(20_000)]
    differences = [b - a for a, b in itertools.pairwise(pressures)]
    assert statistics.pstdev(differences) == pytest.approx(2**0.5 * WHITE_SIGMA_PA, rel=0.05)


def test_moving_air_sucks_at_the_case() -> None:
    """A tenth of half the density times the square of the speed is missing: altitude reads high."""
    still = baro(factor=1.0).read(truth())
    moved = baro(factor=1.0).read(truth(airspeed_m_s=10.0))
    dynamic_pa = 0.5 * 1.15 * 10.0**2
    assert still.pressure_pa - moved.pressure_pa == pytest.approx(
        SUCTION_SHARE * dynamic_pa, rel=0.1
    )


def test_each_flight_has_an_offset_of_its_own() -> None:
    errors = [baro(seed=seed).read(truth()).pressure_pa - 93756.0 for seed in range(300)]
    assert statistics.pstdev(errors) == pytest.approx(OFFSET_SIGMA_PA, rel=0.15)


def test_pressure_falls_in_a_climb() -> None:
    simulation = Simulation(SimulationConfig())
    pressures = []
    for _ in range(1000):
        reading = simulation.step((0.6, 0.6, 0.6, 0.6)).baro
        if reading is not None:
            pressures.append(reading.pressure_pa)
    fallen_pa = statistics.fmean(pressures[:10]) - statistics.fmean(pressures[-10:])
    climbed_m = simulation.truth.height_above_home_m
    assert climbed_m > 20.0
    assert fallen_pa / climbed_m == pytest.approx(11.2, rel=0.1)
