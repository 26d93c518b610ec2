"""The edge server's time of day, read from answers that arrive late."""

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.edge.edge_clock import EdgeClock

NOON = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


def at(seconds: float) -> datetime:
    """The edge server's time so long after noon; the program's clock shows 100 s at noon."""
    return NOON + timedelta(seconds=seconds)


def test_it_is_not_known_without_an_answer() -> None:
    assert EdgeClock().time(100.0) is None


@given(st.lists(st.floats(0.0, 30.0), min_size=2, max_size=16))
def test_it_is_late_by_the_shortest_delay_at_most(delays_s: list[float]) -> None:
    clock = EdgeClock()
    for number, delay_s in enumerate(delays_s):
        received = 100.0 + 20.0 * number + delay_s
        clock.note(at(20.0 * number), received - delay_s, received)
    known = clock.time(1000.0)
    assert known is not None
    assert (at(900.0) - known).total_seconds() == pytest.approx(min(delays_s), abs=1e-3)


@given(st.floats(0.0, 10.0), st.floats(0.0, 86_400.0))
def test_the_first_answer_counts_as_written_when_it_was_asked_for(
    held_s: float, suspended_s: float
) -> None:
    """It was on its way for long, or the program was suspended: an order in it may have expired."""
    clock = EdgeClock()
    read = 100.0 + held_s + suspended_s
    clock.note(at(0.0), 100.0, read)
    known = clock.time(read)
    assert known is not None
    assert (known - at(held_s + suspended_s)).total_seconds() == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("step_s", [-3600.0, -2.0, 2.0, 3600.0])
def test_a_clock_that_was_set_is_followed_at_once(step_s: float) -> None:
    clock = EdgeClock()
    clock.note(at(0.0), 99.9, 100.0)
    clock.note(at(20.0 + step_s), 119.9, 120.0)
    assert clock.time(130.0) == at(30.0 + step_s)


def test_a_clock_that_was_set_back_a_little_is_followed_in_time() -> None:
    clock = EdgeClock()
    clock.note(at(0.0), 99.9, 100.0)
    for number in range(1, 17):  # Each answer is waited for longer than the clock was set back
        received = 100.0 + 20.0 * number
        clock.note(at(20.0 * number - 5.0), received - 20.0, received)
    assert clock.time(500.0) == at(395.0)


@given(st.floats(0.0, 5.0), st.floats(0.0, 86_400.0))
def test_an_answer_that_is_read_late_does_not_set_the_clock_back(
    waited_s: float, suspended_s: float
) -> None:
    """The program was suspended while an order lay in its socket: the order has expired."""
    clock = EdgeClock()
    clock.note(at(0.0), 99.9, 100.0)
    read = 120.0 + waited_s + suspended_s
    clock.note(at(20.0 + waited_s), 120.0, read)
    known = clock.time(read)
    assert known is not None
    assert abs((at(20.0 + waited_s + suspended_s) - known).total_seconds()) < 1e-3
