"""The table of states, and the page that draws it."""

import re

import pytest

from mavlink_broker.mission import states
from mavlink_broker.mission.states import TRANSITIONS, Event, IllegalTransitionError, State, follow
from tests.support import pages
from tests.support.cases import failures

ILLEGAL = [(s, e) for s in State for e in Event if (s, e) not in TRANSITIONS]


def check_illegal(state: State, event: Event) -> None:
    with pytest.raises(IllegalTransitionError, match=f"{event.name} in {state.name}"):
        follow(state, event)


def test_a_transition_that_is_not_in_the_table_is_refused() -> None:
    assert failures(check_illegal, ILLEGAL) == []


def check_transition(step: tuple[State, Event], target: State) -> None:
    assert follow(*step) is target


def test_a_transition_enters_the_state_of_the_table() -> None:
    assert failures(check_transition, TRANSITIONS.items()) == []


def test_every_state_can_be_reached_and_left_for_idle() -> None:
    def reachable(start: State) -> set[State]:
        found, waiting = {start}, [start]
        while waiting:
            state = waiting.pop()
            new = {t for (s, _), t in TRANSITIONS.items() if s is state} - found
            found |= new
            waiting += new
        return found

    assert reachable(State.IDLE) == set(State)
    assert all(State.IDLE in reachable(state) for state in State)


def test_nothing_flies_that_was_not_verified() -> None:
    assert {s for (s, _), t in TRANSITIONS.items() if t is State.ARMING} == {State.SELECTING}
    assert {s for (s, _), t in TRANSITIONS.items() if t is State.SELECTING} == {State.VERIFYING}


def test_the_documentation_draws_exactly_this_table() -> None:
    drawn = {
        tuple(part.strip() for part in line.replace(":", "-->").split("-->"))
        for line in pages.text("explanation/mission-states.md").splitlines()
        if "-->" in line
    }
    table = {(s.name, t.name, e.name) for (s, e), t in TRANSITIONS.items()}
    assert drawn == table


def test_every_transition_that_the_module_draws_is_in_the_table() -> None:
    drawn = 0
    for line in str(states.__doc__).splitlines():
        parts = re.split(r" --|--> ", line.strip())
        for source, event, target in zip(parts[::2], parts[1::2], parts[2::2], strict=False):
            assert TRANSITIONS[State[source], Event[event]] is State[target]
            drawn += 1
    assert drawn == 16
