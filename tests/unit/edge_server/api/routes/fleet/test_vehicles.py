"""The registry of vehicles over HTTP."""

import sqlite3
from contextlib import closing

import pytest

from edge_server.live.reading import reader
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission_report, plan

STATE = {
    "link_state": "connected",
    "autopilot": "px4",
    "armed": True,
    "mode": "AUTO.MISSION",
    "latitude": 40.4434,
    "longitude": -3.7382,
    "altitude": 4.8,
    "battery_percentage": 0.8,
    "mission_id": 1201,
    "recorded_at": "2026-11-21T12:00:00Z",
}


def test_a_vehicle_is_registered_by_its_first_put(edge: Edge) -> None:
    first = edge.ask("PUT", "/vehicles/3", "broker", json=STATE)
    assert (first.status_code, first.headers["Location"]) == (201, "/vehicles/3/")
    assert edge.ask("PUT", "/vehicles/3/", "broker", json=STATE).status_code == 200
    assert STATE.items() <= edge.get("/vehicles/3").items()
    assert [item["vehicle_id"] for item in edge.get("/vehicles")] == [1, 2, 3]


def test_an_absent_member_stays_and_a_null_replaces_it(edge: Edge) -> None:
    edge.ask("PUT", "/vehicles/1", "broker", json=STATE)
    edge.clock.pass_s(5)
    edge.ask("PUT", "/vehicles/1", "broker", json={"link_state": "stale", "mission_id": None})
    shown = edge.get("/vehicles/1")
    assert (shown["link_state"], shown["mission_id"], shown["mode"]) == (
        "stale",
        None,
        "AUTO.MISSION",
    )
    assert shown["updated_at"] > shown["registered_at"]


def test_the_newest_state_is_shown_while_the_database_refuses_it(edge: Edge) -> None:
    """In the list, alone and in the live stream; the broker learns that it is not stored."""
    edge.ask("PUT", "/vehicles/1", "broker", json=STATE)
    edge.clock.pass_s(60.0)
    read = reader(edge.context)
    with closing(sqlite3.connect(edge.config.database_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        moved = {"link_state": "connected", "altitude": 33.0, "mode": None}
        assert edge.ask("PUT", "/vehicles/1", "broker", json=moved).status_code == 503
        shown = edge.get("/vehicles/1")
        assert (shown["altitude"], shown["mode"], shown["battery_percentage"]) == (33.0, None, 0.8)
        assert shown["updated_at"] == "2026-11-21T12:01:00Z"
        assert edge.get("/vehicles/")[0] == shown
        assert read().vehicles[1] == shown
    landed = {"link_state": "connected", "armed": False}
    assert edge.ask("PUT", "/vehicles/1", "broker", json=landed).status_code == 200
    later = STATE | {"altitude": 33.0, "mode": None, "armed": False}
    assert later.items() <= edge.get("/vehicles/1").items()


def test_what_a_person_sets_is_not_shown_if_it_is_refused(edge: Edge) -> None:
    edge.ask("PUT", "/vehicles/1", "broker", json=STATE)
    with closing(sqlite3.connect(edge.config.database_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        answer = edge.ask("PUT", "/vehicles/1", "operator", json={"link_state": "lost"})
    assert answer.status_code == 503
    assert edge.get("/vehicles/1")["link_state"] == "connected"


def test_without_a_watcher_updates_come_at_the_usual_interval(edge: Edge) -> None:
    assert "Update-Interval" not in edge.ask("PUT", "/vehicles/1", "broker", json=STATE).headers


def test_a_vehicle_shows_the_age_of_its_position(edge: Edge) -> None:
    known = {
        "family": "ardupilot",
        "version": "4.6.2",
        "position_age": 12.5,
        "stale": ["position", "battery"],
        "warning": "a second vehicle has this system id",
        "speed": 4.5,
        "heading": 271.5,
        "activity": "paused",
        "gps_fix": "3d",
        "satellites": 14,
        "battery_time_remaining": 720.0,
    }
    edge.ask("PUT", "/vehicles/1", "broker", json=STATE | known)
    assert known.items() <= edge.get("/vehicles/1").items()


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"position_age": -1}, "position_age"),
        ({"stale": "position"}, "stale"),
        ({"speed": -1}, "speed"),
        ({"heading": 360}, "heading"),
        ({"satellites": 256}, "satellites"),
        ({"activity": "dancing"}, "activity"),
        ({"battery_time_remaining": -1}, "battery_time_remaining"),
        ({"version": 4}, "version"),
        ({"link_state": "fine"}, "link_state"),
        ({"latitude": 91}, "latitude"),
        ({"armed": 1}, "armed"),
        ({"battery_percentage": 80}, "battery_percentage"),
        ({"surprise": 1}, "surprise"),
    ],
)
def test_a_bad_state_is_refused_by_field(edge: Edge, change: dict[str, object], field: str) -> None:
    answer = edge.ask("PUT", "/vehicles/9", "broker", json=STATE | change)
    assert answer.status_code == 422
    assert field in (answer.json or {})["detail"]["json"]
    assert edge.ask("GET", "/vehicles/9", "operator").status_code == 404


@pytest.mark.first_case
@pytest.mark.parametrize("identifier", [0, 2**31])
def test_a_vehicle_id_out_of_range_is_refused(edge: Edge, identifier: int) -> None:
    answer = edge.ask("PUT", f"/vehicles/{identifier}", "broker", json=STATE)
    assert answer.status_code == 422


def test_a_vehicle_with_work_stays(edge: Edge) -> None:
    edge.post_plan(plan())
    assert edge.ask("DELETE", "/vehicles/1", "admin").status_code == 409
    edge.accept()
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    assert edge.ask("DELETE", "/vehicles/1", "admin").status_code == 204
    assert edge.ask("DELETE", "/vehicles/1", "admin").status_code == 404
    assert edge.post_plan(plan()).status_code == 422
