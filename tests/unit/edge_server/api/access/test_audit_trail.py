"""Every write by a person or the cloud leaves a row, in the transaction that makes it."""

import json
from typing import Any

import pytest
from sqlalchemy import text

from edge_server.services import audit
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, mission, plan, telemetry


def log_of(edge: Edge) -> list[dict[str, Any]]:
    answer = edge.ask("GET", "/audit/", "admin")
    assert answer.content_type == "application/x-ndjson"
    return [json.loads(line) for line in answer.text.splitlines()]


def audit_rows(edge: Edge) -> list[tuple[str, str, str, str]]:
    return [(row["role"], row["action"], row["object"], row["result"]) for row in log_of(edge)]


def test_a_plan_from_draft_to_its_end(edge: Edge) -> None:
    edge.post("/plans/", plan(dispatch=False), "farmer")
    edge.ask("PUT", "/plan/1", "operator", json=plan(mission(1300), dispatch=False))
    edge.ask("POST", "/plans/1/dispatch", "farmer")
    edge.ask("POST", "/plans/1/dispatch/", "operator")
    edge.ask("DELETE", "/plans/1", "admin")
    assert audit_rows(edge) == [
        ("farmer", "plans.create", "plans/1", "done"),
        ("operator", "plans.put", "plans/1", "done"),
        ("farmer", "plans.dispatch", "plans/1", "403"),
        ("operator", "plans.dispatch", "plans/1", "done"),
        ("admin", "plans.delete", "plans/1", "done"),
    ]
    assert audit.verify(edge.context.database).fault is None


def test_an_order_to_a_vehicle_is_named_with_the_vehicle(edge: Edge) -> None:
    edge.post("/plans/", plan(), "operator")
    edge.post("/events/", event(), "operator")
    assert audit_rows(edge)[-1] == (
        "operator",
        "events.create",
        "events/1: ABORT_MISSION of vehicle 1",
        "done",
    )


def test_a_row_has_the_caller_its_address_and_the_request_id(edge: Edge) -> None:
    edge.ask(
        "POST", "/plans/", "cloud", json=plan(), headers={"X-Request-ID": "the-request-of-now"}
    )
    (row,) = log_of(edge)
    assert row["who"] == row["role"] == "cloud"
    assert row["key_prefix"] == edge.key("cloud").split("_")[1]
    assert row["address"] == "127.0.0.1"
    assert row["request_id"] == "the-request-of-now"
    assert row["at"] == edge.clock()


def test_brokers_and_reads_are_not_audited(edge: Edge) -> None:
    edge.report("pose", telemetry("pose"))
    edge.post("/telemetry/", {"records": [{"pose": telemetry("pose", 1)}]}, "broker")
    for path in ("/plans/", "/pose/", "/keys/", "/audit/"):
        edge.ask("GET", path, "admin")
    assert audit_rows(edge) == []


def test_a_correction_and_a_removal_of_a_report(edge: Edge) -> None:
    edge.report("pose", telemetry("pose"))
    edge.ask("PUT", "/pose/1", "admin", json=telemetry("pose", 7))
    edge.ask("DELETE", "/pose/1", "operator")
    edge.ask("DELETE", "/pose/1", "admin")
    edge.ask("DELETE", "/vehicles/2", "admin")
    assert audit_rows(edge) == [
        ("admin", "telemetry.pose_put", "telemetry/1", "done"),
        ("operator", "telemetry.pose_delete", "telemetry/1", "403"),
        ("admin", "telemetry.pose_delete", "telemetry/1", "done"),
        ("admin", "vehicles.delete", "vehicles/2", "done"),
    ]


def test_repeated_and_invalid_requests_are_not_audited(edge: Edge) -> None:
    for _ in range(2):
        edge.post_plan(plan(), key="once")
    edge.post_plan({"plan": {}})
    edge.post_plan(plan(), key="another")  # 409
    assert [row[3] for row in audit_rows(edge)] == ["done", "409"]


def test_the_log_says_that_a_request_was_made_before(
    edge: Edge, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    for _ in range(2):
        edge.post_plan(plan(), key="once")
    posted = [text for text in caplog.messages if "posted plan" in text]
    assert ["again" in text for text in posted] == [False, True]


def test_without_its_row_a_change_is_not_made(edge: Edge) -> None:
    with edge.context.database.write() as own:
        own.execute(
            text(
                "CREATE TRIGGER full BEFORE INSERT ON audit "
                "BEGIN SELECT RAISE(ABORT, 'no row'); END"
            )
        )
    assert edge.post_plan(plan()).status_code >= 500
    assert edge.count("plan") == edge.count("work") == 0


@pytest.mark.first_case
@pytest.mark.parametrize("after", [0, 1, 2, 5])
def test_the_export_goes_on_where_it_ended(edge: Edge, after: int) -> None:
    for number in range(3):
        edge.post_plan(plan(mission(number + 1)))
    lines = edge.ask("GET", f"/audit/?after={after}", "admin").text.splitlines()
    assert [json.loads(line)["id"] for line in lines] == [1, 2, 3][after:]
