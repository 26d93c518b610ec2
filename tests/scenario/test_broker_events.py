"""Events in flight on this project's own vehicle; `make soak` has the whole table."""

from pathlib import Path

import pytest

from tests.soak.broker_events import interrupt
from tests.soak.broker_links import conditions

pytestmark = pytest.mark.scenario


@pytest.mark.parametrize(
    ("event", "moment"),
    [
        ("abort", "idle"),
        ("abort", "taking off"),
        ("soft abort with a point", "waypoint"),
        ("abort with a point", "hotpoint"),
        ("abort", "follow"),
    ],
)
def test_an_event_moves_the_vehicle_to_its_position(
    event: str, moment: str, tmp_path: Path
) -> None:
    interrupt(event, moment, tmp_path)


@pytest.mark.promise
def test_an_abort_comes_through_a_link_that_loses_a_fifth(tmp_path: Path) -> None:
    interrupt("abort with a point", "waypoint", tmp_path, conditions=conditions(0.2, 0.3), seed=3)
