"""The range finder measures along the body, within its reach."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.truth import Truth
from sim.sensors.rangefinder import MAXIMUM_M, RangeFinder, slant_distance_m
from tests.unit.sim.truths import truth


def tilted(height_m: float, roll_deg: float) -> Truth:
    return truth(roll_deg=roll_deg, height_above_home_m=height_m)


def measured(height_m: float, roll_deg: float = 0.0, factor: float = 0.0) -> float:
    return (
        RangeFinder(np.random.default_rng(1), factor=factor)
        .read(tilted(height_m, roll_deg))
        .distance_m
    )


@given(st.floats(0.5, 30.0), st.floats(0.0, 40.0))
def test_it_measures_more_the_higher_and_the_more_tilted(height_m: float, roll_deg: float) -> None:
    assert measured(height_m) < measured(height_m + 1.0)
    assert measured(height_m, roll_deg) <= measured(height_m, roll_deg + 1.0)


def test_at_ten_metres_and_sixty_degrees_of_roll_it_measures_twenty() -> None:
    assert measured(10.0, 60.0) == pytest.approx(2.0 * measured(10.0), rel=1e-6)
    assert measured(10.0) == pytest.approx(10.0, abs=0.2)


def test_on_the_ground_it_still_measures_something() -> None:
    assert 0.0 < measured(0.0) < 0.5


@pytest.mark.parametrize(("height_m", "roll_deg"), [(MAXIMUM_M + 1.0, 0.0), (5.0, 120.0)])
def test_beyond_its_reach_nothing_comes_back(height_m: float, roll_deg: float) -> None:
    assert math.isnan(measured(height_m, roll_deg))


def test_its_noise_is_a_few_centimetres_at_ten_metres() -> None:
    finder = RangeFinder(np.random.default_rng(7), factor=1.0)
    errors = [finder.read(tilted(10.0, 0.0)).distance_m for _ in range(2000)]
    true_m = slant_distance_m(tilted(10.0, 0.0))
    assert np.std(errors) == pytest.approx(0.07, rel=0.1)
    assert np.mean(errors) == pytest.approx(true_m, abs=0.01)
