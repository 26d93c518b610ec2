"""State vectors come at their rate, each with a position that has just arrived."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.vehicle.reporter import POSITION_WITHIN_S, StateVectorSchedule

LOOP_S = 0.01


def vectors(
    received_at: list[float], seconds: float, every_s: float = 1.0
) -> list[tuple[float, float]]:
    """Give the time of each vector, and how old its position was."""
    schedule, published_at = StateVectorSchedule(every_s), []
    for tick in range(round(seconds / LOOP_S)):
        now = tick * LOOP_S
        ages = [now - at for at in received_at if at <= now]
        if schedule.is_due(now, min(ages, default=None)):
            schedule.published(now)
            published_at.append((now, min(ages)))
    return published_at


@pytest.mark.thorough
@given(st.floats(0.0, 0.2), st.sampled_from([0.1, 0.2, 0.25, 0.4]))
def test_each_vector_has_a_new_position_and_the_rate_holds(phase_s: float, period_s: float) -> None:
    received_at = [phase_s + n * period_s for n in range(round(20.0 / period_s))]
    published_at = vectors(received_at, 20.0)
    assert max(age for _, age in published_at) <= 2.0 * LOOP_S
    assert 19 <= len(published_at) <= 21


def test_without_new_positions_what_is_known_is_published_more_slowly() -> None:
    published_at = vectors([0.0], 10.0)
    assert [age for _, age in published_at[1:]] == [at for at, _ in published_at[1:]]
    assert len(published_at) >= 10.0 / (1.0 + POSITION_WITHIN_S) - 1.0


def test_before_the_first_position_nothing_is_due() -> None:
    assert vectors([], 5.0) == []


def test_a_long_silence_is_not_made_up_for() -> None:
    received_at = [0.0, *(30.0 + n * 0.2 for n in range(25))]
    schedule, behind = StateVectorSchedule(1.0), 0
    schedule.published(0.0)
    for tick in range(3000, 3500):
        now = tick * LOOP_S
        age = min(now - moment for moment in received_at if moment <= now)
        if schedule.is_due(now, age):
            schedule.published(now)
            behind += 1
    assert behind <= 6


def test_a_requested_vector_does_not_delay_the_next_one() -> None:
    schedule = StateVectorSchedule(1.0)
    schedule.published(10.0)
    schedule.published(10.5)
    assert not schedule.is_due(10.9, 0.0)
    assert schedule.is_due(11.0, 0.0)
