"""Values at the edge of what a database can hold: no engine answers with an internal error."""

from typing import Any

import pytest

from edge_server.store.rows import keys
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, mission_report, plan, telemetry

LARGEST = 2**63 - 1
NUL = "left\x00right"


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_number_that_nothing_has_finds_nothing(edge: Edge) -> None:
    for thing in ("plans", "pose", "events", "fields", "vehicles", "dead_letters"):
        assert edge.ask("GET", f"/{thing}/{LARGEST}", "admin").status_code == 404, thing
    assert edge.ask("DELETE", f"/vehicles/{LARGEST}", "admin").status_code == 404
    assert edge.acknowledge(LARGEST, "accepted").status_code == 404


@pytest.mark.parametrize("spelling", ["%D9%A1", "%EF%BC%91", "01", "+1", "1.0"])
def test_a_number_in_a_path_has_one_spelling(edge: Edge, spelling: str) -> None:
    """Digits of other scripts, or zeros before it, name nothing: a wrong vehicle is not deleted."""
    assert edge.ask("GET", "/vehicles/1", "admin").status_code == 200
    assert edge.ask("GET", f"/vehicles/{spelling}", "admin").status_code == 404
    assert edge.ask("DELETE", f"/vehicles/{spelling}", "admin").status_code == 404
    assert edge.ask("GET", "/vehicles/1", "admin").status_code == 200


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_list_after_the_largest_number_is_empty(edge: Edge) -> None:
    for thing in ("plans", "pose", "events", "fields", "audit", "dead_letters"):
        answer = edge.ask("GET", f"/{thing}/?after={LARGEST}", "admin")
        assert (answer.status_code, answer.data.strip() or b"[]") == (
            200,
            b"[]",
        )  # Or no line at all


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_nul_in_a_text_is_a_letter_like_others_on_its_way_to_the_cloud(edge: Edge) -> None:
    edge.post_plan(plan(mission()))
    edge.accept()
    kept = edge.report("mission_report", mission_report(2) | {"message": NUL})
    assert kept.status_code == 201
    assert kept.json is not None
    assert edge.get(f"/mission_report/{kept.json['id']}")["message"] == NUL
    (shown,) = edge.get("/plans/")
    assert shown["missions"][0]["message"].startswith("left")
    assert edge.report("alarm", telemetry("alarm") | {"message": NUL}).status_code == 201


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_nul_in_an_address_finds_nothing(edge: Edge) -> None:
    assert edge.ask("GET", f"/plans/{'%00' * 26}", "operator").status_code == 404


EDGES = [
    "9999-12-31T23:59:59-14:00",
    "9999-12-31T23:59:59Z",
    "9999-12-31T23:59:59.999999Z",
    "0001-01-01T00:00:00+14:00",
]


@pytest.mark.first_case
@pytest.mark.parametrize("edge_of_time", EDGES)
def test_a_time_at_the_calendars_edge_is_refused_by_its_path(edge: Edge, edge_of_time: str) -> None:
    report = telemetry("pose") | {"recorded_at": edge_of_time}
    for answer, path in (
        (edge.report("pose", report), "recorded_at"),
        (edge.post_plan(plan(expires_at=edge_of_time)), "expires_at"),
        (edge.ask("PUT", "/vehicles/1", "broker", json=VEHICLE | report_time(edge_of_time)), ""),
        (edge.post("/keys/", KEY | {"expires_at": edge_of_time}, "admin"), "expires_at"),
    ):
        assert answer.status_code == 422
        assert (path or "recorded_at") in (answer.json or {})["detail"]["json"]
    assert edge.ask("GET", "/keys/", "admin").status_code == 200


@pytest.mark.first_case
@pytest.mark.parametrize("edge_of_time", EDGES)
def test_a_time_at_the_calendars_edge_costs_its_own_record(edge: Edge, edge_of_time: str) -> None:
    poses = [telemetry("pose"), telemetry("pose") | {"recorded_at": edge_of_time}]
    body = {"records": [{"pose": pose} for pose in poses]}
    answer = edge.post("/telemetry/", body, "broker")
    assert [one["status"] for one in (answer.json or {})["records"]] == [201, 422]


@pytest.mark.first_case
@pytest.mark.parametrize("edge_of_time", EDGES)
def test_a_list_since_the_calendars_edge_answers(edge: Edge, edge_of_time: str) -> None:
    answer = edge.ask("GET", "/pose/", "operator", query_string={"since": edge_of_time})
    assert answer.status_code in {200, 422}


def test_a_key_that_was_kept_with_such_a_time_spoils_no_list(edge: Edge) -> None:
    made = edge.post("/keys/", KEY, "admin").json or {}
    with edge.context.database.write() as connection:
        keys.end(connection, made["prefix"], 253_402_351_199.0)
    shown = edge.get("/keys/", "admin")
    assert {one["name"] for one in shown} >= {"north"}


VEHICLE = {"link_state": "connected"}
KEY = {"name": "north", "role": "broker"}


def report_time(text: str) -> dict[str, str]:
    return {"recorded_at": text}


@pytest.mark.first_case
@pytest.mark.parametrize(
    "raw",
    [
        '{"link_state": "connected", "altitude": 3, "altitude": 119}',
        '{"link_state": "connected", "link_state": "connected"}',
        '{"a": {"b": [{"c": 1, "c": 1}]}}',
        '{"altitude": 3, "alt\\u0069tude": 119}',
    ],
)
def test_a_duplicate_member_is_refused(edge: Edge, raw: str) -> None:
    options: dict[str, Any] = {"data": raw, "content_type": "application/json"}
    answer = edge.ask("PUT", "/vehicles/1", "broker", **options)
    assert answer.status_code == 400
    assert "twice" in (answer.json or {})["detail"]["json"][""][0]


@pytest.mark.first_case
@pytest.mark.parametrize(
    "raw",
    [
        "9" * 5000,
        '{"link_state": "\\ud800"}',
        '{"\\ud800": 1}',
        '{"link_state": "connected", "altitude": 1e400}',
        '{"link_state": "connected", "altitude": -Infinity}',
        '{"link_state": "connected", "altitude": 1' + "0" * 400 + "}",
        '{"link_state": "connected", "mission_id": 1e308}',
        "[" * 100_000,
        '{"vehicle_id":' * 5000,
        '"\\u0000"',
        "\ufeff{}",
        "null",
    ],
)
def test_hostile_json_is_refused(edge: Edge, raw: str) -> None:
    options: dict[str, Any] = {"data": raw.encode(), "content_type": "application/json"}
    for method, path, role in (
        ("PUT", "/vehicles/1", "broker"),
        ("POST", "/plans/", "operator"),
        ("POST", "/events/", "operator"),
        ("POST", "/pose/", "broker"),
        ("POST", "/telemetry/", "broker"),
        ("POST", "/fields/", "operator"),
        ("POST", "/surveys/", "operator"),
        ("POST", "/keys/", "admin"),
    ):
        answer = edge.ask(method, path, role, **options)
        assert answer.status_code in {400, 422}, (path, answer.json)
        assert (answer.json or {})["message"]
