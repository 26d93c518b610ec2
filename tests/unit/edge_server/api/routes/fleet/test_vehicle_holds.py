"""After a fault in flight a vehicle's queue waits for an operator."""

from typing import Any

import pytest

from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import (
    home,
    mission,
    mission_report,
    plan,
    takeoff,
    telemetry,
)

FAULT = "motor 2 failed"


def fly(edge: Edge, mission_id: int = 1, vehicle_id: int = 1) -> dict[str, Any]:
    """Accept a mission and have it take off; gives its work."""
    edge.post_plan(plan(mission(mission_id, vehicle_id)))
    (item,) = (one for one in edge.work() if one["mission"]["mission_id"] == mission_id)
    edge.acknowledge(item["id"], "accepted")
    report = mission_report(2, 2, mission_id=mission_id, vehicle_id=vehicle_id)
    assert edge.report("mission_report", report).status_code == 201
    return item


def fail(edge: Edge, mission_id: int = 1, vehicle_id: int = 1) -> None:
    """End a mission by a fault in flight."""
    fly(edge, mission_id, vehicle_id)
    report = mission_report(4, 3, 4, 5, mission_id=mission_id, vehicle_id=vehicle_id, message=FAULT)
    assert edge.report("mission_report", report).status_code == 201


def release(edge: Edge, role: str = "operator", vehicle_id: int = 1) -> Any:
    body = {"reason": "propeller changed"}
    return edge.post(f"/vehicles/{vehicle_id}/release", body, role)


def audited(edge: Edge) -> list[str]:
    lines = edge.ask("GET", "/audit/", "admin").text.splitlines()
    return [line for line in lines if "vehicles.release" in line]


def test_no_work_of_a_held_vehicle_is_published(edge: Edge) -> None:
    edge.post_plan(plan(mission(2)))
    fail(edge)
    edge.post_plan(plan(mission(3)))
    edge.post_plan(plan(mission(4, 2)))
    assert [item["mission"]["mission_id"] for item in edge.work()] == [4]
    held = edge.get("/vehicles/1")["held"]
    assert held == {
        "reason": FAULT,
        "since": "2026-11-21T12:00:00Z",
        "mission_id": 1,
        "plan_id": edge.get("/plans/2")["plan_id"],
    }
    assert edge.get("/vehicles/2")["held"] is None


@pytest.mark.thorough
def test_a_plan_for_a_held_vehicle_is_stored_with_the_reason_it_waits(edge: Edge) -> None:
    fail(edge)
    answer = edge.post_plan(plan(mission(2)))
    assert answer.status_code == 201
    (shown,) = (answer.json or {})["missions"]
    assert shown["dispatch_state"] == "queued"
    assert FAULT in shown["waiting"]
    assert "POST /vehicles/1/release" in shown["waiting"]
    (free,) = (edge.post_plan(plan(mission(3, 2))).json or {})["missions"]
    assert "waiting" not in free


def test_a_mission_that_a_broker_has_read_already_may_not_be_flown(edge: Edge) -> None:
    edge.post_plan(plan(mission(2)))
    (pulled,) = edge.work()
    fail(edge)
    answer = edge.acknowledge(pulled["id"], "accepted")
    assert answer.status_code == 409
    assert FAULT in (answer.json or {})["message"]
    (shown,) = edge.get("/plans/1")["missions"]
    assert (shown["dispatch_state"], shown["mission_status_name"]) == ("queued", "NOT_STARTED")


@pytest.mark.first_case
@pytest.mark.parametrize("status", [2, 3, 5])
def test_a_report_does_not_begin_what_waits_for_the_release(edge: Edge, status: int) -> None:
    edge.post_plan(plan(mission(2)))
    (pulled,) = edge.work()
    fail(edge)
    report = mission_report(status, status, mission_id=2, work_id=pulled["id"])
    answer = edge.report("mission_report", report)
    assert answer.status_code == 409
    assert FAULT in (answer.json or {})["message"]
    (shown,) = edge.get("/plans/1")["missions"]
    assert (shown["dispatch_state"], shown["mission_status_name"]) == ("queued", "NOT_STARTED")
    assert edge.work() == []


@pytest.mark.first_case
@pytest.mark.parametrize("status", ["accepted", "refused"])
def test_work_of_a_held_plan_is_not_acknowledged(edge: Edge, status: str) -> None:
    stored = edge.post_plan(plan(mission(1), dispatch=False)).json or {}
    assert edge.acknowledge(1, status).status_code == 409
    (shown,) = edge.get(f"/plans/{stored['id']}")["missions"]
    assert (shown["dispatch_state"], shown["mission_status_name"]) == ("held", "NOT_STARTED")


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_released_vehicle_flies_what_waited_in_its_old_order(edge: Edge) -> None:
    edge.post_plan(plan(mission(2), mission(20, 2)))
    fail(edge)
    edge.post_plan(plan(mission(3)))
    cursor = edge.get("/broker/commands?after=0", "broker")["cursor"]
    answer = release(edge)
    assert (answer.status_code, answer.json["held"]) == (200, None)
    again = edge.get(f"/broker/commands?after={cursor}", "broker")["commands"]
    assert [item["mission"]["mission_id"] for item in again] == [2, 3]
    for item in again:
        assert edge.acknowledge(item["id"], "accepted").status_code == 200
    assert [one["mission_id"] for one in edge.get("/plans/1")["missions"]] == [2, 20]


def test_releasing_twice_is_releasing_once(edge: Edge) -> None:
    fail(edge)
    edge.post_plan(plan(mission(2)))
    release(edge)
    work = edge.work()
    assert release(edge).status_code == 200
    assert edge.work() == work
    (line,) = audited(edge)
    assert "propeller changed" in line


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("role", "status"),
    [("operator", 200), ("admin", 200), ("farmer", 403), ("cloud", 403), ("broker", 403)],
)
def test_only_operators_and_admins_release(edge: Edge, role: str, status: int) -> None:
    fail(edge)
    assert release(edge, role).status_code == status
    assert (edge.get("/vehicles/1")["held"] is None) == (status == 200)


@pytest.mark.first_case
@pytest.mark.parametrize("body", [{}, {"reason": ""}, {"reason": 5}, {"reason": "x", "y": 1}])
def test_a_release_needs_a_reason(edge: Edge, body: dict[str, Any]) -> None:
    fail(edge)
    assert edge.post("/vehicles/1/release", body, "operator").status_code == 422
    assert edge.get("/vehicles/1")["held"] is not None


def test_an_unknown_vehicle_is_not_found(edge: Edge) -> None:
    assert release(edge, vehicle_id=77).status_code == 404


@pytest.mark.thorough
def test_an_alarm_on_the_mission_holds_at_once(edge: Edge) -> None:
    fly(edge)
    alarm = telemetry("alarm") | {"mission_id": 1, "message": "GPS lost"}
    assert edge.report("alarm", alarm).status_code == 201
    assert edge.get("/vehicles/1")["held"]["reason"] == "alarm 1/5: GPS lost"
    # The mission that flies is still the broker's
    assert [item["mission"]["mission_id"] for item in edge.work()] == [1]


@pytest.mark.first_case
@BOTH_ENGINES
def test_an_alarm_in_bulk_holds_too(edge: Edge) -> None:
    fly(edge)
    body = {"records": [{"alarm": telemetry("alarm") | {"mission_id": 1}}]}
    assert edge.post("/telemetry/", body, "broker").status_code == 200
    assert edge.get("/vehicles/1")["held"]["reason"] == "alarm 1/5"


def test_an_alarm_about_no_mission_holds_nothing(edge: Edge) -> None:
    fly(edge)
    edge.report("alarm", telemetry("alarm"))
    assert edge.get("/vehicles/1")["held"] is None


@pytest.mark.thorough
def test_a_refusal_before_take_off_holds_nothing(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    report = mission_report(4, 4, 5, 5, mission_id=1, message="arming denied: no GPS")
    edge.report("mission_report", report)
    assert edge.get("/vehicles/1")["held"] is None


@pytest.mark.first_case
@pytest.mark.parametrize(("status", "last"), [(3, 3), (5, 5)])
def test_a_mission_that_ends_as_ordered_holds_nothing(edge: Edge, status: int, last: int) -> None:
    fly(edge)
    edge.report("mission_report", mission_report(status, 3, 3, last, mission_id=1))
    assert edge.get("/vehicles/1")["held"] is None


def test_the_first_fault_stays_the_reason(edge: Edge) -> None:
    fly(edge)
    edge.report("alarm", telemetry("alarm") | {"mission_id": 1, "message": "GPS lost"})
    edge.clock.pass_s(5)
    edge.report("mission_report", mission_report(4, 3, 4, 5, mission_id=1, message="GPS lost"))
    held = edge.get("/vehicles/1")["held"]
    assert (held["reason"], held["since"]) == ("alarm 1/5: GPS lost", "2026-11-21T12:00:00Z")


def test_a_vehicle_state_does_not_release(edge: Edge) -> None:
    fail(edge)
    body = {"link_state": "connected", "held": None}
    assert edge.ask("PUT", "/vehicles/1", "operator", json=body).status_code == 422
    edge.register(1)
    assert edge.get("/vehicles/1")["held"] is not None


def test_a_key_for_another_vehicle_does_not_release(edge: Edge) -> None:
    fail(edge)
    body = {"name": "north", "role": "operator", "vehicle_ids": [2]}
    made = edge.post("/keys/", body, "admin").json or {}
    headers = {"X-API-Key": made["key"]}
    answer = edge.client.post("/vehicles/1/release", json={"reason": "x"}, headers=headers)
    assert answer.status_code == 403


SentRecord = tuple[str, dict[str, Any]]
"""Kind and body of a record."""


def statement(status: int, *commands: int, **fields: Any) -> SentRecord:
    return "mission_report", mission_report(status, *commands, mission_id=1, **fields)


def at_height(altitude: float, **fields: Any) -> SentRecord:
    return "state_vector", telemetry("state_vector") | {"altitude": altitude} | fields


ALARM: SentRecord = ("alarm", telemetry("alarm") | {"mission_id": 1})
IN_FLIGHT: tuple[SentRecord, ...] = (statement(2, 2), at_height(20.0))
"""What shows that a vehicle has left the ground, each by itself."""
ENDED_BY_FAULT: tuple[tuple[SentRecord, ...], ...] = (
    (statement(2, 2), statement(2, 4), statement(4, 4, 5, 5)),  # The running take-off failed
    (statement(4, 2, 1, 1),),
    (statement(4, 3, 4, 5),),
    (statement(2, 1, 2), statement(4, 5, 4, 5)),
    (statement(4, 5, 2, 5),),
    (statement(2, 2), statement(5, 3, 5, 5), ALARM),
    (ALARM, statement(5, 3, 5, 5)),
    (ALARM, at_height(20.0), statement(5, 5, 5, 5)),
    (at_height(20.0), statement(4, 4, 5, 5)),
    (statement(2, 2), statement(3, 3, 3, 3), ALARM),
)


def accept(edge: Edge, vehicle_id: int = 1) -> dict[str, Any]:
    edge.post_plan(plan(mission(1, vehicle_id)))
    (item,) = (one for one in edge.work() if one["vehicle_id"] == vehicle_id)
    assert edge.acknowledge(item["id"], "accepted").status_code == 200
    return item


def of(vehicle_id: int, records: tuple[SentRecord, ...]) -> tuple[SentRecord, ...]:
    return tuple((kind, body | {"vehicle_id": vehicle_id}) for kind, body in records)


def send(edge: Edge, *records: SentRecord) -> None:
    for kind, body in records:
        edge.clock.pass_s(1.0)
        assert edge.report(kind, body).status_code == 201


def is_held(edge: Edge, vehicle_id: int = 1) -> bool:
    return edge.get(f"/vehicles/{vehicle_id}")["held"] is not None


@pytest.mark.thorough
def test_a_flight_that_ends_by_a_fault_holds_its_vehicle_once(edge: Edge) -> None:
    for vehicle_id, records in enumerate(ENDED_BY_FAULT, start=1):
        edge.register(vehicle_id)
        accept(edge, vehicle_id)
        send(edge, *of(vehicle_id, records))
        assert is_held(edge, vehicle_id), records
        assert release(edge, vehicle_id=vehicle_id).status_code == 200
        for kind, body in of(vehicle_id, records):
            edge.report(kind, body)
        assert not is_held(edge, vehicle_id), records


@pytest.mark.thorough
def test_a_batch_with_the_end_of_a_flight_by_a_fault_holds_too(edge: Edge) -> None:
    batch = []
    for vehicle_id, records in enumerate(ENDED_BY_FAULT, start=1):
        edge.register(vehicle_id)
        accept(edge, vehicle_id)
        batch += [{kind: body} for kind, body in of(vehicle_id, records)]
    assert edge.post("/telemetry/", {"records": batch}, "broker").status_code == 200
    held = [number for number in range(1, len(ENDED_BY_FAULT) + 1) if is_held(edge, number)]
    assert held == list(range(1, len(ENDED_BY_FAULT) + 1))


def test_a_mission_that_flew_and_is_refused_then_holds(edge: Edge) -> None:
    for vehicle_id, evidence in enumerate(IN_FLIGHT, start=1):
        item = accept(edge, vehicle_id)
        send(edge, *of(vehicle_id, (evidence,)))
        assert edge.acknowledge(item["id"], "refused", FAULT).status_code == 200
        assert edge.get(f"/vehicles/{vehicle_id}")["held"]["reason"] == FAULT


@pytest.mark.first_case
@BOTH_ENGINES
def test_evidence_of_the_flight_may_come_after_its_end(edge: Edge) -> None:
    accept(edge)
    edge.clock.pass_s(10.0)
    send(edge, statement(4, 4, 5, 5, message=FAULT))
    assert not is_held(edge)
    send(edge, at_height(20.0))  # Measured after the end: another vehicle flies
    send(edge, at_height(20.0, recorded_at="2026-11-21T11:59:00Z"))  # Before the acceptance
    assert not is_held(edge)
    send(edge, at_height(20.0, recorded_at="2026-11-21T12:00:05Z"))
    assert edge.get("/vehicles/1")["held"]["reason"] == FAULT


@pytest.mark.thorough
def test_a_report_that_comes_too_late_is_evidence_all_the_same(edge: Edge) -> None:
    accept(edge)
    send(edge, statement(4, 4, 5, 5))
    kind, late = statement(2, 2)
    assert edge.report(kind, late).status_code == 409
    assert is_held(edge)


def test_neither_the_ground_nor_another_vehicle_in_the_air_is_evidence(edge: Edge) -> None:
    accept(edge)
    send(edge, *(at_height(altitude) for altitude in (-3.0, 0.0, 1.5)))
    send(edge, at_height(20.0, vehicle_id=2), statement(4, 4, 5, 5))
    assert not is_held(edge)


def test_a_camera_before_the_take_off_moves_nothing(edge: Edge) -> None:
    picture = {
        "command_id": 9,
        "command_type_id": 4,
        "parameters": {"pitch_angle": -90.0},
    }
    edge.post_plan(plan(mission(1, command_array=[picture, takeoff(), home()])))
    (item,) = edge.work()
    edge.acknowledge(item["id"], "accepted")
    report = mission_report(4, mission_id=1)
    report["command_report_array"] = [
        {"command_id": 9, "command_status_id": 3},
        {"command_id": 1, "command_status_id": 4},
    ]
    assert edge.report("mission_report", report).status_code == 201
    assert not is_held(edge)


def test_a_fault_after_a_release_in_flight_holds_again(edge: Edge) -> None:
    accept(edge)
    send(edge, statement(2, 2), ALARM)
    assert release(edge).status_code == 200
    send(edge, statement(4, 3, 4, 5, message=FAULT))
    assert edge.get("/vehicles/1")["held"]["reason"] == FAULT


def test_a_flight_is_seen_though_the_vehicle_was_in_the_air_just_before(edge: Edge) -> None:
    edge.report(*at_height(20.0))
    accept(edge)
    send(edge, at_height(20.0), statement(4, 4, 5, 5))
    assert is_held(edge)


def test_a_mission_in_the_air_does_not_wait_again_for_a_late_alarm(edge: Edge) -> None:
    accept(edge)
    send(edge, statement(2, 2), statement(3, 3, 3, 3))
    edge.post_plan(plan(mission(2)))
    edge.accept()
    send(edge, at_height(20.0), ALARM)
    assert is_held(edge)
    (item,) = edge.work()
    assert (item["mission"]["mission_id"], item["state"]) == (2, "accepted")
    send(edge, ("mission_report", mission_report(3, 3, 3, 3, mission_id=2)))
    assert release(edge).status_code == 200
    assert edge.work() == []


def test_a_late_alarm_leaves_the_next_mission_accepted(edge: Edge) -> None:
    accept(edge)
    send(edge, statement(2, 2), statement(3, 3, 3, 3))
    edge.post_plan(plan(mission(2)))
    edge.accept()
    send(edge, ALARM)
    assert is_held(edge)
    (item,) = edge.work()
    assert (item["mission"]["mission_id"], item["state"]) == (2, "accepted")
    report = mission_report(2, 2, mission_id=2)
    assert edge.report("mission_report", report).status_code == 201


def test_a_fault_under_way_returns_an_accepted_mission_behind_it_to_the_queue(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    edge.post_plan(plan(mission(2)))
    edge.accept()
    send(edge, statement(2, 2), ALARM)
    (item,) = edge.work()
    assert (item["mission"]["mission_id"], item["state"]) == (1, "accepted")
    (waiting,) = edge.get("/plans/2")["missions"]
    assert waiting["dispatch_state"] == "queued"


def test_an_alarm_with_another_text_is_no_new_fault(edge: Edge) -> None:
    accept(edge)
    send(edge, statement(2, 2), ALARM)
    assert release(edge).status_code == 200
    (record,) = edge.get("/alarm/")
    body = ALARM[1] | {"message": "GPS lost over the barn"}
    path = f"/alarm/{record['id']}"
    assert edge.ask("PUT", path, "admin", json=body).status_code == 200
    assert not is_held(edge)
    other = body | {"alarm_code_id": 1}
    assert edge.ask("PUT", path, "admin", json=other).status_code == 200
    assert edge.get("/vehicles/1")["held"]["reason"] == "alarm 1/1: GPS lost over the barn"
