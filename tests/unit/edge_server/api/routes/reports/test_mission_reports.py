"""A report changes the one flight that it is about, and never contradicts an end."""

from typing import Any

import pytest

from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, mission, mission_report, plan, telemetry


def accepted(edge: Edge, mission_id: int = 1201) -> dict[str, Any]:
    """Post a plan, accept its mission; gives the work."""
    assert edge.post_plan(plan(mission(mission_id))).status_code == 201
    item = edge.work()[-1]
    assert edge.acknowledge(item["id"], "accepted").status_code == 200
    return item


def status_of(edge: Edge, number: int) -> str:
    (shown,) = edge.get(f"/plans/{number}")["missions"]
    return str(shown["mission_status_name"])


def forwarded(edge: Edge) -> list[int]:
    """Statuses of the mission reports that go to the cloud, in order."""
    return [report["mission_status_id"] for report in edge.get("/mission_report/")]


def test_an_old_report_does_not_end_a_mission_of_the_same_number(edge: Edge) -> None:
    old = mission_report(3, 3, 3, 3)
    accepted(edge)
    assert edge.report("mission_report", old).status_code == 201
    edge.post_plan(plan())
    assert edge.report("mission_report", old).status_code == 201
    assert status_of(edge, 2) == "NOT_STARTED"
    assert len(edge.work()) == 1


@pytest.mark.parametrize("mark", ["work_id", "session_id", "recorded_at"])
def test_an_old_report_does_not_end_an_accepted_mission_of_its_number(
    edge: Edge, mark: str
) -> None:
    marks: dict[str, Any] = {
        "session_id": "01K9Z4T1W8F6Q2M3N5P7R9S0VX",
        "recorded_at": "2026-11-21T11:59:00Z",
    }
    item = accepted(edge)
    marks["work_id"] = item["id"]
    old = mission_report(3, 3, 3, 3, **{mark: marks[mark]})
    assert edge.report("mission_report", old).status_code == 201
    accepted(edge)
    assert edge.report("mission_report", old).status_code == 201
    assert status_of(edge, 2) == "NOT_STARTED"
    assert status_of(edge, 1) == "FINISHED"


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_report_names_its_flight(edge: Edge) -> None:
    item = accepted(edge)
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    again = accepted(edge)
    named = {"work_id": again["id"], "plan_id": again["plan_id"]}
    edge.report("mission_report", mission_report(2, 2, work_id=item["id"]))
    assert status_of(edge, 2) == "NOT_STARTED"
    assert edge.report("mission_report", mission_report(2, 2, **named)).status_code == 201
    assert status_of(edge, 2) == "RUNNING"
    assert all("work_id" not in report for report in edge.get("/mission_report/"))


def test_a_queued_mission_changes_only_by_reports_that_name_it(edge: Edge) -> None:
    edge.post_plan(plan())
    answer = edge.report("mission_report", mission_report(3, 3, 3, 3))
    assert answer.status_code == 409
    assert list((answer.json or {})["detail"]["json"]) == ["mission_id"]
    assert status_of(edge, 1) == "NOT_STARTED"
    assert forwarded(edge) == []


def test_a_refusal_that_names_its_work_is_taken_before_the_acknowledgement(edge: Edge) -> None:
    edge.post_plan(plan())
    (item,) = edge.work()
    report = mission_report(4, 5, 4, 5, work_id=item["id"], plan_id=item["plan_id"])
    assert edge.report("mission_report", report).status_code == 201
    assert edge.acknowledge(item["id"], "refused", "leaves the geofence").status_code == 200
    assert forwarded(edge) == [4]


def test_work_that_was_replaced_is_not_reported_on(edge: Edge) -> None:
    stored = edge.post_plan(plan()).json or {}
    (item,) = edge.work()
    assert edge.ask("PUT", f"/plans/{stored['id']}", "operator", json=plan()).status_code == 200
    report = mission_report(4, 4, 5, 5, work_id=item["id"], plan_id=item["plan_id"])
    assert edge.report("mission_report", report).status_code == 409
    assert (status_of(edge, 1), forwarded(edge)) == ("NOT_STARTED", [])


@pytest.mark.first_case
@pytest.mark.parametrize("end", [3, 4, 5])
@pytest.mark.parametrize("status_id", [1, 2, 3, 4, 5])
def test_after_the_end_only_the_end_is_forwarded(edge: Edge, end: int, status_id: int) -> None:
    item = accepted(edge)
    named = {"work_id": item["id"]}
    assert edge.report("mission_report", mission_report(end, **named)).status_code == 201
    answer = edge.report("mission_report", mission_report(status_id, **named))
    assert answer.status_code == (201 if status_id == end else 409)
    assert forwarded(edge) == [end]
    if status_id != end:
        assert list((answer.json or {})["detail"]["json"]) == ["mission_status_id"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("first", "second", "status"),
    [
        ((3, 2), (2, 2), 409),  # Late: the command has finished meanwhile
        ((3, 2), (4, 2), 409),
        ((3, 2), (3, 3), 201),
        ((3, 2), (3, 1), 201),  # Open ones may come in any order; they do not go back
    ],
)
def test_an_ended_command_stays_as_it_ended(
    edge: Edge, first: tuple[int, ...], second: tuple[int, ...], status: int
) -> None:
    accepted(edge)
    edge.report("mission_report", mission_report(2, *first))
    assert edge.report("mission_report", mission_report(2, *second)).status_code == status
    assert len(forwarded(edge)) == (2 if status == 201 else 1)


def test_the_report_that_ended_a_mission_may_be_repeated(edge: Edge) -> None:
    accepted(edge)
    last = mission_report(4, 3, 4, 1)  # The third command is ABORTED by the end
    for _ in range(2):
        assert edge.report("mission_report", last).status_code == 201
    assert forwarded(edge) == [4]


def test_commands_that_the_mission_does_not_have_are_named(edge: Edge) -> None:
    accepted(edge)
    answer = edge.report("mission_report", mission_report(2, 3, 2, 1, 1, 1))
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["json"]) == [
        "command_report_array.3.command_id",
        "command_report_array.4.command_id",
    ]
    assert forwarded(edge) == []


def test_a_command_is_reported_once(edge: Edge) -> None:
    accepted(edge)
    report = mission_report(2, 3, 2)
    report["command_report_array"][1]["command_id"] = 1
    answer = edge.report("mission_report", report)
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["json"]) == ["command_report_array.1.command_id"]


def test_a_mission_that_was_closed_is_reported_once(edge: Edge) -> None:
    edge.post_plan(plan())
    (item,) = edge.work()
    assert edge.post("/events/", event(2), "operator").status_code == 201
    report = mission_report(5, 5, 5, 5, work_id=item["id"], plan_id=item["plan_id"])
    assert edge.report("mission_report", report).status_code == 409
    assert forwarded(edge) == [5]


@pytest.mark.thorough
def test_a_repeated_post_gets_its_first_answer_whatever_came_since(edge: Edge) -> None:
    accepted(edge)
    running = mission_report(2, 2)
    first = edge.report("mission_report", running, "running-1")
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    again = edge.report("mission_report", running, "running-1")
    assert (again.status_code, again.json) == (201, first.json)
    assert forwarded(edge) == [2, 3]


@pytest.mark.first_case
@BOTH_ENGINES
def test_in_bulk_each_report_is_checked_after_those_before_it(edge: Edge) -> None:
    accepted(edge)
    reports = [
        mission_report(2, 2),
        mission_report(3, 3, 3, 3),
        mission_report(2, 3, 2),
        mission_report(3, 3, 3, 3, 3),
        mission_report(3, 3, 3, 3),
    ]
    body = {"records": [{"mission_report": report} for report in reports]}
    answer = edge.post("/telemetry/", body, "broker")
    records = (answer.json or {})["records"]
    assert [one["status"] for one in records] == [201, 201, 409, 422, 201]
    assert records[4] == records[1]
    assert forwarded(edge) == [2, 3]


def test_in_bulk_a_repeated_key_moves_nothing_twice(edge: Edge) -> None:
    accepted(edge)
    keyed = {"idempotency_key": "one"}
    records = [
        {"mission_report": mission_report(2, 2)} | keyed,
        {"mission_report": mission_report(3, 3, 3, 3)},
        {"mission_report": mission_report(2, 2)} | keyed,
    ]
    for _ in range(2):
        answer = edge.post("/telemetry/", {"records": records}, "broker")
        assert [one["status"] for one in (answer.json or {})["records"]] == [201, 201, 201]


ELSEWHERE = "01K9Z4T1W8F6Q2M3N5P7R9S0VX"
"""A plan_id that this server has never seen."""


def test_a_report_of_an_unknown_mission_is_forwarded(edge: Edge) -> None:
    report = mission_report(3, 3, mission_id=77, plan_id=ELSEWHERE, work_id=5)
    assert edge.report("mission_report", report).status_code == 201
    accepted(edge)  # Others are known
    assert edge.report("mission_report", report | {"work_id": 500}).status_code == 201
    assert forwarded(edge) == [3, 3]


def refusal(edge: Edge, **names: Any) -> list[str]:
    """Fields at fault of a report FINISHED that is refused, alone and in a batch, and not kept."""
    report = mission_report(3, 3, 3, 3, **names)
    before = forwarded(edge)
    answer = edge.report("mission_report", report)
    assert answer.status_code == 409, (names, answer.json)
    batch = edge.post("/telemetry/", {"records": [{"mission_report": report}]}, "broker")
    (result,) = (batch.json or {})["records"]
    assert (result["status"], result["detail"]) == (409, (answer.json or {})["detail"])
    assert forwarded(edge) == before
    return list(result["detail"]["json"])


@pytest.mark.first_case
@BOTH_ENGINES
def test_every_number_of_a_report_fits_one_accepted_mission(edge: Edge) -> None:
    item = accepted(edge)
    work_id, plan_id = item["id"], item["plan_id"]
    other = edge.post_plan(plan(mission(7, 2))).json or {}
    event_id = edge.post("/events/", event(3, maximum_speed=2.0), "operator").json
    assert event_id is not None
    (asked,) = (one["id"] for one in edge.work() if one["kind"] == "event")
    assert refusal(edge, work_id=work_id, plan_id=ELSEWHERE) == ["plan_id"]
    assert refusal(edge, work_id=work_id, mission_id=1202) == ["mission_id"]
    assert refusal(edge, work_id=work_id, vehicle_id=2) == ["vehicle_id"]
    assert refusal(edge, work_id=work_id, plan_id=other["plan_id"]) == ["plan_id"]
    assert refusal(edge, work_id=asked) == ["work_id"]
    assert refusal(edge, work_id=500) == ["work_id"]
    assert refusal(edge, work_id=500, plan_id=plan_id) == ["work_id"]
    assert refusal(edge, plan_id=ELSEWHERE) == ["plan_id"]
    assert refusal(edge, plan_id=plan_id, mission_id=1202) == ["mission_id"]
    assert refusal(edge, plan_id=plan_id, vehicle_id=2) == ["vehicle_id"]
    assert refusal(edge, plan_id=other["plan_id"]) == ["mission_id"]
    assert refusal(edge, vehicle_id=2) == ["vehicle_id"]
    assert (status_of(edge, 1), status_of(edge, 2)) == ("NOT_STARTED", "NOT_STARTED")


def test_a_report_on_a_queued_or_held_plan_is_refused(edge: Edge) -> None:
    for number, is_draft in enumerate((True, False), start=1):
        stored = edge.post_plan(plan(dispatch=not is_draft)).json or {}
        assert refusal(edge, plan_id=stored["plan_id"]) == ["plan_id"]
        assert refusal(edge, work_id=number) == ["work_id"]
        assert refusal(edge) == ["mission_id"]
        assert status_of(edge, number) == "NOT_STARTED"


def test_a_report_on_a_deleted_plan_is_refused(edge: Edge) -> None:
    for is_draft in (True, False):
        stored = edge.post_plan(plan(dispatch=not is_draft)).json or {}
        work_id = 1 if is_draft else edge.work()[0]["id"]
        assert edge.ask("DELETE", f"/plans/{stored['id']}", "operator").status_code == 204
        assert refusal(edge, work_id=work_id, plan_id=stored["plan_id"]) == ["work_id"]
        assert refusal(edge, work_id=work_id) == ["work_id"]
        assert refusal(edge, plan_id=stored["plan_id"]) == ["plan_id"]
        assert refusal(edge) == ["mission_id"]
        assert refusal(edge, plan_id=ELSEWHERE) == ["mission_id"]


def test_a_report_on_a_deleted_mission_of_another_vehicle_is_refused(edge: Edge) -> None:
    accepted(edge)
    last = mission_report(3, 3, 3, 3)
    assert edge.report("mission_report", last).status_code == 201
    assert edge.ask("DELETE", "/plans/1", "operator").status_code == 204
    assert refusal(edge, vehicle_id=2) == ["vehicle_id"]
    unknown = last | {"vehicle_id": 2, "plan_id": ELSEWHERE}
    assert edge.report("mission_report", unknown).status_code == 201
    assert forwarded(edge) == [3, 3]


def test_a_replacement_is_not_ended_by_what_it_replaces(edge: Edge) -> None:
    stored = edge.post_plan(plan()).json or {}
    (item,) = edge.work()
    assert edge.ask("PUT", f"/plans/{stored['id']}", "operator", json=plan()).status_code == 200
    assert refusal(edge, plan_id=stored["plan_id"]) == ["plan_id"]
    edge.accept()
    assert refusal(edge, plan_id=stored["plan_id"], work_id=item["id"]) == ["work_id"]
    assert refusal(edge, work_id=item["id"]) == ["work_id"]
    assert status_of(edge, 1) == "NOT_STARTED"


@pytest.mark.thorough
def test_a_closed_mission_does_not_end_again(edge: Edge) -> None:
    item = accepted(edge)
    edge.report("mission_report", mission_report(2, 2))
    edge.clock.pass_s(400.0)
    closed = edge.post("/plans/1/close", {"reason": "broker lost"}, "operator")
    assert closed.status_code == 200
    report = mission_report(5, 5, 5, 5, work_id=item["id"])
    assert edge.report("mission_report", report).status_code == 409
    assert forwarded(edge) == [2, 5]


@pytest.mark.first_case
@BOTH_ENGINES
def test_the_cloud_receives_one_end_however_often_it_is_reported(edge: Edge) -> None:
    item = accepted(edge)
    last = mission_report(3, 3, 3, 3, work_id=item["id"], plan_id=item["plan_id"])
    receipt = {"id", "message_id", "received_at"}
    first = edge.report("mission_report", last).json or {}
    kept = {name: first[name] for name in receipt}
    for changed in ({}, {"sequence_number": 9}, {"message": "all done"}, {"work_id": None}):
        edge.clock.pass_s(1.0)
        answer = edge.report("mission_report", last | changed)
        assert answer.status_code == 201
        assert {name: (answer.json or {})[name] for name in receipt} == kept
    keyed = {"mission_report": last, "idempotency_key": "again"}
    batch = edge.post("/telemetry/", {"records": [keyed, keyed]}, "broker")
    assert (batch.json or {})["records"] == [kept | {"status": 201}] * 2
    assert edge.report("mission_report", last, "later").status_code == 201
    assert forwarded(edge) == [3]
    edge.ask("DELETE", "/plans/1", "operator")
    again = edge.report("mission_report", last, "later")
    assert {name: (again.json or {})[name] for name in receipt} == kept
    assert forwarded(edge) == [3]


def test_in_a_batch_a_key_of_another_record_ends_no_mission(edge: Edge) -> None:
    accepted(edge)
    records = [
        {"pose": telemetry("pose"), "idempotency_key": "one"},
        {"mission_report": mission_report(3, 3, 3, 3), "idempotency_key": "one"},
    ]
    answer = edge.post("/telemetry/", {"records": records}, "broker")
    assert [one["status"] for one in (answer.json or {})["records"]] == [201, 422]
    assert status_of(edge, 1) == "NOT_STARTED"


def correct(edge: Edge, record_id: int, report: dict[str, Any]) -> tuple[int, list[str]]:
    answer = edge.ask("PUT", f"/mission_report/{record_id}", "admin", json=report)
    return answer.status_code, list((answer.json or {}).get("detail", {}).get("json", {}))


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_correction_is_valid_where_a_report_is(edge: Edge) -> None:
    item = accepted(edge)
    edge.report("mission_report", mission_report(2, 2, plan_id=item["plan_id"]))
    running = edge.get("/mission_report/")[0]["id"]
    assert correct(edge, running, mission_report(2, 2, mission_id=7)) == (409, ["mission_id"])
    assert correct(edge, running, mission_report(2, 2, plan_id=ELSEWHERE)) == (409, ["plan_id"])
    assert correct(edge, running, mission_report(2, 2, vehicle_id=2)) == (409, ["vehicle_id"])
    assert correct(edge, running, mission_report(2, 1, 1, 1, 1))[0] == 422
    named = mission_report(2, 2, message="windy", work_id=item["id"])
    assert correct(edge, running, named) == (200, [])
    (shown,) = edge.get("/mission_report/")
    assert (shown["message"], "work_id" in shown) == ("windy", False)
    assert correct(edge, running, mission_report(2, 3, 2)) == (200, [])
    assert correct(edge, running, mission_report(2, 2)) == (
        409,
        ["command_report_array.0.command_status_id"],
    )
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    finished = edge.get("/mission_report/")[1]["id"]
    for status in (1, 2, 4, 5):
        wrong = (409, ["mission_status_id"])
        assert correct(edge, finished, mission_report(status, 3, 3, 3)) == wrong
    assert correct(edge, running, mission_report(3, 3, 3, 3)) == (409, ["mission_status_id"])
    assert correct(edge, running, mission_report(2, 3, 2, message="calm")) == (200, [])
    assert correct(edge, finished, mission_report(3, 3, 3, 3, message="well")) == (200, [])
    assert forwarded(edge) == [2, 3]
    repeated = edge.report("mission_report", mission_report(3, 3, 3, 3)).json or {}
    assert repeated["message_id"] == edge.get("/mission_report/")[1]["message_id"]


def test_a_correction_that_ends_a_mission_ends_it_here_too(edge: Edge) -> None:
    accepted(edge)
    edge.report("mission_report", mission_report(2, 2))
    record = edge.get("/mission_report/")[0]["id"]
    assert correct(edge, record, mission_report(4, 3, 4, 5)) == (200, [])
    assert status_of(edge, 1) == "FAILED"
    assert edge.get("/vehicles/1")["held"] is not None
    assert edge.report("mission_report", mission_report(4, 3, 4, 5)).status_code == 201
    assert forwarded(edge) == [4]


def test_a_correction_names_no_other_flight(edge: Edge) -> None:
    item = accepted(edge)
    edge.report("mission_report", mission_report(2, 2, plan_id=item["plan_id"]))
    edge.report("mission_report", mission_report(2, 2))
    named, unnamed = (record["id"] for record in edge.get("/mission_report/"))
    last = mission_report(3, 3, 3, 3, work_id=item["id"])
    batch = edge.post("/telemetry/", {"records": [{"mission_report": last}]}, "broker")
    assert batch.status_code == 200
    again = accepted(edge)
    for record in (named, unnamed):
        assert correct(edge, record, mission_report(2, 2, plan_id=ELSEWHERE)) == (409, ["plan_id"])
        assert correct(edge, record, mission_report(2, 2, work_id=500)) == (409, ["work_id"])
    other = mission_report(2, 2, message="windy", work_id=again["id"])
    assert correct(edge, named, other) == (409, ["plan_id"])
    assert correct(edge, named, mission_report(2, 2, message="windy")) == (200, [])
    for record in edge.get("/mission_report/")[1:]:
        edge.ask("DELETE", f"/mission_report/{record['id']}", "admin")
    assert correct(edge, named, mission_report(3, 3, 3, 3)) == (409, ["mission_status_id"])
    assert edge.get("/mission_report/")[0]["plan_id"] == item["plan_id"]
    assert status_of(edge, 2) == "NOT_STARTED"


def test_an_end_is_not_forwarded_before_earlier_reports(edge: Edge) -> None:
    accepted(edge)
    edge.report("mission_report", mission_report(2, 2))
    edge.report("mission_report", mission_report(2, 2))
    first, second = (record["id"] for record in edge.get("/mission_report/"))
    wrong = (409, ["mission_status_id"])
    assert correct(edge, first, mission_report(5, 3, 5, 5)) == wrong
    assert status_of(edge, 1) == "RUNNING"
    assert correct(edge, second, mission_report(5, 3, 5, 5)) == (200, [])
    assert (status_of(edge, 1), forwarded(edge)) == ("ABORTED", [2, 5])


def test_the_end_of_a_mission_that_is_not_known_is_not_corrected_to_another(edge: Edge) -> None:
    edge.report("mission_report", mission_report(3, mission_id=77))
    record = edge.get("/mission_report/")[0]["id"]
    assert correct(edge, record, mission_report(2, mission_id=77)) == (409, ["mission_status_id"])


def test_a_report_on_an_unknown_mission_is_not_corrected_behind_a_later_one(edge: Edge) -> None:
    for status in (2, 2, 4):
        edge.report("mission_report", mission_report(status, mission_id=77))
    first, second, end = (record["id"] for record in edge.get("/mission_report/"))
    wrong = (409, ["mission_status_id"])
    assert correct(edge, first, mission_report(3, mission_id=77)) == wrong
    assert correct(edge, second, mission_report(4, mission_id=77)) == wrong
    windy = mission_report(2, mission_id=77, message="windy")
    assert correct(edge, first, windy) == (200, [])
    assert correct(edge, end, mission_report(4, mission_id=77, message="wind")) == (200, [])
    assert forwarded(edge) == [2, 2, 4]


@pytest.mark.thorough
def test_the_last_report_on_an_unknown_mission_may_be_corrected_to_its_end(edge: Edge) -> None:
    edge.report("mission_report", mission_report(2, mission_id=77))
    edge.report("mission_report", mission_report(2, mission_id=78))
    record = edge.get("/mission_report/")[0]["id"]
    assert correct(edge, record, mission_report(3, mission_id=77)) == (200, [])
    assert forwarded(edge) == [3, 2]


def test_an_idempotency_key_is_for_one_request(edge: Edge) -> None:
    item = accepted(edge)
    report = mission_report(2, 2, work_id=item["id"])
    assert edge.report("mission_report", report, "one").status_code == 201
    other = report | {"work_id": 500}
    assert edge.report("mission_report", other, "one").status_code == 422
    records = [{"mission_report": each, "idempotency_key": "one"} for each in (report, other)]
    answer = edge.post("/telemetry/", {"records": records}, "broker")
    assert [one["status"] for one in (answer.json or {})["records"]] == [201, 422]
    assert forwarded(edge) == [2]


STEPS = (
    "store.rows.work.change_commands",
    "store.rows.work.change",
    "store.rows.vehicle_holds.place",
    "store.rows.telemetry.add",
    "outbox.queue.enqueue",
    "store.rows.work.note_end",
    "store.rows.idempotency.add",
)


def test_a_report_that_breaks_off_at_any_step_has_changed_nothing(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    item = accepted(edge)
    last = mission_report(4, 3, 4, 5, work_id=item["id"])

    def break_off(*_: Any, **__: Any) -> None:
        raise RuntimeError("broken off")

    for step in STEPS:
        with monkeypatch.context() as patched:
            patched.setattr(f"edge_server.{step}", break_off)
            assert edge.report("mission_report", last, "end").status_code == 500, step
        assert (status_of(edge, 1), forwarded(edge)) == ("NOT_STARTED", [])
        assert edge.get("/vehicles/1")["held"] is None
    for _ in range(2):
        assert edge.report("mission_report", last, "end").status_code == 201
    assert (status_of(edge, 1), forwarded(edge)) == ("FAILED", [4])
    assert edge.get("/vehicles/1")["held"] is not None
