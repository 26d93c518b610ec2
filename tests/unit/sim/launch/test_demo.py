import json
from pathlib import Path
from typing import Any

import pytest

from sim.camera.film.picture_file import write_picture
from sim.launch.demo import (
    DemoError,
    for_vehicles,
    read_plan,
    require_free,
    show_pictures,
    undelivered,
)
from sim.launch.settings import from_environment
from tests.unit.sim.camera.shots import order, pose


def test_the_demo_flies_as_many_vehicles_as_a_plan_may_have() -> None:
    assert len(read_plan(from_environment({"VEHICLES": "16"}))["missions"]) == 16
    with pytest.raises(DemoError, match="VEHICLES: a plan holds 1 to 16 missions, not 17"):
        read_plan(from_environment({"VEHICLES": "17"}))


@pytest.mark.parametrize("text", ["", "[]", "{}", '"plan"', '{"missions": 3}', "\x00"])
def test_a_file_that_holds_no_plan_is_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.json"
    path.write_text(text)
    with pytest.raises(DemoError, match=r"broken\.json holds no plan"):
        read_plan(from_environment({"VEHICLES": "2", "PLAN": str(path)}))


def test_the_pictures_of_this_flight_are_laid_on_sheets(tmp_path: Path) -> None:
    settings = from_environment({"STATE_DIR": str(tmp_path)})
    folder = tmp_path / "vehicle-1" / "image"
    for number in range(2):
        write_picture(order(folder, number, pose(20.0, 60.0, 30.0, -90.0, 0.0), width_px=64))
    said: list[str] = []
    show_pictures(settings, {1: frozenset({"0.jpg"})}, said.append)
    (line,) = said
    assert "vehicle 1: 1 picture, " in line
    assert (tmp_path / "album" / "vehicle-1" / "mosaic.jpg").stat().st_size > 500


def test_a_mission_that_waits_for_a_held_vehicle_ends_the_demo() -> None:
    require_free([{"mission_id": 1}])
    held = "vehicle 2 is held since noon: the vehicle was restarted; release it"
    with pytest.raises(DemoError, match=f"^{held}, or use another STATE_DIR$"):
        require_free([{"mission_id": 1}, {"mission_id": 2, "waiting": held}])


class Cloud:
    """An edge server that keeps nothing, and a cloud that holds these records."""

    def __init__(self, records: list[dict[str, Any]]) -> None:
        self._records = records

    def edge(self, _path: str) -> list[Any]:
        return []

    def cloud(self, _path: str) -> list[dict[str, Any]]:
        return self._records


def test_a_flight_is_delivered_with_its_last_picture_and_not_before() -> None:
    commands = [
        {"command_type_id": 1, "parameters": {}},
        {"command_type_id": 4, "parameters": {"photo_count": 3}},
        {"command_type_id": 10, "parameters": {"panorama_mode": 1}},
    ]
    mission = {"mission_id": 7, "vehicle_id": 1, "command_array": commands}
    report = {"vehicle_id": 1, "mission_id": 7, "mission_status_id": 3}
    records: list[dict[str, Any]] = [
        {"kind": "mission_report", "body": report},
        *({"kind": kind, "body": {"vehicle_id": 1}} for kind in ("pose", "battery") * 3),
        *({"kind": "image", "body": {"vehicle_id": 1}} for _ in range(7)),
    ]
    lacks = "the cloud holds 7 image records of vehicle 1, not 8"
    assert undelivered(Cloud(records), [mission], 0) == lacks
    records.append({"kind": "image", "body": {"vehicle_id": 1}})
    assert undelivered(Cloud(records), [mission], 0) is None


def test_without_pictures_nothing_is_said(tmp_path: Path) -> None:
    said: list[str] = []
    show_pictures(from_environment({"STATE_DIR": str(tmp_path)}), {1: frozenset()}, said.append)
    assert said == []


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
