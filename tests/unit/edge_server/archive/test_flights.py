"""When a flight begins and ends, and which reports belong to it."""

import json
from datetime import UTC, datetime

import pytest

from tests.unit.edge_server.archive.flown import (
    FAILED,
    FINISHED,
    RUNNING,
    arm,
    begin,
    points,
    report,
    send,
)
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan, telemetry


def test_repeated_reports_make_no_second_flight(edge: Edge) -> None:
    begin(edge)
    for status in (RUNNING, FINISHED, FINISHED):
        edge.clock.pass_s(10.0)
        report(edge, status, key=f"status-{status}")
    (flight,) = edge.get("/flights/")
    assert flight["ended_at"] == "2026-11-21T12:00:20Z"


def test_a_repeated_report_of_an_unknown_mission_makes_no_second_flight(edge: Edge) -> None:
    for status in (RUNNING, FINISHED, FINISHED):
        edge.clock.pass_s(100.0)
        report(edge, status, mission_id=77)
    edge.clock.pass_s(100.0)
    report(edge, RUNNING, mission_id=77)  # Without its plan: flown again
    assert [one["ended_at"] for one in edge.get("/flights/")] == ["2026-11-21T12:03:20Z", None]


def test_the_end_of_a_mission_may_be_all_that_arrives(edge: Edge) -> None:
    edge.post_plan(plan(mission()))
    edge.accept()
    report(edge, FINISHED)
    (flight,) = edge.get("/flights/")
    assert flight["started_at"] == flight["ended_at"]


def test_a_mission_that_failed_before_takeoff_is_no_flight(edge: Edge) -> None:
    edge.post_plan(plan(mission()))
    edge.accept()
    report(edge, FAILED)
    assert edge.get("/flights/") == []


def test_a_point_that_arrives_late_is_in_the_track_of_its_flight(edge: Edge) -> None:
    begin(edge)
    edge.clock.pass_s(60.0)
    report(edge, FINISHED)
    edge.clock.pass_s(3600.0)
    send(edge, "state_vector", recorded_at="2026-11-21T12:00:30Z")
    send(edge, "state_vector", recorded_at="2026-11-21T12:30:00Z")
    assert points(edge) == 1


def test_the_track_ends_with_the_vehicle_that_is_parked(edge: Edge) -> None:
    arm(edge, armed=True)
    begin(edge)
    edge.clock.pass_s(60.0)
    report(edge, FINISHED)
    arm(edge, armed=False)
    for second in range(1, 6):
        edge.clock.pass_s(2.0)
        send(edge, "state_vector", sequence_number=second)
    assert points(edge) == 0


def test_the_track_goes_on_while_a_vehicle_returns_after_its_mission_has_failed(edge: Edge) -> None:
    arm(edge, armed=True)
    begin(edge)
    edge.clock.pass_s(60.0)
    report(edge, FAILED)
    for second in range(1, 6):
        edge.clock.pass_s(2.0)
        send(edge, "state_vector", sequence_number=second)
    arm(edge, armed=False)
    edge.clock.pass_s(2.0)
    send(edge, "state_vector", sequence_number=6)
    assert points(edge) == 5


def test_the_way_back_is_in_the_track_also_if_it_arrives_after_the_disarming(edge: Edge) -> None:
    """State vectors wait behind an update of their vehicle when the link has been away."""
    arm(edge, armed=True)
    begin(edge)
    edge.clock.pass_s(60.0)
    report(edge, FAILED)
    edge.clock.pass_s(20.0)
    arm(edge, armed=False)
    edge.clock.pass_s(30.0)
    for number, second in enumerate((5, 15, 25)):
        at = f"2026-11-21T12:01:{second:02}Z"
        send(edge, "state_vector", sequence_number=number, recorded_at=at)
    assert points(edge) == 2


def test_a_vehicle_flown_by_hand_has_a_flight_from_arming_to_disarming(edge: Edge) -> None:
    arm(edge, armed=True)
    edge.clock.pass_s(30.0)
    send(edge, "state_vector")
    arm(edge, armed=False)
    (flight,) = edge.get("/flights/")
    assert (flight["mission_id"], flight["ended_at"]) == (None, "2026-11-21T12:00:30Z")
    assert points(edge) == 1


def test_a_mission_has_one_flight_also_after_a_landing_in_between(edge: Edge) -> None:
    for armed in (False, True):
        arm(edge, armed=armed)
    begin(edge)
    for armed in (False, True):
        edge.clock.pass_s(20.0)
        arm(edge, armed=armed)
    edge.clock.pass_s(20.0)
    report(edge, FINISHED)
    arm(edge, armed=False)
    (flight,) = edge.get("/flights/")
    assert (flight["mission_id"], flight["ended_at"]) == (1201, "2026-11-21T12:01:00Z")


@pytest.mark.parametrize(
    "recorded_at", [None, "0001-01-01T00:00:00Z", "1970-01-01T00:00:00Z", "9998-12-31T23:59:59Z"]
)
def test_a_time_that_cannot_be_right_is_that_of_the_receipt(
    edge: Edge, recorded_at: str | None
) -> None:
    begin(edge)
    edge.clock.pass_s(7.0)
    for kind in ("state_vector", "pose", "alarm", "image"):
        send(edge, kind, recorded_at=recorded_at)
    report(edge, FINISHED, recorded_at=recorded_at)
    at = "2026-11-21T12:00:07Z"
    assert edge.get("/flights/1")["ended_at"] == at
    assert edge.get("/flights/1")["results"][0]["recorded_at"] == at
    assert edge.get("/flights/1/pictures")[0]["recorded_at"] == at
    assert edge.get("/alarms/history/")[0]["recorded_at"] == at
    assert points(edge) == 1


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_flight_goes_on_though_the_edge_servers_clock_is_set(edge: Edge, step_s: float) -> None:
    """What the broker records has the right time, before the step and behind it."""
    begin(edge)
    edge.clock.pass_s(60.0)
    edge.clock.pass_s(step_s)
    for second in (1, 2):
        at = f"2026-11-21T12:01:0{second}Z"
        for kind in ("state_vector", "alarm", "image"):
            send(edge, kind, recorded_at=at, sequence_number=second)
    report(edge, FINISHED, recorded_at="2026-11-21T12:01:30Z")
    send(edge, "image", recorded_at="2026-11-21T12:01:02Z", sequence_number=3, name="late.jpeg")
    (flight,) = edge.get("/flights/")
    assert (flight["started_at"], flight["ended_at"]) == (
        "2026-11-21T12:00:00Z",
        "2026-11-21T12:01:30Z",
    )
    assert len(edge.get("/flights/1/pictures")) == 3
    assert points(edge) == 2
    assert {one["recorded_at"][-3:] for one in edge.get("/alarms/history/")} == {"01Z", "02Z"}


@pytest.mark.first_case
@pytest.mark.parametrize("ahead_s", [70, 300, 500])
def test_a_brokers_clock_that_is_ahead_all_the_time_is_replaced_all_the_time(
    edge: Edge, ahead_s: int
) -> None:
    """Two flights of a minute each, with a minute and a half between them."""

    def sent(kind: str, **fields: object) -> None:
        at = edge.clock() + ahead_s
        send(edge, kind, recorded_at=datetime.fromtimestamp(at, UTC).isoformat(), **fields)

    for mission_id, begins_at, ends_at in (
        (1201, "12:00:00Z", "12:01:00Z"),
        (1202, "12:02:30Z", "12:03:30Z"),
    ):
        begin(edge, mission_id)
        for second in range(60):
            edge.clock.pass_s(1.0)
            sent("state_vector", sequence_number=1 + second + 100 * mission_id)
        at = datetime.fromtimestamp(edge.clock() + ahead_s, UTC).isoformat()
        report(edge, FINISHED, mission_id=mission_id, recorded_at=at)
        (flight,) = [one for one in edge.get("/flights/") if one["mission_id"] == mission_id]
        assert flight["started_at"].endswith(begins_at)
        assert flight["ended_at"].endswith(ends_at)
        assert points(edge, flight["id"]) == 60
        edge.clock.pass_s(90.0)


@pytest.mark.parametrize("recorded_at", ["2026-11-21T11:59:30Z", "2026-11-21T12:30:00Z"])
def test_a_time_in_the_future_that_continues_no_flight_is_that_of_the_receipt(
    edge: Edge, recorded_at: str
) -> None:
    begin(edge)
    edge.clock.pass_s(-3600.0)
    send(edge, "alarm", recorded_at=recorded_at)
    (alarm,) = edge.get("/alarms/history/")
    assert alarm["recorded_at"] == "2026-11-21T11:00:00Z"


def test_a_refused_report_is_not_archived(edge: Edge) -> None:
    begin(edge)
    for latitude in ("NaN", "Infinity", "null"):
        body = json.dumps(telemetry("state_vector")).replace("40.4434", latitude)
        options = {"data": body, "content_type": "application/json"}
        assert edge.ask("POST", "/state_vector/", "broker", **options).status_code == 422
    assert points(edge) == 0
