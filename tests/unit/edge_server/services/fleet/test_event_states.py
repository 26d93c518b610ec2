"""The states of an event."""

import itertools
import re

import pytest

from edge_server.services.fleet import event_states
from edge_server.services.fleet.event_states import EVENT_STATES, STATUS, State, Trigger, state_of
from edge_server.transitions import IllegalTransitionError

TRANSITIONS = EVENT_STATES.transitions

ENDS = {State.DONE, State.REFUSED, State.EXPIRED}


@pytest.mark.parametrize(("state", "trigger"), list(itertools.product(State, Trigger)))
def test_every_pair_is_in_the_table_or_illegal(state: State, trigger: Trigger) -> None:
    if (state, trigger) in TRANSITIONS:
        assert EVENT_STATES.follow(state, trigger) is TRANSITIONS[state, trigger]
    else:
        with pytest.raises(IllegalTransitionError):
            EVENT_STATES.follow(state, trigger)


def test_a_final_state_is_not_left() -> None:
    assert all(target is state for (state, _), target in TRANSITIONS.items() if state in ENDS)


def test_only_a_queued_event_expires() -> None:
    late = [state for state, trigger in TRANSITIONS if trigger is Trigger.TOO_LATE]
    assert late == [State.QUEUED]


def test_each_state_has_its_status_and_final_ones_a_terminal_one() -> None:
    assert [state_of(STATUS[state]) for state in State] == list(State)
    assert {state for state in State if STATUS[state].is_terminal} == ENDS


def test_the_diagram_is_the_table() -> None:
    drawn = re.findall(r"^ +(\w+) --> (\w+): (.+)$", event_states.__doc__ or "", re.MULTILINE)
    assert set(drawn) == {
        (state.name, target.name, trigger.value) for (state, trigger), target in TRANSITIONS.items()
    }
