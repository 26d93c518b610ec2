"""The table of an outbox row's life."""

import itertools
import re
from pathlib import Path

import pytest

from edge_server.outbox.states import (
    TRANSITIONS,
    Happening,
    IllegalTransitionError,
    State,
    follow,
)

README = Path(__file__).parents[4] / "edge_server" / "README.md"


@pytest.mark.parametrize(("state", "happening"), list(itertools.product(State, Happening)))
def test_every_pair_is_in_the_table_or_illegal(state: State, happening: Happening) -> None:
    if (state, happening) in TRANSITIONS:
        assert follow(state, happening) is TRANSITIONS[state, happening]
    else:
        with pytest.raises(IllegalTransitionError):
            follow(state, happening)


def test_nothing_leaves_the_end_and_only_a_confirmation_deletes() -> None:
    assert all(state not in {State.GONE, State.DEAD} for state, _ in TRANSITIONS)
    ways = [happening for (_, happening), target in TRANSITIONS.items() if target is State.GONE]
    assert ways == [Happening.CONFIRMED]


def test_every_state_is_reached_from_the_first() -> None:
    reached = {State.QUEUED}
    for _ in State:
        reached |= {target for (state, _), target in TRANSITIONS.items() if state in reached}
    assert reached == set(State)


def test_the_readmes_diagram_is_the_table() -> None:
    drawn = re.findall(
        r"^ +(\w+) --> (\w+): (.+)$", README.read_text(encoding="utf-8"), re.MULTILINE
    )
    table = {
        (state.name, target.name, happening.value)
        for (state, happening), target in TRANSITIONS.items()
    }
    assert set(drawn) == table
