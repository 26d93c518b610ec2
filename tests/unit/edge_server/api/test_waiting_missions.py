"""Missions that wait can be cancelled and changed, and those of a lost broker can be closed."""

from typing import Any

import pytest

from afarcloud.numbers import INT32_MAX
from edge_server.api.surveys import EXAMPLE
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.api.test_plan_files import FILE
from tests.unit.edge_server.conftest import NOON, Edge
from tests.unit.edge_server.documents import mission, mission_report, plan

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


def test_the_end_behind_the_largest_sequence_number_is_one_that_the_cloud_takes(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    last = mission_report(2, 2, mission_id=1, sequence_number=INT32_MAX)
    assert edge.report("mission_report", last).status_code == 201
    edge.clock.pass_s(300.0)
    assert close(edge, identifier).status_code == 200
    (_, told) = edge.get("/mission_report/")
    assert (told["mission_status_id"], told["sequence_number"]) == (5, INT32_MAX)


def test_a_broker_that_speaks_keeps_its_mission(edge: Edge) -> None:
    identifier = flying(edge, mission(1))
    edge.clock.pass_s(290.0)
    edge.register(1)
    edge.clock.pass_s(10.0)
    answer = close(edge, identifier)
    assert answer.status_code == 409
    assert "said something 10 s ago" in answer.json["message"]
    assert statuses(edge, identifier) == ["NOT_STARTED"]


def test_a_last_word_from_the_future_is_none(edge: Edge) -> None:
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


def test_what_waits_in_the_queue_is_not_closed(edge: Edge) -> None:
    edge.post_plan(plan(mission(1)))
    edge.clock.pass_s(400.0)
    assert close(edge, 1).status_code == 200
    assert statuses(edge, 1) == ["NOT_STARTED"]


@pytest.mark.parametrize("body", [{}, {"reason": ""}, {"reason": "x", "vehicle_id": 0}])
def test_a_closing_says_why(edge: Edge, body: dict[str, Any]) -> None:
    flying(edge, mission(1))
    assert edge.post("/plans/1/close", body, "operator").status_code == 422


@BOTH_ENGINES
def test_two_dispatched_surveys_within_a_second_do_not_collide(edge: Edge) -> None:
    short = EXAMPLE | {"dispatch": True, "most_commands": 700, "endurance": 3600}
    first = edge.post("/surveys/", short, "operator")
    second = edge.post("/surveys/", short, "operator")
    assert (first.status_code, second.status_code) == (201, 201)
    ids = [item["mission"]["mission_id"] for item in edge.work()]
    assert len(set(ids)) == len(ids) >= 2


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


def test_an_expiry_that_the_plan_names_holds_whatever_the_clock_said(edge: Edge) -> None:
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
    edge.clock.pass_s(12 * HOURS_S + 1.0)
    assert edge.ask("POST", "/plans/1/dispatch", "operator").status_code == 409
