"""The running programs, killed in flight and away until the vehicle has landed without them."""

from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.database import read_rows
from tests.support.system import FINISHED, FarmSystem, running, short_plan, wait_for
from tests.support.truth import read_track

pytestmark = pytest.mark.scenario

RUNNING = 2
FLEW_ABOVE_M = 3.0
STANDS_BELOW_M = 0.3


def has_landed(system: FarmSystem) -> bool:
    """Whether the vehicle was up and is down again, by the simulator's truth."""
    track = read_track(system.state_dir / "vehicle-1" / "truth.csv")
    heights = [point.height_above_home_m for point in track]
    return max(heights) > FLEW_ABOVE_M and heights[-1] < STANDS_BELOW_M


@pytest.mark.parametrize("victims", [("edge",), ("broker", "edge")], ids="+".join)
def test_everything_is_known_once_they_are_back(victims: tuple[str, ...], tmp_path: Path) -> None:
    with running(tmp_path / "var", speed=10.0) as system:
        plan = short_plan() | {"geofence": {"max_altitude": 60.0}}
        identifier = system.post("/plans/", plan).json()["id"]

        def records() -> list[tuple[Any, ...]]:
            return read_rows(system.state_dir / "broker", "SELECT * FROM records")

        def flies() -> bool:
            mission = system.get(f"/plans/{identifier}")["missions"][0]
            return bool(mission["mission_status_id"] >= RUNNING)

        wait_for(flies, "the flight")
        assert records(), "what the vehicle's own height limit was is on the disk"
        for name in victims:
            system.kill(name)
        wait_for(lambda: has_landed(system), "the landing")
        for name in victims:
            system.start(name)
        system.wait_until_edge_answers()
        (mission,) = system.wait_until_ended(identifier)["missions"]
        statuses = [c["command_status_id"] for c in mission["command_array"]]
        assert [mission["mission_status_id"], *statuses] == [FINISHED] * 4
        system.wait_until_delivered()
        assert len(system.cloud("/pose")) == len(system.cloud("/battery")) == 3
        started = system.log_of("broker").count("ARMING, ARMED")
        assert started == 1, "the vehicle was ordered to start once"
        wait_for(lambda: not records(), "the vehicle's own height limit")
