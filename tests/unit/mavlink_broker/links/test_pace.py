"""A radio that is full is written to more slowly, never not at all, and fast again later."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.pace import SLOWEST, Pace

BAUD = 57_600
FRAME_BYTES = 50


def written_in(pace: Pace, seconds: float) -> int:
    """Bytes that get through when there is always something to write."""
    written, step_s = 0, 0.02
    for n in range(round(seconds / step_s)):
        while written < seconds * BAUD and pace.allows(n * step_s):
            pace.wrote(FRAME_BYTES)
            written += FRAME_BYTES
            if pace.factor >= 1.0:
                break
    return written


def test_without_a_report_nothing_is_held_back() -> None:
    pace = Pace(BAUD)
    assert all(pace.allows(0.0) for _ in range(1000))


def test_a_full_radio_gets_less_and_less_but_always_a_tenth() -> None:
    pace = Pace(BAUD)
    rates = []
    for _ in range(20):
        pace.report(5)
        rates.append(pace.factor)
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] == SLOWEST


def test_an_empty_one_gets_more_again_up_to_the_line() -> None:
    pace = Pace(BAUD)
    for _ in range(20):
        pace.report(5)
    for _ in range(100):
        pace.report(100)
    assert pace.factor == 1.0


def test_in_between_the_rate_stays() -> None:
    pace = Pace(BAUD)
    pace.report(0)
    before = pace.factor
    pace.report(50)
    assert pace.factor == before


@given(reports=st.integers(1, 30))
def test_what_is_written_keeps_the_rate(reports: int) -> None:
    pace = Pace(BAUD)
    for _ in range(reports):
        pace.report(0)
    assert written_in(pace, 10.0) == pytest.approx(10.0 * pace.bytes_s, rel=0.05)


@given(st.lists(st.integers(0, 255)))
def test_any_reports_leave_a_sensible_rate(reports: list[int]) -> None:
    pace = Pace(BAUD)
    for report in reports:
        pace.report(report)
    assert SLOWEST <= pace.factor <= 1.0
