"""The states of an outbox row."""

import itertools
import re

import pytest

from edge_server.outbox import queue
from edge_server.outbox.queue import ROW_STATES, State, Trigger
from edge_server.transitions import IllegalTransitionError
from tests.support import pages
from tests.support.cases import failures

DRAWN = re.compile(r"^ +(\w+) --> (\w+): (.+)$", re.MULTILINE)
TRANSITIONS = ROW_STATES.transitions


def check_pair(state: State, trigger: Trigger) -> None:
    if (state, trigger) in TRANSITIONS:
        assert ROW_STATES.follow(state, trigger) is TRANSITIONS[state, trigger]
    else:
        with pytest.raises(IllegalTransitionError):
            ROW_STATES.follow(state, trigger)


def test_every_pair_is_in_the_table_or_illegal() -> None:
    assert failures(check_pair, itertools.product(State, Trigger)) == []


def test_dead_and_gone_are_final_and_only_a_confirmation_deletes() -> None:
    assert all(state not in {State.GONE, State.DEAD} for state, _ in TRANSITIONS)
    triggers = [trigger for (_, trigger), target in TRANSITIONS.items() if target is State.GONE]
    assert triggers == [Trigger.CONFIRMED]


def test_every_state_is_reached_from_the_first() -> None:
    reached = {State.QUEUED}
    for _ in State:
        reached |= {target for (state, _), target in TRANSITIONS.items() if state in reached}
    assert reached == set(State)


def test_the_diagrams_are_the_table() -> None:
    table = {
        (state.name, target.name, trigger.value) for (state, trigger), target in TRANSITIONS.items()
    }
    for text in (queue.__doc__ or "", pages.text("explanation/store-and-forward.md")):
        drawn = {
            (state, target, trigger)
            for state, target, triggers in DRAWN.findall(text)
            for trigger in triggers.split(", ")
        }
        assert drawn == table
