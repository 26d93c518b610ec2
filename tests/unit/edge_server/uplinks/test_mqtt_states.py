"""The table of the connection's life, and its picture."""

import itertools
import re
from pathlib import Path

import pytest

from edge_server.uplinks.mqtt_states import (
    LINK_TRANSITIONS,
    LinkHappening,
    LinkState,
    follow_link,
)

README = Path(__file__).parents[4] / "edge_server" / "uplinks" / "README.md"


@pytest.mark.parametrize(("state", "happening"), list(itertools.product(LinkState, LinkHappening)))
def test_what_is_not_in_the_table_changes_nothing(
    state: LinkState, happening: LinkHappening
) -> None:
    assert follow_link(state, happening) is LINK_TRANSITIONS.get((state, happening))


def test_whatever_happens_the_way_down_is_open() -> None:
    for state in set(LinkState) - {LinkState.DOWN}:
        assert follow_link(state, LinkHappening.LOST) is LinkState.DOWN


def test_the_readmes_diagram_is_the_table() -> None:
    drawn = re.findall(
        r"^ +(\w+) --> (\w+): (.+)$", README.read_text(encoding="utf-8"), re.MULTILINE
    )
    assert set(drawn) == {
        (state.name, target.name, happening.value)
        for (state, happening), target in LINK_TRANSITIONS.items()
    }
