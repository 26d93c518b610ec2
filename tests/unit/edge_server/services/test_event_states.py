"""The table of an event's life."""

import itertools

import pytest

from edge_server.services.event_states import (
    STATUS,
    TRANSITIONS,
    Happening,
    IllegalTransitionError,
    State,
    follow,
    state_of,
)

ENDS = {State.DONE, State.REFUSED, State.EXPIRED}


@pytest.mark.parametrize(("state", "happening"), list(itertools.product(State, Happening)))
def test_every_pair_is_in_the_table_or_illegal(state: State, happening: Happening) -> None:
    if (state, happening) in TRANSITIONS:
        assert follow(state, happening) is TRANSITIONS[state, happening]
    else:
        with pytest.raises(IllegalTransitionError):
            follow(state, happening)


def test_an_end_is_for_good() -> None:
    assert all(target is state for (state, _), target in TRANSITIONS.items() if state in ENDS)


def test_only_what_nobody_has_accepted_expires() -> None:
    late = [state for state, happening in TRANSITIONS if happening is Happening.TOO_LATE]
    assert late == [State.QUEUED]


def test_a_state_is_told_by_its_status_and_an_end_by_a_terminal_one() -> None:
    assert [state_of(STATUS[state]) for state in State] == list(State)
    assert {state for state in State if STATUS[state].is_terminal} == ENDS
