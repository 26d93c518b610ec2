"""Missions over two bad links, on this project's own vehicle; `make soak` flies 100 over each."""

from pathlib import Path

import pytest

from tests.soak.broker_links import fly

pytestmark = pytest.mark.scenario


@pytest.mark.parametrize(("loss", "round_trip_s"), [(0.2, 0.0), (0.2, 1.5)])
def test_a_mission_is_flown_and_reported_correctly(
    loss: float, round_trip_s: float, tmp_path: Path
) -> None:
    fly(loss, round_trip_s, seed=7, folder=tmp_path)
