"""What is measured is the map at the vehicle's place, within the instruments' noise."""

import numpy as np
import pytest

from sim.sensors import environment
from sim.sensors.environment import EnvironmentSensors
from sim.world.farm import Farm
from tests.unit.sim.truths import truth

NOON_S = 1_782_043_200.0  # 2026-06-21T12:00:00Z
FARM = Farm(1)
PLACES = ((40.4434, -3.7382), (40.4441, -3.7389), (40.4428, -3.7371))


def sensors(factor: float) -> EnvironmentSensors:
    return EnvironmentSensors(np.random.default_rng(3), FARM, factor=factor)


@pytest.mark.parametrize("place", PLACES)
def test_without_noise_it_measures_the_map(place: tuple[float, float]) -> None:
    here = truth(latitude_deg=place[0], longitude_deg=place[1], height_above_home_m=8.0)
    sample = sensors(0.0).read(here, NOON_S)
    assert sample.soil_moisture == FARM.soil_moisture(*place, NOON_S)
    assert sample.soil_temperature_c == FARM.soil_temperature(*place, NOON_S)
    assert sample.air_temperature_c == FARM.air_temperature(*place, NOON_S, 8.0)
    assert sample.relative_humidity_percent == FARM.relative_humidity(*place, NOON_S, 8.0)
    assert sample.illuminance_lx == FARM.illuminance(*place, NOON_S)


def test_two_places_differ_by_more_than_the_noise() -> None:
    moistures = [FARM.soil_moisture(*place, NOON_S) for place in PLACES]
    assert max(moistures) - min(moistures) > environment.SOIL_MOISTURE_SIGMA


def test_the_noise_is_the_instruments_own() -> None:
    instruments = sensors(1.0)
    samples = [instruments.read(truth(), NOON_S) for _ in range(600)]
    place = PLACES[0]
    for values, true_value, sigma in (
        ([s.soil_moisture for s in samples], FARM.soil_moisture(*place, NOON_S), 0.01),
        ([s.soil_temperature_c for s in samples], FARM.soil_temperature(*place, NOON_S), 0.5),
        ([s.air_temperature_c for s in samples], FARM.air_temperature(*place, NOON_S, 0.0), 0.1),
    ):
        assert np.std(values) == pytest.approx(sigma, rel=0.15)
        assert np.mean(values) == pytest.approx(true_value, abs=5.0 * sigma / 600**0.5)


def test_no_humidity_is_beyond_what_can_be() -> None:
    instruments = sensors(50.0)
    humidities = [instruments.read(truth(), NOON_S).relative_humidity_percent for _ in range(300)]
    assert min(humidities) == 0.0
    assert max(humidities) == 100.0
