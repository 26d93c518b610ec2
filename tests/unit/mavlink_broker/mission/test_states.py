"""The table of states, and the README that draws it."""

from pathlib import Path

import pytest

import mavlink_broker
from mavlink_broker.mission.states import (
    TRANSITIONS,
    Event,
    IllegalTransitionError,
    State,
    follow,
)

README = Path(str(mavlink_broker.__file__)).parent / "README.md"
ILLEGAL = [(s, e) for s in State for e in Event if (s, e) not in TRANSITIONS]


@pytest.mark.parametrize(("state", "event"), ILLEGAL)
def test_a_step_that_is_not_in_the_table_is_refused(state: State, event: Event) -> None:
    with pytest.raises(IllegalTransitionError, match=f"{event.name} in {state.name}"):
        follow(state, event)


@pytest.mark.parametrize(("step", "target"), TRANSITIONS.items())
def test_a_step_leads_where_the_table_says(step: tuple[State, Event], target: State) -> None:
    assert follow(*step) is target


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


def test_the_readme_draws_exactly_this_table() -> None:
    drawn = {
        tuple(part.strip() for part in line.replace(":", "-->").split("-->"))
        for line in README.read_text(encoding="utf-8").splitlines()
        if "-->" in line
    }
    table = {(s.name, t.name, e.name) for (s, e), t in TRANSITIONS.items()}
    assert drawn == table
