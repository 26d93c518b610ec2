"""Many reports in one request: each is stored or refused by itself, all in one transaction."""

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import TELEMETRY, plan, telemetry

KINDS = list(TELEMETRY)


def post(edge: Edge, *records: Any) -> list[dict[str, Any]]:
    answer = edge.post("/telemetry/", {"records": list(records)}, "broker")
    assert answer.status_code == 200, answer.text
    entries: list[dict[str, Any]] = (answer.json or {})["records"]
    return entries


def test_every_kind_is_kept_and_due_in_order(edge: Edge) -> None:
    entries = post(edge, *({kind: telemetry(kind)} for kind in KINDS))
    assert [entry["status"] for entry in entries] == [201] * len(KINDS)
    identifiers = [entry["id"] for entry in entries]
    assert identifiers == sorted(identifiers)
    for kind, entry in zip(KINDS, entries, strict=True):
        stored = edge.get(f"/{kind}/{entry['id']}")
        assert stored["message_id"] == entry["message_id"]
        assert stored["received_at"] == entry["received_at"]
    assert edge.count("outbox") == len(KINDS)


def test_a_bad_report_spoils_only_itself(edge: Edge) -> None:
    entries = post(
        edge,
        {"pose": telemetry("pose")},
        {"pose": {**telemetry("pose", 1), "latitude": 91}},
        {"plan": {}},
        "pose",
        {"battery": telemetry("battery")},
    )
    assert [entry["status"] for entry in entries] == [201, 422, 422, 422, 201]
    assert list(entries[1]["detail"]["json"]) == ["latitude"]
    assert edge.count("telemetry") == 2


def test_a_repeated_report_is_kept_once(edge: Edge) -> None:
    record = {"pose": telemetry("pose"), "idempotency_key": "one"}
    first, again = post(edge, record, record)
    assert first == again
    assert post(edge, record) == [first]
    alone = edge.report("pose", telemetry("pose"), key="one")
    assert (alone.status_code, (alone.json or {})["id"]) == (201, first["id"])
    assert edge.count("telemetry") == 1


def test_a_key_of_another_report_is_refused_alone(edge: Edge) -> None:
    entries = post(
        edge,
        {"pose": telemetry("pose"), "idempotency_key": "one"},
        {"pose": telemetry("pose", 1), "idempotency_key": "one"},
        {"pose": telemetry("pose", 2), "idempotency_key": "two"},
        {"pose": telemetry("pose", 3), "idempotency_key": " "},
    )
    assert [entry["status"] for entry in entries] == [201, 422, 201, 422]
    assert list(entries[3]["detail"]["json"]) == ["idempotency_key"]
    assert edge.count("telemetry") == 2


def test_a_mission_report_moves_the_mission(edge: Edge) -> None:
    posted = edge.post_plan(plan()).json or {}
    mission = posted["missions"][0]
    edge.accept()
    report = telemetry("mission_report") | {
        "mission_id": mission["mission_id"],
        "mission_status_id": 2,
        "command_report_array": [],
    }
    post(edge, {"mission_report": report})
    shown = edge.get(f"/plans/{posted['id']}")
    assert shown["missions"][0]["mission_status_id"] == 2


@pytest.mark.first_case
@pytest.mark.parametrize(
    "body",
    [[], {}, {"records": {}}, {"records": []}, {"records": [{}], "x": 1}],
)
def test_a_body_without_a_list_of_reports_is_refused(edge: Edge, body: Any) -> None:
    answer = edge.post("/telemetry/", body, "broker")
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["json"]) == ["records"]


def test_a_body_holds_500_reports_and_no_more(edge: Edge) -> None:
    unknown: dict[str, Any] = {"plan": {}}
    assert [entry["status"] for entry in post(edge, *[unknown] * 500)] == [422] * 500
    answer = edge.post("/telemetry/", {"records": [unknown] * 501}, "broker")
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["json"]) == ["records"]


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from([*KINDS, "idempotency_key", "x"]), inner, max_size=3)
    ),
    max_leaves=10,
)


@pytest.mark.thorough
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(json_values, min_size=1, max_size=4))
def test_whatever_comes_each_entry_has_its_answer(edge: Edge, records: list[Any]) -> None:
    before = edge.count("telemetry")
    entries = post(edge, *records)
    assert len(entries) == len(records)
    kept = sum(entry["status"] == 201 for entry in entries)
    assert edge.count("telemetry") == before + kept
