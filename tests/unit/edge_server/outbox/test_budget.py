"""How full is full, and which samples are superfluous."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_server.outbox import budget
from edge_server.outbox.budget import THINNING_INTERVAL_S, Level, Sample
from edge_server.outbox.queue import PRIORITY


@pytest.mark.parametrize(
    ("share", "level"),
    [
        (0.0, Level.NORMAL),
        (0.7999, Level.NORMAL),
        (0.8, Level.THINNING),
        (0.9499, Level.THINNING),
        (0.95, Level.NO_PICTURES),
        (0.9999, Level.NO_PICTURES),
        (1.0, Level.DROPPING),
        (1.0499, Level.DROPPING),
        (1.05, Level.FULL),
        (9.0, Level.FULL),
    ],
)
def test_each_level_begins_at_its_share(share: float, level: Level) -> None:
    assert budget.level(share * 1e6, 1e6) is level


@pytest.mark.parametrize(
    ("level", "refused"),
    [
        (Level.NORMAL, set()),
        (Level.THINNING, set()),
        (Level.NO_PICTURES, {"image"}),
        (Level.DROPPING, PRIORITY.keys() - {"alarm", "mission_report"}),
        (Level.FULL, PRIORITY.keys()),
    ],
)
def test_the_fuller_the_less_comes_in(level: Level, refused: set[str]) -> None:
    assert {kind for kind in PRIORITY if not budget.has_room(kind, level)} == refused


def test_alarms_reports_and_observations_are_never_dropped() -> None:
    kept = {"alarm", "mission_report", "observation", "gap", "image"}
    assert PRIORITY.keys() - set(budget.DROPPED) == kept
    assert set(budget.THINNED) <= set(budget.DROPPED)


TIMES = st.lists(st.floats(0, 1000), max_size=60).map(sorted)


@given(TIMES)
def test_one_sample_per_interval_stays_the_first(times: list[float]) -> None:
    samples = [Sample(row, taken_at) for row, taken_at in enumerate(times)]
    going, _ = budget.superfluous(samples, None)
    kept = [sample.recorded_at for sample in samples if sample.row not in going]
    intervals = [taken_at // THINNING_INTERVAL_S for taken_at in times]
    assert [taken_at // THINNING_INTERVAL_S for taken_at in kept] == list(dict.fromkeys(intervals))
    assert all(times[intervals.index(at // THINNING_INTERVAL_S)] == at for at in kept)


@given(TIMES, st.integers(0, 60))
def test_in_two_parts_it_is_the_same(times: list[float], cut: int) -> None:
    samples = [Sample(row, taken_at) for row, taken_at in enumerate(times)]
    first, last_kept = budget.superfluous(samples[:cut], None)
    second, _ = budget.superfluous(samples[cut:], last_kept)
    assert first + second == budget.superfluous(samples, None)[0]


def test_a_clock_that_was_set_back_loses_nothing_more() -> None:
    samples = [Sample(0, 1000.0), Sample(1, 5.0), Sample(2, 6.0)]
    assert budget.superfluous(samples, None)[0] == [2]
