"""State vectors come at their rate, each with a position that has just been heard."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.vehicle.state_vector_schedule import PATIENCE_S, VectorPace

LOOP_S = 0.01


def vectors(
    heard_at: list[float], seconds: float, every_s: float = 1.0
) -> list[tuple[float, float]]:
    """Give the time of each vector, and how old its position was."""
    pace, told = VectorPace(every_s), []
    for tick in range(round(seconds / LOOP_S)):
        now = tick * LOOP_S
        ages = [now - heard for heard in heard_at if heard <= now]
        if pace.is_due(now, min(ages, default=None)):
            pace.told(now)
            told.append((now, min(ages)))
    return told


@given(st.floats(0.0, 0.2), st.sampled_from([0.1, 0.2, 0.25, 0.4]))
def test_each_vector_has_a_new_position_and_the_rate_holds(phase_s: float, period_s: float) -> None:
    heard = [phase_s + n * period_s for n in range(round(20.0 / period_s))]
    told = vectors(heard, 20.0)
    assert max(age for _, age in told) <= 2.0 * LOOP_S
    assert 19 <= len(told) <= 21


def test_without_new_positions_what_is_known_is_told_more_slowly() -> None:
    told = vectors([0.0], 10.0)
    assert [age for _, age in told[1:]] == [at for at, _ in told[1:]]
    assert len(told) >= 10.0 / (1.0 + PATIENCE_S) - 1.0


def test_before_the_first_position_nothing_is_due() -> None:
    assert vectors([], 5.0) == []


def test_a_long_silence_is_not_made_up_for() -> None:
    heard = [0.0, *(30.0 + n * 0.2 for n in range(25))]
    pace, behind = VectorPace(1.0), 0
    pace.told(0.0)
    for tick in range(3000, 3500):
        now = tick * LOOP_S
        age = min(now - moment for moment in heard if moment <= now)
        if pace.is_due(now, age):
            pace.told(now)
            behind += 1
    assert behind <= 6


def test_a_vector_that_was_asked_for_does_not_put_off_the_next_one() -> None:
    pace = VectorPace(1.0)
    pace.told(10.0)
    pace.told(10.5)
    assert not pace.is_due(10.9, 0.0)
    assert pace.is_due(11.0, 0.0)
