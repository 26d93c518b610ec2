import json
from pathlib import Path
from typing import Any

import pytest

from sim.launch.fleet_plan import for_vehicles

EXAMPLE: dict[str, Any] = json.loads(Path("examples/plans/first_flight.json").read_text())


def test_one_vehicle_flies_the_plan_as_it_is() -> None:
    assert for_vehicles(EXAMPLE, 1) == EXAMPLE


@pytest.mark.parametrize("vehicles", [2, 3, 16])
def test_each_vehicle_gets_a_mission_of_its_own(vehicles: int) -> None:
    missions = for_vehicles(EXAMPLE, vehicles)["missions"]
    assert [m["vehicle_id"] for m in missions] == list(range(1, vehicles + 1))
    assert len({m["mission_id"] for m in missions}) == vehicles


def test_the_missions_fly_east_of_and_above_each_other() -> None:
    first, second = for_vehicles(EXAMPLE, 2)["missions"]
    for one, other in zip(first["command_array"], second["command_array"], strict=True):
        if "longitude" in one["parameters"]:
            east_deg = other["parameters"]["longitude"] - one["parameters"]["longitude"]
            assert east_deg * 84_700 == pytest.approx(3.0, rel=0.01)
            assert other["parameters"]["altitude"] == one["parameters"]["altitude"] + 2.0


def test_the_document_given_is_left_alone() -> None:
    before = json.dumps(EXAMPLE)
    for_vehicles(EXAMPLE, 3)
    assert json.dumps(EXAMPLE) == before


def test_a_plan_for_several_vehicles_is_flown_as_written() -> None:
    plan = for_vehicles(EXAMPLE, 2)
    assert for_vehicles(plan, 5) == plan
