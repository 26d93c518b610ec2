"""Endpoints of the broker: work in order, at once, acknowledged, never stale."""

import threading
import time

import pytest

from edge_server.services.context import WAITING_LIMIT
from edge_server.services.errors import TooMuchError
from edge_server.services.fleet import broker_work
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, mission, mission_report, plan

pytestmark = BOTH_ENGINES


@pytest.mark.first_case
def test_work_is_handed_out_in_the_order_of_posting(edge: Edge) -> None:
    for number in (3, 1, 2):
        edge.post_plan(plan(mission(number)))
    assert [item["mission"]["mission_id"] for item in edge.work()] == [3, 1, 2]


@pytest.mark.first_case
def test_a_mission_comes_with_the_fence_and_the_rally_points_of_its_plan(edge: Edge) -> None:
    corners = [[40.44, -3.74], [40.45, -3.74], [40.45, -3.73], [40.44, -3.73]]
    fence = {"inclusion": [corners], "exclusion": [], "max_altitude": 60.0}
    point = {"latitude": 40.445, "longitude": -3.735, "altitude": 20.0}
    edge.post_plan(plan(mission(1), geofence=fence, rally_points=[point]))
    edge.post_plan(plan(mission(2)))
    assert [item["geofence"] for item in edge.work()] == [fence, None]
    assert [item["rally_points"] for item in edge.work()] == [[point], []]


@pytest.mark.first_case
def test_a_cursor_gives_later_work(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    first = edge.get("/broker/commands?after=0", "broker")
    edge.post_plan(plan(mission(2)))
    second = edge.get(f"/broker/commands?after={first['cursor']}", "broker")
    assert [item["mission"]["mission_id"] for item in second["commands"]] == [2]
    third = edge.get(f"/broker/commands?after={second['cursor']}", "broker")
    assert (third["cursor"], third["commands"]) == (second["cursor"], [])


def test_work_names_the_time_by_which_it_expires(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.clock.pass_s(5.5)
    answer = edge.get("/broker/commands?after=0", "broker")
    assert answer["time"] == "2026-11-21T12:00:05.500000Z"


@pytest.mark.first_case
def test_a_restarted_broker_gets_all_unfinished_work_again(edge: Edge) -> None:
    for number in (1, 2, 3):
        edge.post_plan(plan(mission(number)))
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    edge.report("mission_report", mission_report(2, 2, mission_id=1))
    edge.acknowledge(edge.work()[1]["id"], "accepted")
    edge.report("mission_report", mission_report(3, 3, 3, 3, mission_id=2))
    again = edge.work()
    assert [(item["mission"]["mission_id"], item["state"]) for item in again] == [
        (1, "accepted"),
        (3, "queued"),
    ]
    assert again[0]["report"]["mission_status_id"] == 2
    assert again[1]["report"] is None


@pytest.mark.first_case
def test_a_cursor_from_a_lost_database_begins_again(edge: Edge) -> None:
    edge.post_plan(plan())
    answer = edge.get("/broker/commands?after=999", "broker")
    assert len(answer["commands"]) == 1
    assert answer["cursor"] == answer["commands"][0]["id"]


@pytest.mark.first_case
@pytest.mark.parametrize("status", ["accepted", "refused"])
def test_acknowledging_twice_changes_nothing(edge: Edge, status: str) -> None:
    edge.post_plan(plan())
    (item,) = edge.work()
    first = edge.acknowledge(item["id"], status, "why")
    shown = edge.get("/plans/")
    second = edge.acknowledge(item["id"], status, "why")
    assert (first.status_code, second.status_code) == (200, 200)
    assert edge.get("/plans/") == shown


@pytest.mark.first_case
def test_a_refused_mission_fails_with_the_reason_and_is_reported(edge: Edge) -> None:
    edge.post_plan(plan(mission(1), mission(2, 2)))
    edge.acknowledge(edge.work()[0]["id"], "refused", "no gimbal")
    (shown,) = edge.get("/plans/")
    refused, waiting = shown["missions"]
    assert (refused["mission_status_name"], refused["message"]) == ("FAILED", "no gimbal")
    assert waiting["mission_status_name"] == "NOT_STARTED"
    assert [item["mission"]["mission_id"] for item in edge.work()] == [2]
    (report,) = edge.get("/mission_report/")
    assert (report["mission_id"], report["mission_status_id"]) == (1, 4)


@pytest.mark.first_case
def test_a_mission_is_not_done_by_acknowledgement(edge: Edge) -> None:
    edge.post_plan(plan())
    (item,) = edge.work()
    assert edge.acknowledge(item["id"], "done").status_code == 409


@pytest.mark.first_case
def test_what_has_ended_is_not_accepted(edge: Edge) -> None:
    edge.post_plan(plan())
    (item,) = edge.work()
    edge.accept()
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    assert edge.acknowledge(item["id"], "accepted").status_code == 409
    assert edge.acknowledge(item["id"], "refused").status_code == 409


@pytest.mark.first_case
def test_a_report_of_changes_alone_is_handed_out_with_all_commands(edge: Edge) -> None:
    """A restarted broker continues from the earlier reports."""
    edge.post_plan(plan())
    edge.accept()
    edge.report("mission_report", mission_report(2, 3, 2, 1))
    later = mission_report(2, 3, 2, 1)
    later["command_report_array"] = [{"command_id": 2, "command_status_id": 3}]
    edge.report("mission_report", later | {"sequence_number": 9})
    (item,) = edge.work()
    reports = item["report"]["command_report_array"]
    assert [(one["command_id"], one["command_status_id"]) for one in reports] == [
        (1, 3),
        (2, 3),
        (3, 1),
    ]
    assert item["report"]["sequence_number"] == 9


@pytest.mark.first_case
def test_unknown_work_is_not_found(edge: Edge) -> None:
    assert edge.acknowledge(1, "accepted").status_code == 404


@pytest.mark.first_case
def test_an_acknowledgement_of_another_kind_is_refused(edge: Edge) -> None:
    edge.post_plan(plan())
    answer = edge.acknowledge(edge.work()[0]["id"], "maybe")
    assert answer.status_code == 422
    assert "status" in (answer.json or {})["detail"]["json"]


@pytest.mark.first_case
def test_a_report_reaches_only_the_missions_own_vehicle(edge: Edge) -> None:
    edge.post_plan(plan(mission(1, 1)))
    edge.report("mission_report", mission_report(3, 3, 3, 3, mission_id=1, vehicle_id=2))
    assert len(edge.work()) == 1


@pytest.mark.first_case
def test_a_state_vector_request_is_work_for_ten_seconds(edge: Edge) -> None:
    answer = edge.post("/latest_state_vector/", {"sequence_number": 3}, "cloud")
    assert answer.status_code == 202
    (item,) = edge.work()
    assert (item["kind"], item["vehicle_id"], item["sequence_number"]) == (
        "latest_state_vector",
        None,
        3,
    )
    assert edge.count("telemetry") == 0
    edge.clock.pass_s(10.1)
    assert edge.work() == []


@pytest.mark.first_case
@pytest.mark.parametrize("status", ["done", "refused"])
def test_an_answered_request_is_over(edge: Edge, status: str) -> None:
    edge.post("/latest_state_vector", {"sequence_number": 3, "vehicle_id": 1}, "farmer")
    (item,) = edge.work()
    assert item["vehicle_id"] == 1
    for _ in range(2):
        assert edge.acknowledge(item["id"], status).status_code == 200
    assert edge.work() == []


@pytest.mark.first_case
def test_an_accepted_request_expires_all_the_same(edge: Edge) -> None:
    edge.post("/latest_state_vector", {"sequence_number": 3}, "farmer")
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    edge.clock.pass_s(10.1)
    assert edge.work() == []


@pytest.mark.first_case
def test_a_request_for_an_unknown_vehicle_is_not_found(edge: Edge) -> None:
    body = {"sequence_number": 3, "vehicle_id": 77}
    assert edge.post("/latest_state_vector/", body, "operator").status_code == 404


@pytest.mark.first_case
def test_requests_are_bounded(edge: Edge) -> None:
    for number in range(broker_work.REQUEST_LIMIT):
        body = {"sequence_number": number}
        assert edge.post("/latest_state_vector/", body, "operator").status_code == 202
    answer = edge.post("/latest_state_vector/", {"sequence_number": 99}, "operator")
    assert answer.status_code == 429
    assert answer.headers["Retry-After"] == "1"


@pytest.mark.first_case
def test_a_waiting_broker_is_woken_by_a_plan(edge: Edge) -> None:
    answers = []
    woken = threading.Event()

    def wait_for_work() -> None:
        answers.append(broker_work.poll(edge.context, 0, 25.0, "broker/broker"))
        woken.set()

    thread = threading.Thread(target=wait_for_work)
    thread.start()
    edge.post_plan(plan())
    assert woken.wait(20.0)
    thread.join()
    assert len(answers[0]["commands"]) == 1


@pytest.mark.first_case
def test_a_wait_ends_when_the_server_stops(edge: Edge) -> None:
    thread = threading.Thread(
        target=broker_work.poll, args=(edge.context, 0, 25.0, "broker/broker")
    )
    thread.start()
    edge.context.work_signal.close()
    thread.join(20.0)
    assert not thread.is_alive()


@pytest.mark.first_case
def test_a_wait_without_work_ends_in_time(edge: Edge) -> None:
    begun = time.monotonic()
    assert edge.get("/broker/commands?wait=0.05", "broker")["commands"] == []
    assert time.monotonic() - begun >= 0.05


@pytest.mark.first_case
def test_only_so_many_may_wait(edge: Edge) -> None:
    for _ in range(WAITING_LIMIT):
        assert edge.context.places_to_wait.acquire(blocking=False)
    with pytest.raises(TooMuchError):
        broker_work.poll(edge.context, 0, 1.0, "broker/broker")
    assert edge.ask("GET", "/broker/commands", "broker").status_code == 429
    edge.context.places_to_wait.release()
    assert edge.work() == []


@pytest.mark.first_case
@pytest.mark.parametrize("query", ["wait=26", "wait=-1", "wait=nan", "wait=inf", "after=x"])
def test_a_bad_poll_is_refused(edge: Edge, query: str) -> None:
    assert edge.ask("GET", f"/broker/commands?{query}", "broker").status_code == 422


def ordered_to_abort(edge: Edge) -> int:
    """Post an abort of a flight, as an operator does; gives its work, which was not handed out."""
    edge.post_plan(plan())
    assert edge.acknowledge(edge.work()[0]["id"], "accepted").status_code == 200
    assert edge.post("/events/", event(), "operator").status_code == 201
    return 2


def event_state(edge: Edge) -> str:
    return str(edge.get("/events/1")["state"])


@pytest.mark.parametrize("status", ["accepted", "done", "refused"])
def test_an_answer_to_work_of_a_lost_database_ends_no_new_order(edge: Edge, status: str) -> None:
    """The broker has kept it for days; the new abort has got the number of the old one."""
    number = ordered_to_abort(edge)
    assert edge.acknowledge(number, status, identity="0" * 32).status_code == 409
    assert event_state(edge) == "queued"
    (handed_out,) = (item for item in edge.work() if item["kind"] == "event")
    assert (handed_out["id"], handed_out["state"]) == (number, "queued")
    assert edge.acknowledge(number, status, identity="0" * 32).status_code == 409
    answer = edge.acknowledge(number, status, identity=handed_out["identity"])
    assert answer.status_code == 200
    assert event_state(edge) == status


@pytest.mark.parametrize("identity", ["01OTHER", "0" * 32])
def test_a_refusal_of_a_mission_of_a_lost_database_ends_no_new_mission(
    edge: Edge, identity: str
) -> None:
    edge.post_plan(plan())
    (item,) = edge.work()
    assert edge.acknowledge(item["id"], "refused", identity=identity).status_code == 409
    assert edge.acknowledge(item["id"], "accepted", identity=item["identity"]).status_code == 200


def test_the_same_event_at_another_time_is_other_work(edge: Edge) -> None:
    ordered_to_abort(edge)
    edge.clock.pass_s(0.001)
    assert edge.post("/events/", event(), "operator").status_code == 201
    first, second = (item["identity"] for item in edge.work() if item["kind"] == "event")
    assert first != second


def test_an_event_keeps_its_identity_when_the_clock_is_set_back(edge: Edge) -> None:
    number = ordered_to_abort(edge)
    identity = edge.work()[0]["identity"]
    edge.clock.now -= 3600.0
    assert edge.work()[0]["identity"] == identity
    assert edge.acknowledge(number, "accepted", identity=identity).status_code == 200


@pytest.mark.first_case
def test_an_older_broker_answers_an_event_that_was_handed_out(edge: Edge, engine_name: str) -> None:
    """It repeats no identity.

    A shared database does not show whether an event was handed out: there it is accepted first.
    """
    number = ordered_to_abort(edge)
    is_shared = engine_name == "postgresql"
    for status in ("done",) if is_shared else ("accepted", "done", "refused"):
        refused = edge.acknowledge(number, status)
        assert refused.status_code == 409
        assert "has not been handed out" in refused.text
    assert event_state(edge) == "queued"
    assert edge.work()[0]["id"] == number
    for status in ("accepted", "done") if is_shared else ("done",):
        assert edge.acknowledge(number, status).status_code == 200
    assert event_state(edge) == "done"
