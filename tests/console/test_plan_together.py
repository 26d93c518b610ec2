"""People at the console who plan, each in a browser, against an edge server without vehicles."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import requests

from edge_server.api.routes.planning.fields import EXAMPLE
from tests.support.browser import TEST_TIMEOUT_S, console_journey
from tests.support.system import short_plan
from tests.unit.edge_server.geodata import shapefiles
from tests.unit.edge_server.program import Program, program_in


def headers(server: Program) -> dict[str, str]:
    return {"Authorization": f"Bearer {server.key('admin')}"}


def post(server: Program, path: str, body: dict[str, Any]) -> Any:
    """Post as an administrator; returns the answer's body."""
    answer = requests.post(f"{server.url}{path}", json=body, headers=headers(server), timeout=10)
    assert answer.ok, answer.text
    return answer.json()


def link(server: Program, name: str) -> str:
    """The address that signs a person in once."""
    return f"{server.url}{post(server, f'/users/{name}/link', {})['path']}"


def report(server: Program, vehicle_id: int, **state: float) -> None:
    """Report that a vehicle is connected, and where it stands."""
    path = f"{server.url}/vehicles/{vehicle_id}"
    vehicle = {"link_state": "connected", **state}
    requests.put(path, json=vehicle, headers=headers(server), timeout=10).raise_for_status()


@contextmanager
def edge_server(folder: Path) -> Iterator[tuple[Program, dict[str, str]]]:
    """Run an edge server with two vehicles, two operators and a draft; gives what journeys need."""
    with program_in(folder / "edge") as server:
        server.start()
        for vehicle_id in (1, 2):
            report(server, vehicle_id)
        for name in ("ana", "juan"):
            post(server, "/users/", {"name": name, "role": "operator"})
        draft = post(server, "/plans/", short_plan() | {"dispatch": False, "name": "Draft"})
        yield server, {"ANA_LINK": link(server, "ana"), "DRAFT": str(draft["id"])}


def plans_of(server: Program) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = requests.get(
        f"{server.url}/plans/", headers=headers(server), timeout=10
    ).json()
    return found


def meadows(folder: Path) -> Path:
    """A zipped Shapefile with two fields beside each other."""
    rings = [
        [(west, 40.4430), (west, 40.4436), (west + 6e-4, 40.4436), (west + 6e-4, 40.4430)]
        for west in (-3.7380, -3.7390)
    ]
    table = shapefiles.dbf([b"East meadow", b"West meadow"])
    path = folder / "meadows.zip"
    path.write_bytes(
        shapefiles.archive(shapefiles.shp(*map(shapefiles.record, rings)), table=table)
    )
    return path


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_two_editors_overwrite_nothing_and_lose_nothing(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        field = post(server, "/fields/", EXAMPLE)
        take(
            "edit_together",
            **needs,
            JUAN_LINK=link(server, "juan"),
            ANA_LINK_AGAIN=link(server, "ana"),
            JUAN_LINK_AGAIN=link(server, "juan"),
            FIELD=str(field["id"]),
        )
        plans = plans_of(server)
    seen = [(plan["name"], plan["missions"][0]["maximum_speed"]) for plan in plans]
    assert seen == [("Draft", 10.0), ("Juan's plan (copy)", 5.0)]
    assert [plan["missions"][0]["dispatch_state"] for plan in plans] == ["held", "held"]


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_plan_is_copied_and_kept_as_files_that_come_back(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        take("keep_plans", **needs)
        plans = plans_of(server)
    assert [plan["name"] for plan in plans[:3]] == ["Draft", "Draft (copy)", "Draft"]
    kept = [
        [command["parameters"] for command in plan["missions"][0]["command_array"]]
        for plan in plans
    ]
    assert len(kept) == 5
    assert all(commands == kept[0] for commands in kept)


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_field_has_an_entry_and_a_survey_begins_there(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        field = post(server, "/fields/", EXAMPLE)
        take("enter_a_field", **needs, FIELD=str(field["id"]), SHAPEFILE=str(meadows(tmp_path)))
        path = f"{server.url}/fields/{field['id']}"
        stored = requests.get(path, headers=headers(server), timeout=10).json()
        names = [
            one["name"]
            for one in requests.get(
                f"{server.url}/fields/", headers=headers(server), timeout=10
            ).json()
        ]
    assert names[1:] == ["East meadow", "West meadow", "South meadow"]
    assert stored["entry"] == pytest.approx([40.4435, -3.7392], abs=2e-4)


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_part_of_a_field_is_surveyed_and_the_field_stays(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        field = post(server, "/fields/", EXAMPLE)
        take("survey_a_part", **needs, FIELD=str(field["id"]))
        path = f"{server.url}/fields/{field['id']}"
        assert requests.get(path, headers=headers(server), timeout=10).json() == field
        plan = plans_of(server)[1]
    assert plan["field_id"] == field["id"]
    (mission,) = plan["missions"]
    places = [one["parameters"] for one in mission["command_array"][:-1]]
    longitudes = [place["longitude"] for place in places if "longitude" in place]
    west = min(longitude for _, longitude in field["boundary"])
    assert min(longitudes) > west + 1e-5


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_one_vehicle_of_a_survey_flies_and_the_other_waits(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        field = post(server, "/fields/", EXAMPLE)
        places = {1: (40.4429, -3.7393), 2: (40.4429, -3.7379)}
        for vehicle_id, (latitude, longitude) in places.items():
            report(server, vehicle_id, latitude=latitude, longitude=longitude)
        take("fly_a_survey", **needs, FIELD=str(field["id"]))
        plans = plans_of(server)[1:]
    states = {
        mission["vehicle_id"]: mission["dispatch_state"]
        for plan in plans
        for mission in plan["missions"]
    }
    assert states == {1: "queued", 2: "held"}
    for mission in (mission for plan in plans for mission in plan["missions"]):
        takeoff = mission["command_array"][0]["parameters"]
        at = takeoff["latitude"], takeoff["longitude"]
        assert at == pytest.approx(places[mission["vehicle_id"]])


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_plan_of_two_drones_is_edited(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        take("edit_two_drones", **needs)
        (plan,) = plans_of(server)
    assert plan["name"] == "Kept (copy)"
    missions = plan["missions"]
    assert [one["vehicle_id"] for one in missions] == [1, 2]
    assert [one["maximum_speed"] for one in missions] == pytest.approx([3.0, 2.0])
    assert [[step["command_type_id"] for step in one["command_array"]] for one in missions] == [
        [1, 3, 11],
        [1, 11],
    ]
