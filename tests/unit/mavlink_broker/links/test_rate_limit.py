"""A full radio is written to more slowly, never not at all, and fast again later."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.link import MIN_FACTOR, RateLimiter

BAUD = 57_600
FRAME_BYTES = 50


def written_in(rate_limiter: RateLimiter, seconds: float) -> int:
    """Bytes that get through when there is always something to write."""
    written, step_s = 0, 0.02
    for n in range(round(seconds / step_s)):
        while written < seconds * BAUD and rate_limiter.allows(n * step_s):
            rate_limiter.written(FRAME_BYTES)
            written += FRAME_BYTES
            if rate_limiter.factor >= 1.0:
                break
    return written


def test_without_a_report_nothing_is_held_back() -> None:
    rate_limiter = RateLimiter(BAUD)
    assert all(rate_limiter.allows(0.0) for _ in range(1000))


def test_the_rate_of_a_full_radio_decreases_to_a_tenth() -> None:
    rate_limiter = RateLimiter(BAUD)
    rates = []
    for _ in range(20):
        rate_limiter.report(5)
        rates.append(rate_limiter.factor)
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] == MIN_FACTOR


def test_an_empty_one_gets_more_again_up_to_the_line() -> None:
    rate_limiter = RateLimiter(BAUD)
    for _ in range(20):
        rate_limiter.report(5)
    for _ in range(100):
        rate_limiter.report(100)
    assert rate_limiter.factor == 1.0


def test_in_between_the_rate_stays() -> None:
    rate_limiter = RateLimiter(BAUD)
    rate_limiter.report(0)
    before = rate_limiter.factor
    rate_limiter.report(50)
    assert rate_limiter.factor == before


@given(reports=st.integers(1, 30))
def test_what_is_written_keeps_the_rate(reports: int) -> None:
    rate_limiter = RateLimiter(BAUD)
    for _ in range(reports):
        rate_limiter.report(0)
    assert written_in(rate_limiter, 10.0) == pytest.approx(10.0 * rate_limiter.bytes_s, rel=0.05)


@given(st.lists(st.integers(0, 255)))
def test_any_reports_leave_a_sensible_rate(reports: list[int]) -> None:
    rate_limiter = RateLimiter(BAUD)
    for report in reports:
        rate_limiter.report(report)
    assert MIN_FACTOR <= rate_limiter.factor <= 1.0
