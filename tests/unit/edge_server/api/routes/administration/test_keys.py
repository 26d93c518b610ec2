"""Keys are created by admins, shown once, restricted, and revoked."""

from typing import Any

import pytest
from sqlalchemy import text
from werkzeug.test import TestResponse

from edge_server.services.context import moment
from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan, telemetry


def make(edge: Edge, role: str, name: str = "another", **limits: Any) -> str:
    answer = edge.post("/keys/", {"name": name, "role": role} | limits, "admin")
    assert answer.status_code == 201, answer.json
    return str((answer.json or {})["key"])


def ask(edge: Edge, key: str, method: str, path: str, body: Any = None) -> TestResponse:
    options = {} if body is None else {"json": body}
    return edge.ask(method, path, None, headers={"X-API-Key": key}, **options)


def status(edge: Edge, key: str, method: str, path: str, body: Any = None) -> int:
    return ask(edge, key, method, path, body).status_code


def test_a_key_is_shown_once_and_has_the_permissions_of_its_role(edge: Edge) -> None:
    key = make(edge, "operator", "Tablet.2")
    assert status(edge, key, "GET", "/dead_letters/") == 200
    assert status(edge, key, "GET", "/keys/") == 403
    secret = key.rpartition("_")[2]
    listed = edge.ask("GET", "/keys/", "admin")
    assert secret not in listed.text
    assert secret not in edge.ask("GET", f"/keys/{keys.prefix_of(key)}", "admin").text
    assert secret not in edge.ask("GET", "/audit/", "admin").text
    assert {one["name"] for one in listed.json or []} == {"Tablet.2", *Role}


def test_a_revoked_key_is_refused_at_once(edge: Edge) -> None:
    key = make(edge, "farmer")
    assert status(edge, key, "GET", "/plans/") == 200
    place = f"/keys/{keys.prefix_of(key)}"
    assert edge.ask("DELETE", place, "admin").status_code == 204
    assert status(edge, key, "GET", "/plans/") == 401
    assert edge.ask("DELETE", place, "admin").status_code == 404
    assert edge.get(place, "admin")["state"] == "revoked"


def test_a_key_expires(edge: Edge) -> None:
    ends = moment(edge.clock() + 60).isoformat()
    key = make(edge, "farmer", expires_at=ends)
    edge.clock.pass_s(59)
    assert status(edge, key, "GET", "/plans/") == 200
    edge.clock.pass_s(1)
    assert status(edge, key, "GET", "/plans/") == 401
    make(edge, "farmer", "another")  # Its name is free again


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({}, "name"),
        ({"name": "a"}, "role"),
        ({"name": "", "role": "farmer"}, "name"),
        ({"name": "a b", "role": "farmer"}, "name"),
        ({"name": "a" * 65, "role": "farmer"}, "name"),
        ({"name": "a", "role": "root"}, "role"),
        ({"name": "a", "role": "farmer", "scopes": ["all"]}, "scopes"),
        ({"name": "a", "role": "broker", "vehicle_ids": []}, "vehicle_ids"),
        ({"name": "a", "role": "broker", "vehicle_ids": [0]}, "vehicle_ids"),
        ({"name": "a", "role": "farmer", "expires_at": "2020-01-01T00:00:00Z"}, "expires_at"),
        ({"name": "a", "role": "farmer", "secret": "mine"}, "secret"),
    ],
)
def test_an_invalid_key_request_is_refused_with_its_field(
    edge: Edge, body: Any, field: str
) -> None:
    answer = edge.post("/keys/", body, "admin")
    assert answer.status_code == 422
    assert any(path.startswith(field) for path in (answer.json or {})["detail"]["json"])


def test_a_name_in_use_and_the_last_admin(edge: Edge) -> None:
    assert edge.post("/keys/", {"name": "admin", "role": "farmer"}, "admin").status_code == 409
    own = f"/keys/{keys.prefix_of(edge.key('admin'))}"
    assert edge.ask("DELETE", own, "admin").status_code == 409
    make(edge, "admin", "read-only", scopes=["read"])
    assert edge.ask("DELETE", own, "admin").status_code == 409
    other = make(edge, "admin", "second")
    assert edge.ask("DELETE", own, "admin").status_code == 204
    assert status(edge, other, "GET", "/keys/") == 200


def test_a_restricted_admin_creates_no_key(edge: Edge) -> None:
    for limits in ({"vehicle_ids": [1]}, {"scopes": ["read", "report", "metrics"]}):
        key = make(edge, "admin", f"narrow-{len(limits)}-{next(iter(limits))}", **limits)
        assert status(edge, key, "POST", "/keys/", {"name": "wide", "role": "admin"}) == 403
        own = f"/keys/{keys.prefix_of(edge.key('operator'))}"
        assert status(edge, key, "DELETE", own) == 403
        assert status(edge, key, "GET", "/keys/") == 200


def test_scopes(edge: Edge) -> None:
    read = make(edge, "operator", "screen", scopes=["read"])
    assert status(edge, read, "GET", "/plans/") == 200
    assert status(edge, read, "GET", "/metrics") == 200
    assert status(edge, read, "POST", "/plans/", plan()) == 403
    assert status(edge, read, "GET", "/audit/") == 403
    scrape = make(edge, "operator", "scraper", scopes=["metrics"])
    assert status(edge, scrape, "GET", "/metrics") == 200
    assert status(edge, scrape, "GET", "/plans/") == 403
    assert status(edge, scrape, "GET", "/openapi.json") == 403
    report = make(edge, "broker", "reporter", scopes=["report"])
    assert status(edge, report, "POST", "/pose/", telemetry("pose")) == 201
    assert status(edge, report, "PUT", "/vehicles/1", {"link_state": "stale"}) == 200
    assert status(edge, report, "GET", "/broker/commands") == 403
    assert status(edge, report, "GET", "/plans/") == 403


def test_a_broker_for_one_vehicle_cannot_report_for_another(edge: Edge) -> None:
    key = make(edge, "broker", vehicle_ids=[2])
    for kind in ("pose", "battery", "alarm", "mission_report", "image"):
        assert status(edge, key, "POST", f"/{kind}/", telemetry(kind, 0, 2)) == 201
        assert status(edge, key, "POST", f"/{kind}/", telemetry(kind, 1, 1)) == 403
    records = [{"pose": telemetry("pose", 5, number)} for number in (2, 1, 2)]
    answer = ask(edge, key, "POST", "/telemetry/", {"records": records}).json or {}
    assert [one["status"] for one in answer["records"]] == [201, 403, 201]
    assert edge.count("telemetry") == 7
    assert status(edge, key, "PUT", "/vehicles/1", {"link_state": "lost"}) == 403
    assert status(edge, key, "GET", "/vehicles/1") == 403
    assert status(edge, key, "PUT", "/vehicles/2", {"link_state": "lost"}) == 200
    found = ask(edge, key, "GET", "/vehicles/").json or []
    assert [one["vehicle_id"] for one in found] == [2]


def test_a_broker_for_one_vehicle_gets_no_work_of_another(edge: Edge) -> None:
    key = make(edge, "broker", vehicle_ids=[2])
    edge.post_plan(plan(mission(1, 1), mission(2, 2)))
    edge.post_plan(plan(mission(3, 1)))
    other = next(one["id"] for one in edge.work() if one["vehicle_id"] == 1)
    edge.clock.pass_s(61.0)  # The broker that served both vehicles is silent
    (own,) = (ask(edge, key, "GET", "/broker/commands").json or {})["commands"]
    assert own["vehicle_id"] == 2
    accepted = {"status": "accepted"}
    assert status(edge, key, "POST", f"/broker/commands/{other}/ack", accepted) == 403
    assert status(edge, key, "POST", f"/broker/commands/{own['id']}/ack", accepted) == 200
    (shown,) = ask(edge, key, "GET", "/plans/").json or []
    assert [one["vehicle_id"] for one in shown["missions"]] == [2]
    assert status(edge, key, "GET", "/plans/1") == 200
    assert status(edge, key, "GET", "/plans/2") == 403
    assert status(edge, key, "GET", "/plans/?vehicle_id=1") == 403


def test_an_operator_for_one_vehicle_cannot_change_another(edge: Edge) -> None:
    key = make(edge, "operator", vehicle_ids=[2])
    edge.post_plan(plan(mission(1, 1), mission(2, 2), dispatch=False))
    assert status(edge, key, "POST", "/plans/", plan(mission(3, 1))) == 403
    assert status(edge, key, "POST", "/plans/", plan(mission(3, 1), mission(4, 2))) == 403
    assert status(edge, key, "POST", "/plans/", plan(mission(3, 2))) == 201
    assert status(edge, key, "POST", "/plans/1/dispatch") == 403
    assert status(edge, key, "PUT", "/plans/1", plan(mission(5, 2))) == 403
    assert status(edge, key, "PUT", "/plans/2", plan(mission(5, 1))) == 403
    assert status(edge, key, "PUT", "/plans/2", plan(mission(5, 2))) == 200
    assert status(edge, key, "DELETE", "/plans/1") == 403
    assert status(edge, key, "DELETE", "/plans/2") == 204
    abort = {"sequence_number": 1, "event_type_id": 2}
    assert status(edge, key, "POST", "/events/", abort | {"vehicle_id": 1}) == 403
    asked = {"sequence_number": 1}
    assert status(edge, key, "POST", "/latest_state_vector/", asked) == 403
    assert status(edge, key, "POST", "/latest_state_vector/", asked | {"vehicle_id": 2}) == 202


@pytest.mark.thorough
def test_lists_leave_out_what_belongs_to_others(edge: Edge) -> None:
    edge.register(3)
    for number in range(9):
        edge.report("pose", telemetry("pose", number, 1 + number % 3))
    key = make(edge, "admin", vehicle_ids=[2, 3])
    first = ask(edge, key, "GET", "/pose/?limit=4").json or []
    assert [(one["id"], one["vehicle_id"]) for one in first] == [(2, 2), (3, 3), (5, 2), (6, 3)]
    rest = ask(edge, key, "GET", "/pose/?limit=4&after=6").json or []
    assert [one["id"] for one in rest] == [8, 9]
    for method, body in (("GET", None), ("PUT", telemetry("pose", 9, 1)), ("DELETE", None)):
        assert status(edge, key, method, "/pose/1", body) == 403
    assert status(edge, key, "DELETE", "/pose/2") == 204


def test_dead_letters_of_others_stay_out_of_reach(edge: Edge) -> None:
    for number in (1, 2):
        edge.report("pose", telemetry("pose", 0, number))
    with edge.context.database.write() as own:
        own.execute(text("UPDATE outbox SET state = 'dead', last_error = 'a test'"))
    key = make(edge, "admin", vehicle_ids=[2])
    assert [one["id"] for one in ask(edge, key, "GET", "/dead_letters/").json or []] == [2]
    for method, path in (
        ("GET", "/dead_letters/1"),
        ("PUT", "/dead_letters/1"),
        ("DELETE", "/dead_letters/1"),
        ("POST", "/dead_letters/1/retry"),
        ("POST", "/dead_letters/retry"),
        ("POST", "/dead_letters/retry?vehicle_id=1"),
        ("GET", "/dead_letters/export"),
        ("GET", "/dead_letters/export?vehicle_id=1"),
    ):
        assert status(edge, key, method, path, {} if method != "GET" else None) == 403, path
    assert status(edge, key, "GET", "/dead_letters/export?vehicle_id=2") == 200
    assert status(edge, key, "POST", "/dead_letters/2/retry") == 200


def test_the_last_admin_key_that_does_not_expire_cannot_be_revoked(edge: Edge) -> None:
    own = f"/keys/{keys.prefix_of(edge.key('admin'))}"
    brief = make(edge, "admin", "guest", expires_at="2026-11-21T13:00:00Z")
    assert edge.ask("DELETE", own, "admin").status_code == 409
    assert status(edge, brief, "DELETE", f"/keys/{keys.prefix_of(brief)}") == 204
    assert edge.ask("GET", "/keys/", "admin").status_code == 200


def test_an_unknown_key_has_another_message_than_none(edge: Edge) -> None:
    none = edge.client.get("/plans/")
    wrong = edge.client.get("/plans/", headers={"X-API-Key": keys.generate()})
    assert (none.status_code, wrong.status_code) == (401, 401)
    assert "is needed" in (none.json or {})["message"]
    assert (wrong.json or {})["message"].startswith("unknown key: ")


@pytest.mark.first_case
@BOTH_ENGINES
def test_two_brokers_may_use_the_same_idempotency_key(edge: Edge) -> None:
    north, south = make(edge, "broker", "north"), make(edge, "broker", "south")
    answers = [
        edge.client.post(
            "/pose/",
            json=telemetry("pose", number),
            headers={"X-API-Key": key, "Idempotency-Key": "pose-0"},
        )
        for number, key in enumerate((north, south, north))
    ]
    assert [answer.status_code for answer in answers] == [201, 201, 422]
    assert len(edge.get("/pose/")) == 2
    bulk = {"records": [{"pose": telemetry("pose", 1), "idempotency_key": "pose-0"}]}
    for key, expected in ((south, 201), (north, 422)):
        answer = edge.client.post("/telemetry/", json=bulk, headers={"X-API-Key": key})
        assert [one["status"] for one in (answer.json or {})["records"]] == [expected]
    assert len(edge.get("/pose/")) == 2
