"""The growth of the console's heap is a trend: single samples jump by more than the limit."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.bench.console_browser import heap_growth

MINUTES = 10.0


def samples(growth: float, jump: float = 0.0, seed: int = 1) -> list[tuple[float, float]]:
    """One a minute, with a heap that grows by a share in all, and jumps at most by another."""
    random = Random(seed)
    return [
        (minute, 10e6 * (1.0 + growth * minute / MINUTES) * (1.0 + random.uniform(-jump, jump)))
        for minute in range(round(MINUTES) + 1)
    ]


def test_a_heap_that_grows_is_told_from_one_that_shrinks() -> None:
    assert heap_growth(samples(0.05), MINUTES) > 0.0 > heap_growth(samples(-0.05), MINUTES)


@given(st.floats(-0.5, 2.0))
def test_without_jumps_it_is_the_growth(growth: float) -> None:
    assert heap_growth(samples(growth), MINUTES) == pytest.approx(100.0 * growth, abs=0.1)


@pytest.mark.parametrize("seed", range(20))
def test_one_sample_that_jumps_does_not_decide(seed: int) -> None:
    found = samples(0.02)
    index = Random(seed).randrange(len(found))
    found[index] = (found[index][0], found[index][1] * 1.3)
    assert heap_growth(found, MINUTES) == pytest.approx(2.0, abs=1.5)


def test_a_leak_shows_through_the_jumps() -> None:
    growths = [heap_growth(samples(0.4, 0.05, seed), MINUTES) for seed in range(20)]
    assert min(growths) > 10.0
