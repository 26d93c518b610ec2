"""Dead letters: shown with the reason, retried, corrected or discarded."""

import json
from datetime import datetime
from typing import Any

import pytest

from afarcloud.wire import TELEMETRY
from edge_server.api.schemas import Record
from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission_report, plan, telemetry

pytestmark = BOTH_ENGINES

KINDS = [kind.value for kind in TELEMETRY]
REASON = "422: longitude is missing"


def rejected(edge: Edge, kind: str = "pose", vehicle_id: int = 1) -> dict[str, Any]:
    """A report that the cloud has rejected on its third try."""
    stored: dict[str, Any] = edge.report(kind, telemetry(kind, 0, vehicle_id)).json or {}
    with edge.context.database.write() as connection:
        queued = queue.read_queued(connection, Stream(vehicle_id, kind), 0, 10)
        (record,) = [one for one in queued if one.record_id == stored["id"]]
        queue.mark_dead(connection, record, 3, REASON, edge.clock.now)
    return stored


def bury_all(edge: Edge, kind: str) -> None:
    with edge.context.database.write() as connection:
        for record in queue.read_queued(connection, Stream(1, kind), 0, 10):
            queue.mark_dead(connection, record, 3, REASON, edge.clock.now)


def due(edge: Edge, kind: str = "pose", vehicle_id: int = 1) -> list[int]:
    with edge.context.database.read() as connection:
        queued = queue.read_queued(connection, Stream(vehicle_id, kind), 0, 10)
    return [record.record_id for record in queued]


def ask(edge: Edge, method: str, record_id: int, action: str = "") -> Any:
    return edge.ask(method, f"/dead_letters/{record_id}{action}", "admin")


@pytest.mark.first_case
def test_a_dead_letter_is_shown_with_its_reason(edge: Edge) -> None:
    stored = rejected(edge)
    rejected_at = edge.clock.now
    edge.clock.pass_s(60.0)
    edge.report("pose", telemetry("pose", 1))
    (letter,) = edge.get("/dead_letters/")
    assert letter == ask(edge, "GET", stored["id"]).json
    assert (letter["id"], letter["kind"], letter["vehicle_id"]) == (stored["id"], "pose", 1)
    assert (letter["attempts"], letter["reason"]) == (3, REASON)
    assert letter["report"] == stored
    assert datetime.fromisoformat(letter["rejected_at"]).timestamp() == rejected_at


@pytest.mark.first_case
def test_pictures_are_listed_without_their_frame(edge: Edge) -> None:
    stored = rejected(edge, "image")
    (letter,) = edge.get("/dead_letters/")
    assert "frame" not in letter["report"]
    assert "frame" in ask(edge, "GET", stored["id"]).json["report"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("query", "listed"),
    [
        ("", [0, 1, 2]),
        ("?kind=pose", [0, 2]),
        ("?vehicle_id=2", [2]),
        ("?limit=1", [0]),
        ("?kind=alarm", []),
    ],
)
def test_a_filtered_list(edge: Edge, query: str, listed: list[int]) -> None:
    letters = [rejected(edge), rejected(edge, "battery"), rejected(edge, "pose", 2)]
    found = [letter["id"] for letter in edge.get(f"/dead_letters/{query}")]
    assert found == [letters[index]["id"] for index in listed]


@pytest.mark.first_case
def test_an_unknown_kind_is_named(edge: Edge) -> None:
    answer = edge.ask("GET", "/dead_letters/?kind=plan", "operator")
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["query"]) == ["kind"]


@pytest.mark.first_case
def test_a_retried_letter_is_due_before_later_reports(edge: Edge) -> None:
    stored = rejected(edge)
    later = (edge.report("pose", telemetry("pose", 1)).json or {})["id"]
    assert due(edge) == [later]
    assert ask(edge, "POST", stored["id"], "/retry").json == stored
    assert due(edge) == [stored["id"], later]
    assert edge.get("/dead_letters/") == []


@pytest.mark.first_case
def test_a_discarded_letter_is_gone(edge: Edge) -> None:
    stored = rejected(edge)
    assert ask(edge, "DELETE", stored["id"]).status_code == 204
    assert edge.get("/dead_letters/") == []
    assert edge.ask("GET", f"/pose/{stored['id']}", "operator").status_code == 404
    assert due(edge) == []


@pytest.mark.first_case
@pytest.mark.parametrize(("method", "action"), [("GET", ""), ("POST", "/retry"), ("DELETE", "")])
def test_a_report_that_still_waits_is_no_dead_letter(edge: Edge, method: str, action: str) -> None:
    waiting = (edge.report("pose", telemetry("pose")).json or {})["id"]
    assert ask(edge, method, waiting, action).status_code == 404
    assert due(edge) == [waiting]


@pytest.mark.parametrize("kind", KINDS)
def test_a_letter_without_its_receipt_is_accepted_as_it_is_shown(edge: Edge, kind: str) -> None:
    stored = rejected(edge, kind)
    shown = ask(edge, "GET", stored["id"]).json["report"]
    report = {name: value for name, value in shown.items() if name not in Record.model_fields}
    answer = edge.ask("PUT", f"/dead_letters/{stored['id']}", "admin", json=report)
    assert answer.status_code == 200, answer.text
    assert due(edge, kind) == [stored["id"]]


@pytest.mark.first_case
def test_all_are_retried_or_those_of_a_kind_or_vehicle(edge: Edge) -> None:
    poses = [rejected(edge)["id"], rejected(edge, "pose", 2)["id"]]
    battery = rejected(edge, "battery")["id"]
    assert ask_all(edge, "?kind=battery") == {"retried": 1}
    assert due(edge, "battery") == [battery]
    assert ask_all(edge, "?vehicle_id=2") == {"retried": 1}
    assert ask_all(edge) == {"retried": 1}
    assert [*due(edge), *due(edge, "pose", 2)] == poses
    assert ask_all(edge) == {"retried": 0}


def ask_all(edge: Edge, query: str = "") -> Any:
    return edge.ask("POST", f"/dead_letters/retry{query}", "operator").json


@pytest.mark.first_case
def test_a_corrected_letter_is_due_as_a_new_message_in_its_old_place(edge: Edge) -> None:
    stored = rejected(edge)
    later = (edge.report("pose", telemetry("pose", 1)).json or {})["id"]
    body = telemetry("pose", 0) | {"yaw": 12.5}
    answer = edge.ask("PUT", f"/dead_letters/{stored['id']}", "admin", json=body)
    assert answer.status_code == 200
    assert (answer.json or {})["yaw"] == 12.5
    assert (answer.json or {})["message_id"] != stored["message_id"]
    assert due(edge) == [stored["id"], later]


@pytest.mark.first_case
def test_a_correction_that_cannot_be_used_changes_nothing(edge: Edge) -> None:
    stored = rejected(edge)
    before = edge.get("/dead_letters/")
    path = f"/dead_letters/{stored['id']}"
    for body, status in (
        (telemetry("pose", 0, 2), 409),
        (telemetry("pose") | {"latitude": 91}, 422),
        (telemetry("battery"), 422),
    ):
        assert edge.ask("PUT", path, "admin", json=body).status_code == status
    assert edge.get("/dead_letters/") == before
    waiting = (edge.report("pose", telemetry("pose")).json or {})["id"]
    answer = edge.ask("PUT", f"/dead_letters/{waiting}", "admin", json=telemetry("pose"))
    assert answer.status_code == 404


@pytest.mark.first_case
def test_the_export_holds_each_letter_whole_in_a_line(edge: Edge) -> None:
    letters = [rejected(edge, "image"), *(rejected(edge) for _ in range(30))]
    answer = edge.ask("GET", "/dead_letters/export", "operator")
    assert answer.content_type == "application/x-ndjson"
    lines = [json.loads(line) for line in answer.text.splitlines()]
    assert [line["report"] for line in lines] == [
        ask(edge, "GET", letter["id"]).json["report"] for letter in letters
    ]
    assert "frame" in lines[0]["report"]
    only = edge.ask("GET", "/dead_letters/export?kind=image", "operator").text
    assert [json.loads(line)["kind"] for line in only.splitlines()] == ["image"]


@pytest.mark.first_case
def test_a_dead_letter_is_not_corrected_against_what_is_known(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.accept()
    (item,) = edge.work()
    edge.report("mission_report", mission_report(3, 3, 3, 3, work_id=item["id"]))
    bury_all(edge, "mission_report")
    (letter,) = edge.get("/dead_letters/")
    path = f"/dead_letters/{letter['id']}"
    for wrong in (mission_report(2, 2), mission_report(3, 3, 3, 3, mission_id=7)):
        assert edge.ask("PUT", path, "admin", json=wrong).status_code == 409
    right = mission_report(3, 3, 3, 3, message="well", work_id=item["id"])
    answer = edge.ask("PUT", path, "admin", json=right)
    assert answer.status_code == 200
    assert "work_id" not in (answer.json or {})
    assert len(due(edge, "mission_report")) == 1
