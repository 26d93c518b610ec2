"""Plans over HTTP: posted, shown live, replaced, cancelled, refused."""

import json
from typing import Any

import pytest

from edge_server.api.routes.planning.fields import EXAMPLE as FIELD
from edge_server.api.routes.planning.surveys import EXAMPLE as SURVEY
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import (
    event,
    home,
    mission,
    mission_report,
    plan,
    takeoff,
    waypoint,
)

ULID = "01K9Z4T1W8F6Q2M3N5P7R9S0VX"


@pytest.mark.thorough
def test_a_plan_is_kept_and_its_missions_wait_for_the_broker(edge: Edge) -> None:
    answer = edge.post_plan(plan(mission(1201, 1), mission(1202, 2)))
    assert answer.status_code == 201
    stored = answer.json
    assert stored is not None
    assert answer.headers["Location"] == f"/plans/{stored['id']}/"
    assert edge.get(answer.headers["Location"]) == stored
    assert edge.get(f"/plans/{stored['plan_id']}") == stored
    assert edge.get("/plans") == [stored]
    assert stored["plan_status_name"] == "NOT_STARTED"
    assert [item["vehicle_id"] for item in edge.work()] == [1, 2]
    assert [item["state"] for item in edge.work()] == ["queued", "queued"]


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/plans/", "/plans", "/plan/", "/plan"])
def test_every_spelling_of_the_address_takes_a_plan_without_a_redirect(
    edge: Edge, path: str
) -> None:
    assert edge.post(path, plan(), "operator").status_code == 201


def test_a_bare_mission_is_a_plan_of_one_mission(edge: Edge) -> None:
    answer = edge.post_plan(mission())
    assert answer.status_code == 201
    assert answer.json is not None
    assert answer.json["missions"][0]["mission_id"] == 1201


@pytest.mark.first_case
@BOTH_ENGINES
def test_reports_move_the_plan_live(edge: Edge) -> None:
    identifier = (edge.post_plan(plan()).json or {})["id"]
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    edge.report("mission_report", mission_report(2, 3, 2, 1))
    shown = edge.get(f"/plans/{identifier}")
    assert shown["plan_status_name"] == "RUNNING"
    (flown,) = shown["missions"]
    assert flown["mission_status_id"] == 2
    assert [c["command_status_name"] for c in flown["command_array"]] == [
        "FINISHED",
        "RUNNING",
        "NOT_STARTED",
    ]
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    shown = edge.get(f"/plans/{identifier}")
    assert shown["plan_status_name"] == "FINISHED"
    assert edge.work() == []


def test_a_failed_command_says_why(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.accept()
    report = mission_report(4, 3, 4, 5, message="GPS fix lost")
    report["command_report_array"][1]["message"] = "no position"
    edge.report("mission_report", report)
    (shown,) = edge.get("/plans/")
    assert shown["plan_status_name"] == "FAILED"
    assert shown["missions"][0]["message"] == "GPS fix lost"
    assert shown["missions"][0]["command_array"][1]["message"] == "no position"


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_late_report_does_not_bring_a_mission_back(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.accept()
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    late = edge.report("mission_report", mission_report(2, 3, 2, 1))
    assert late.status_code == 409
    (shown,) = edge.get("/plans/")
    assert shown["plan_status_name"] == "FINISHED"


@pytest.mark.first_case
@BOTH_ENGINES
def test_the_same_plan_twice_waits_for_the_first_to_end(edge: Edge) -> None:
    assert edge.post_plan(plan()).status_code == 201
    second = edge.post_plan(plan())
    assert second.status_code == 409
    assert "missions.0.mission_id" in (second.json or {})["detail"]["json"]
    edge.accept()
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    assert edge.post_plan(plan()).status_code == 201


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_repeated_post_under_its_key_has_one_effect(edge: Edge) -> None:
    first = edge.post_plan(plan(), key="first")
    again = edge.post_plan(plan(), key="first")
    assert (again.status_code, again.json) == (201, first.json)
    assert edge.count("plan") == 1
    other = edge.post_plan(plan(mission(7)), key="first")
    assert other.status_code == 422


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_plan_id_is_taken_once(edge: Edge) -> None:
    assert edge.post_plan(plan(plan_id=ULID)).status_code == 201
    edge.accept()
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    assert edge.post_plan(plan(plan_id=ULID)).status_code == 409


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_vehicles_queue_is_bounded_and_all_or_nothing(edge: Edge) -> None:
    for number in range(8):
        assert edge.post_plan(plan(mission(number, 1))).status_code == 201
    refused = edge.post_plan(plan(mission(100, 2), mission(101, 1)))
    assert refused.status_code == 409
    assert "missions.1.vehicle_id" in (refused.json or {})["detail"]["json"]
    assert edge.count("plan") == 8
    assert {item["vehicle_id"] for item in edge.work()} == {1}


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_waiting_plan_can_be_replaced(edge: Edge) -> None:
    stored = edge.post_plan(plan()).json or {}
    (old,) = edge.work()
    answer = edge.ask("PUT", f"/plans/{stored['id']}", "admin", json=plan(mission(5, 2)))
    assert answer.status_code == 200
    assert (answer.json or {})["plan_id"] == stored["plan_id"]
    (new,) = edge.work()
    assert (new["mission"]["mission_id"], new["vehicle_id"]) == (5, 2)
    assert edge.acknowledge(old["id"], "accepted").status_code == 404


def test_an_accepted_plan_can_be_neither_replaced_nor_deleted(edge: Edge) -> None:
    path = f"/plans/{(edge.post_plan(plan()).json or {})['id']}"
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    before = edge.get(path)
    assert edge.ask("PUT", path, "operator", json=plan()).status_code == 409
    assert edge.ask("DELETE", path, "operator").status_code == 409
    assert edge.get(path) == before


@pytest.mark.first_case
@BOTH_ENGINES
def test_deleting_a_waiting_plan_cancels_it(edge: Edge) -> None:
    path = f"/plans/{(edge.post_plan(plan()).json or {})['id']}"
    (item,) = edge.work()
    assert edge.ask("DELETE", path, "operator").status_code == 204
    assert edge.ask("GET", path, "operator").status_code == 404
    assert edge.work() == []
    assert edge.acknowledge(item["id"], "accepted").status_code == 404


def test_a_finished_plan_can_be_deleted(edge: Edge) -> None:
    path = f"/plans/{(edge.post_plan(plan()).json or {})['id']}"
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    assert edge.ask("DELETE", path, "admin").status_code == 204


@pytest.mark.first_case
@BOTH_ENGINES
def test_an_expired_mission_is_aborted_and_reported_to_the_cloud(edge: Edge) -> None:
    plan_id = (edge.post_plan(plan()).json or {})["plan_id"]
    (item,) = edge.work()
    edge.clock.pass_s(edge.config.plan_lifetime_s + 1)
    assert edge.work() == []
    (shown,) = edge.get("/plans/")
    assert shown["plan_status_name"] == "ABORTED"
    assert shown["missions"][0]["message"] == "expired before dispatch"
    assert {c["command_status_name"] for c in shown["missions"][0]["command_array"]} == {"ABORTED"}
    assert edge.acknowledge(item["id"], "accepted").status_code == 409
    (report,) = edge.get("/mission_report/")
    assert (report["mission_id"], report["mission_status_id"]) == (1201, 5)
    assert (report["plan_id"], report["work_id"]) == (plan_id, item["id"])


def test_expires_at_is_stored_and_applied(edge: Edge) -> None:
    answer = edge.post_plan(plan(expires_at="2026-11-21T12:01:00Z"))
    assert (answer.json or {})["expires_at"] == "2026-11-21T12:01:00Z"
    edge.clock.pass_s(59)
    assert len(edge.work()) == 1
    edge.clock.pass_s(2)
    assert edge.work() == []


def test_an_accepted_mission_does_not_expire(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    edge.clock.pass_s(edge.config.plan_lifetime_s + 1)
    assert edge.work()[0]["state"] == "accepted"


def test_warnings_are_answered_and_the_plan_is_stored(edge: Edge) -> None:
    answer = edge.post_plan(plan(mission(command_array=[takeoff(), waypoint()])))
    assert answer.status_code == 201
    (warning,) = (answer.json or {})["warnings"]
    assert warning["path"] == "missions.0.command_array"


@pytest.mark.thorough
def test_annex_hold_times_reach_the_broker_in_seconds_and_the_reader_as_posted(edge: Edge) -> None:
    flight = mission(command_array=[takeoff(), waypoint(hold_time=2), home()])
    stored = edge.post_plan(plan(flight, profile="annex")).json or {}
    shown = stored["missions"][0]["command_array"][1]["parameters"]["hold_time"]
    (item,) = edge.work()
    handed_out = item["mission"]["command_array"][1]["parameters"]["hold_time"]
    assert (shown, handed_out) == (2.0, 20.0)


LATITUDE_91 = plan(mission(command_array=[takeoff(latitude=91), home()]))
NAN = plan(mission(command_array=[takeoff(altitude=float("nan")), home()]))
UNKNOWN_COMMAND = plan(mission(command_array=[takeoff(), home() | {"command_type_id": 12}]))
LONG = [takeoff(1), *(waypoint(number) for number in range(2, 102))]

BAD_PLANS: dict[str, tuple[Any, int, str]] = {
    "latitude 91": (LATITUDE_91, 422, "missions.0.command_array.0.parameters.latitude"),
    "NaN": (NAN, 422, "missions.0.command_array.0.parameters.altitude"),
    "unknown command": (UNKNOWN_COMMAND, 422, "missions.0.command_array.1.command_type_id"),
    "unknown vehicle": (plan(mission(vehicle_id=77)), 422, "missions.0.vehicle_id"),
    "empty mission": (plan(mission(command_array=[])), 422, "missions.0.command_array"),
    "101 commands": (
        plan(mission(command_array=LONG), profile="annex"),
        422,
        "missions.0.command_array",
    ),
    "no missions": ({"plan": {"missions": []}}, 422, "missions"),
    "read-only field": (plan(plan_status_id=3), 422, "plan_status_id"),
    "expired": (plan(expires_at="2026-11-21T11:59:59Z"), 422, "expires_at"),
    "bool for a number": (plan(mission(mission_id=True)), 422, "missions.0.mission_id"),
    "a list": ([], 422, ""),
    "good mission beside a bad one": (
        plan(mission(1, 1), mission(2, 2, maximum_speed=1000)),
        422,
        "missions.1.maximum_speed",
    ),
}


@pytest.mark.first_case
@pytest.mark.parametrize("name", BAD_PLANS)
def test_a_bad_plan_is_refused_with_its_path_and_nothing_is_stored(edge: Edge, name: str) -> None:
    body, status, path = BAD_PLANS[name]
    answer = edge.ask(
        "POST",
        "/plans/",
        "operator",
        data=json.dumps(body),
        headers={"Content-Type": "application/json"},
    )
    assert answer.status_code == status
    assert path in (answer.json or {})["detail"]["json"]
    assert (edge.count("plan"), edge.count("work"), edge.count("command")) == (0, 0, 0)


def test_an_empty_mission_has_afarclouds_code(edge: Edge) -> None:
    answer = edge.post_plan(plan(mission(command_array=[])))
    assert (answer.json or {})["errors"] == [
        {"code": 404, "name": "NO_COMMANDS", "path": "missions.0.command_array"}
    ]


@pytest.mark.first_case
@pytest.mark.parametrize("raw", [b"{", b"", b"\xff\xfe", b"[" * 100_000, b'{"a": 1} x'])
def test_broken_json_is_a_400(edge: Edge, raw: bytes) -> None:
    headers = {"Content-Type": "application/json"}
    answer = edge.ask("POST", "/plans/", "operator", data=raw, headers=headers)
    assert answer.status_code == 400
    assert (answer.json or {})["message"] == "the body is not JSON"
    assert edge.count("plan") == 0


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_repeated_post_gets_its_first_answer_after_a_delete(edge: Edge) -> None:
    first = edge.post_plan(plan(), key="first")
    assert edge.ask("DELETE", f"/plans/{(first.json or {})['id']}", "operator").status_code == 204
    again = edge.post_plan(plan(), key="first")
    assert (again.status_code, again.json) == (201, first.json)
    assert edge.count("plan") == 0


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("path", "body"), [("/surveys/", SURVEY), ("/fields/", FIELD), ("/events/", event(2))]
)
def test_a_repeated_post_of_others_gets_its_first_answer_after_a_delete(
    edge: Edge, path: str, body: dict[str, Any]
) -> None:
    edge.post_plan(plan())
    edge.accept()
    first = edge.post(path, body, "operator", "first")
    assert first.status_code == 201
    if path == "/surveys/":
        made = [f"/plans/{one['id']}" for one in (first.json or {})["plans"]]
    else:
        made = [f"{path}{(first.json or {})['id']}"]
    edge.clock.pass_s(11.0)  # An event that has expired may be deleted
    for thing in made:
        assert edge.ask("DELETE", thing, "operator").status_code == 204
    again = edge.post(path, body, "operator", "first")
    assert (again.status_code, again.json) == (201, first.json)


@pytest.mark.parametrize("slash", ["", "/"])
def test_a_method_that_a_path_does_not_have_is_405_in_both_spellings(
    edge: Edge, slash: str
) -> None:
    answer = edge.ask("DELETE", f"/plans{slash}", "operator")
    assert answer.status_code == 405
    assert "DELETE" not in answer.headers["Allow"]
    assert {"GET", "POST"} <= set(answer.headers["Allow"].split(", "))
