"""Missions that wait can be cancelled and changed, and those of a lost broker can be closed."""

from typing import Any

import pytest

from afarcloud.numbers import INT32_MAX
from edge_server.api.routes.planning.surveys import EXAMPLE
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.api.routes.planning.test_plan_files import FILE
from tests.unit.edge_server.conftest import NOON, Edge
from tests.unit.edge_server.documents import (
    event,
    mission,
    mission_report,
    plan,
    speed_event,
    telemetry,
)

WHY = {"reason": "the laptop with the broker fell into the pond"}
HOURS_S = 3600.0


def flying(edge: Edge, *missions: dict[str, Any]) -> int:
    """A plan whose missions the broker has accepted and flies."""
    identifier = int((edge.post_plan(plan(*missions)).json or {})["id"])
    edge.accept()
    return identifier


def close(edge: Edge, identifier: int, role: str = "operator", **more: Any) -> Any:
    return edge.post(f"/plans/{identifier}/close", WHY | more, role)


def statuses(edge: Edge, identifier: int) -> list[str]:
    return [one["mission_status_name"] for one in edge.get(f"/plans/{identifier}")["missions"]]


def test_a_mission_behind_a_running_one_is_cancelled(edge: Edge) -> None:
    flying(edge, mission(1))
    edge.post_plan(plan(mission(2)))
    (pulled,) = (item for item in edge.work() if item["state"] == "queued")
    assert edge.ask("DELETE", "/plans/2", "operator").status_code == 204
    assert edge.acknowledge(pulled["id"], "accepted").status_code == 404


def test_a_mission_behind_a_running_one_is_changed(edge: Edge) -> None:
    flying(edge, mission(1))
    edge.post_plan(plan(mission(2)))
    (pulled,) = (item for item in edge.work() if item["state"] == "queued")
    slower = plan(mission(2, maximum_speed=2.0))
    assert edge.ask("PUT", "/plans/2", "operator", json=slower).status_code == 200
    assert edge.acknowledge(pulled["id"], "accepted").status_code == 404
    assert edge.work()[-1]["mission"]["maximum_speed"] == 2.0


def test_a_mission_of_a_broker_that_does_not_come_back_is_closed(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    edge.report("mission_report", mission_report(2, 3, 2, mission_id=1))
    edge.clock.pass_s(300.0)
    answer = close(edge, identifier)
    assert answer.status_code == 200
    (shown,) = answer.json["missions"]
    assert (shown["mission_status_name"], shown["dispatch_state"]) == ("ABORTED", "closed")
    assert shown["message"] == f"closed by an operator: {WHY['reason']}"
    assert [one["command_status_name"] for one in shown["command_array"]] == [
        "FINISHED",
        "ABORTED",
        "ABORTED",
    ]
    assert edge.get("/mission_report/")[-1]["mission_status_id"] == 5
    assert edge.work() == []
    late = edge.report("mission_report", mission_report(3, 3, 3, 3, mission_id=1))
    assert late.status_code == 409


@pytest.mark.thorough
def test_the_end_after_the_largest_sequence_number_is_valid(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    last = mission_report(2, 2, mission_id=1, sequence_number=INT32_MAX)
    assert edge.report("mission_report", last).status_code == 201
    edge.clock.pass_s(300.0)
    assert close(edge, identifier).status_code == 200
    (_, end) = edge.get("/mission_report/")
    assert (end["mission_status_id"], end["sequence_number"]) == (5, INT32_MAX)


def test_a_broker_with_recent_requests_keeps_its_mission(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(290.0)
    edge.register(1)
    edge.clock.pass_s(10.0)
    answer = close(edge, identifier)
    assert answer.status_code == 409
    assert "its last request was 10 s ago" in answer.json["message"]
    assert statuses(edge, identifier) == ["NOT_STARTED"]


POLL = ("GET", "/broker/commands?after=0", None)
REPORTS = (
    ("POST", "/mission_report/", mission_report(2, 2, mission_id=1)),
    ("POST", "/state_vector/", telemetry("state_vector")),
    ("POST", "/telemetry/", {"records": [{"pose": telemetry("pose")}]}),
    ("POST", "/broker/commands/1/ack", {"status": "accepted"}),
)


@pytest.mark.first_case
@pytest.mark.parametrize(("method", "path", "body"), [POLL, *REPORTS])
def test_every_request_of_the_broker_keeps_its_mission(
    edge: Edge, method: str, path: str, body: dict[str, Any] | None
) -> None:
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(299.0)
    answer = edge.ask(method, path, "broker", **({} if body is None else {"json": body}))
    assert answer.status_code in {200, 201}
    edge.clock.pass_s(299.0)
    refused = close(edge, identifier)
    assert refused.status_code == 409
    assert "its last request was 299 s ago" in refused.json["message"]
    edge.clock.pass_s(1.0)
    assert close(edge, identifier).status_code == 200


@pytest.mark.parametrize(("answer", "back_s"), [("refused", 0.0), ("done", 0.0), ("done", 60.0)])
def test_a_mission_that_its_connected_broker_has_lost_is_closed_after_an_abort(
    edge: Edge, answer: str, back_s: float
) -> None:
    """It updates the vehicle, but the end of the mission was lost with its disk.

    The clock may be set back between abort and answer.
    """
    identifier = flying(edge, mission(1))
    assert close(edge, identifier).status_code == 409
    edge.clock.pass_s(1.0)
    assert edge.post("/events/", event(), "operator").status_code == 201
    edge.clock.now -= back_s
    assert close(edge, identifier).status_code == 409
    assert edge.acknowledge(edge.work()[0]["id"], "accepted").status_code == 200
    assert close(edge, identifier).status_code == 409
    assert edge.acknowledge(2, answer, "no active mission").status_code == 200
    edge.ask("PUT", "/vehicles/1", "broker", json={"link_state": "connected", "mission_id": 1})
    assert close(edge, identifier).status_code == 409
    edge.ask("PUT", "/vehicles/1", "broker", json={"link_state": "connected", "mission_id": None})
    assert close(edge, identifier).status_code == 200
    assert statuses(edge, identifier) == ["ABORTED"]


def test_an_abort_before_the_acceptance_or_a_new_speed_shows_no_loss(edge: Edge) -> None:
    flying(edge, mission(1))
    assert edge.post("/events/", event(), "operator").status_code == 201
    assert edge.acknowledge(edge.work()[0]["id"], "refused").status_code == 200
    edge.report("mission_report", mission_report(5, 5, 5, 5, mission_id=1))
    edge.clock.pass_s(1.0)
    identifier = flying(edge, mission(2))
    assert edge.post("/events/", speed_event(), "operator").status_code == 201
    assert edge.acknowledge(edge.work()[0]["id"], "done").status_code == 200
    assert close(edge, identifier).status_code == 409


def test_a_request_about_another_vehicle_does_not_keep_a_mission(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(300.0)
    assert edge.report("pose", telemetry("pose", vehicle_id=2)).status_code == 201
    assert close(edge, identifier).status_code == 200


def test_another_broker_that_polls_does_not_keep_a_mission(edge: Edge) -> None:
    made = edge.post("/keys/", {"name": "south", "role": "broker"}, "admin").json or {}
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(300.0)
    headers = {"Authorization": f"Bearer {made['key']}"}
    assert edge.client.get("/broker/commands?after=0", headers=headers).status_code == 200
    assert close(edge, identifier).status_code == 200


def test_a_contact_in_the_future_is_ignored(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(-HOURS_S)
    assert close(edge, identifier).status_code == 200


def test_of_a_plan_for_several_vehicles_one_is_closed(edge: Edge) -> None:
    identifier = flying(edge, mission(1, 1), mission(2, 2))
    edge.clock.pass_s(400.0)
    edge.register(2)
    assert close(edge, identifier).status_code == 409
    assert statuses(edge, identifier) == ["NOT_STARTED", "NOT_STARTED"]
    assert close(edge, identifier, vehicle_id=1).status_code == 200
    assert statuses(edge, identifier) == ["ABORTED", "NOT_STARTED"]


def test_closing_twice_is_closing_once_and_audited(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(400.0)
    first, second = close(edge, identifier), close(edge, identifier)
    assert (second.status_code, second.json) == (200, first.json)
    assert edge.ask("GET", "/audit/", "admin").text.count("plans.close") == 1
    assert len(edge.get("/mission_report/")) == 1


@pytest.mark.thorough
def test_what_waits_in_the_queue_is_not_closed(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    edge.clock.pass_s(400.0)
    assert close(edge, 1).status_code == 200
    assert statuses(edge, 1) == ["NOT_STARTED"]


@pytest.mark.first_case
@pytest.mark.parametrize("body", [{}, {"reason": ""}, {"reason": "x", "vehicle_id": 0}])
def test_a_close_needs_a_reason(edge: Edge, body: dict[str, Any]) -> None:
    flying(edge, mission(1))
    assert edge.post("/plans/1/close", body, "operator").status_code == 422


@pytest.mark.first_case
@BOTH_ENGINES
def test_two_dispatched_surveys_within_a_second_do_not_collide(edge: Edge) -> None:
    short = EXAMPLE | {"dispatch": True, "most_commands": 700, "endurance": 3600}
    first = edge.post("/surveys/", short, "operator")
    second = edge.post("/surveys/", short, "operator")
    assert (first.status_code, second.status_code) == (201, 201)
    ids = [item["mission"]["mission_id"] for item in edge.work()]
    assert len(set(ids)) == len(ids) >= 2


@pytest.mark.thorough
def test_held_surveys_do_not_collide_when_they_are_dispatched(edge: Edge) -> None:
    short = EXAMPLE | {"most_commands": 700, "endurance": 3600}
    for _ in range(2):
        (stored,) = (edge.post("/surveys/", short, "operator").json or {})["plans"]
        answer = edge.ask("POST", f"/plans/{stored['id']}/dispatch", "operator")
        assert answer.status_code == 200


def test_two_imported_files_do_not_collide(edge: Edge) -> None:
    for _ in range(2):
        answer = edge.post("/plans/import?vehicle_id=1&dispatch=true", FILE, "operator")
        assert answer.status_code == 201


def test_a_survey_that_names_its_ids_keeps_them(edge: Edge) -> None:
    named = EXAMPLE | {"dispatch": True, "most_commands": 700, "endurance": 3600}
    named |= {"first_mission_id": 7}
    assert edge.post("/surveys/", named, "operator").status_code == 201
    assert edge.post("/surveys/", named, "operator").status_code == 409


@pytest.mark.first_case
@pytest.mark.parametrize("ahead_s", [120.0, 2 * HOURS_S, 365 * 24 * HOURS_S])
def test_a_plan_that_came_while_the_clock_was_ahead_lives_no_longer(
    edge: Edge, ahead_s: float
) -> None:
    edge.clock.pass_s(ahead_s)
    edge.post_plan(plan(mission(1)))
    edge.clock.now = NOON + 60.0
    assert len(edge.work()) == 1  # Whoever looks next notices
    assert edge.get("/plans/1")["expires_at"] == "2026-11-22T00:01:00Z"
    edge.clock.pass_s(12 * HOURS_S - 1.0)
    assert len(edge.work()) == 1
    edge.clock.pass_s(2.0)
    assert edge.work() == []
    assert statuses(edge, 1) == ["ABORTED"]


def test_an_expiry_of_the_plan_holds_whatever_the_clock_was(edge: Edge) -> None:
    edge.clock.pass_s(2 * HOURS_S)
    edge.post_plan(plan(mission(1), expires_at="2026-11-21T16:00:00Z"))
    edge.clock.now = NOON
    assert len(edge.work()) == 1
    assert edge.get("/plans/1")["expires_at"] == "2026-11-21T16:00:00Z"


def test_a_held_plan_from_the_future_lives_no_longer_either(edge: Edge) -> None:
    edge.clock.pass_s(5 * HOURS_S)
    edge.post_plan(plan(mission(1), dispatch=False))
    edge.clock.now = NOON
    edge.get("/plans/1")
    edge.clock.pass_s(edge.config.held_plan_lifetime_s + 1.0)
    assert edge.ask("POST", "/plans/1/dispatch", "operator").status_code == 409
