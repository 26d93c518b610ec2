"""Waits between tries."""

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from edge_server.outbox.retry import LONGEST_RETRY_AFTER_S, Backoff

BACKOFF = Backoff(base_s=0.5, cap_s=10.0)
SEEDS = st.integers(0, 2**32)


@given(failures=st.integers(1, 10**6), seed=SEEDS)
def test_a_wait_is_never_longer_than_the_cap(failures: int, seed: int) -> None:
    assert 0.0 <= BACKOFF.delay_s(failures, Random(seed)) <= 10.0


@given(failures=st.integers(1, 60), seed=SEEDS)
def test_the_same_luck_waits_longer_after_more_failures(failures: int, seed: int) -> None:
    now = BACKOFF.delay_s(failures, Random(seed))
    assert BACKOFF.delay_s(failures + 1, Random(seed)) >= now


def test_waits_are_spread_over_the_whole_range() -> None:
    random = Random(1)
    waits = [BACKOFF.delay_s(20, random) for _ in range(1000)]
    assert min(waits) < 1.0
    assert max(waits) > 9.0
    assert 4.0 < sum(waits) / len(waits) < 6.0


@given(wish=st.floats(0.0, 1e9), seed=SEEDS)
def test_the_clouds_wish_is_a_minimum_within_reason(wish: float, seed: int) -> None:
    wait = BACKOFF.delay_s(1, Random(seed), retry_after_s=wish)
    assert wait >= min(wish, LONGEST_RETRY_AFTER_S)
    assert wait <= max(LONGEST_RETRY_AFTER_S, BACKOFF.cap_s)
