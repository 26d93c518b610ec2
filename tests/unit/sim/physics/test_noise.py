"""Random processes have the statistics that they are documented with."""

import math
import statistics
from itertools import islice

import pytest

from sim.physics.noise import (
    STREAMS,
    GaussMarkov,
    generators,
    normal_vector,
    standard_normals,
    white_sigma,
)


def test_every_stream_is_independent_of_the_others() -> None:
    first = {
        name: tuple(islice(standard_normals(generator), 3))
        for name, generator in generators(1).items()
    }
    assert set(first) == set(STREAMS)
    assert len(set(first.values())) == len(STREAMS)


def test_a_stream_follows_from_the_seed() -> None:
    one, again, other = (
        list(islice(standard_normals(generators(seed)["gps"]), 3000)) for seed in (1, 1, 2)
    )
    assert one == again
    assert one != other


def test_standard_normals_have_mean_zero_and_variance_one() -> None:
    sample = list(islice(standard_normals(generators(1)["imu"]), 100_000))
    assert statistics.fmean(sample) == pytest.approx(0.0, abs=0.012)
    assert statistics.pvariance(sample) == pytest.approx(1.0, abs=0.02)
    assert sum(abs(value) > 2.0 for value in sample) / 1e5 == pytest.approx(0.0455, abs=0.003)


def test_white_noise_of_a_density_in_half_the_sampling_rate() -> None:
    assert white_sigma(0.01, 200.0) == pytest.approx(0.1)


@pytest.fixture(scope="module")
def drift() -> list[float]:
    process = GaussMarkov(
        standard_normals(generators(4)["baro"]), sigma=3.0, correlation_time_s=2.0, step_s=0.1
    )
    return [process.step() for _ in range(100_000)]


def test_a_gauss_markov_process_keeps_its_standard_deviation(drift: list[float]) -> None:
    assert statistics.pstdev(drift) == pytest.approx(3.0, rel=0.05)
    assert statistics.fmean(drift) == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("lag_s", [0.5, 2.0, 4.0])
def test_a_gauss_markov_process_forgets_exponentially(drift: list[float], lag_s: float) -> None:
    lag = round(lag_s / 0.1)
    covariance = statistics.fmean(a * b for a, b in zip(drift, drift[lag:], strict=False))
    assert covariance / 9.0 == pytest.approx(math.exp(-lag_s / 2.0), abs=0.06)


def test_a_gauss_markov_process_starts_in_its_stationary_state() -> None:
    normals = standard_normals(generators(5)["baro"])
    starts = [
        GaussMarkov(normals, sigma=3.0, correlation_time_s=1e6, step_s=0.1).value
        for _ in range(2000)
    ]
    assert statistics.pstdev(starts) == pytest.approx(3.0, rel=0.1)


def test_a_vector_has_three_components_of_their_own() -> None:
    x, y, z = normal_vector(standard_normals(generators(1)["imu"]), 0.5)
    assert len({x, y, z}) == 3
