"""Plans that are held until they are dispatched."""

from typing import Any

import pytest

from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan

pytestmark = BOTH_ENGINES


def hold(edge: Edge, **changes: Any) -> dict[str, Any]:
    answer = edge.post_plan(plan(**{"dispatch": False, **changes}))
    assert answer.status_code == 201, answer.text
    held: dict[str, Any] = answer.json or {}
    return held


def dispatch(edge: Edge, reference: object) -> Any:
    return edge.ask("POST", f"/plans/{reference}/dispatch", "operator")


@pytest.mark.first_case
def test_a_held_plan_is_shown_and_no_work_for_the_broker(edge: Edge) -> None:
    held = hold(edge)
    assert edge.work() == []
    assert [m["dispatch_state"] for m in held["missions"]] == ["held"]
    assert edge.get(f"/plans/{held['id']}") == held


@pytest.mark.first_case
@pytest.mark.parametrize("name", ["id", "plan_id"])
def test_a_dispatched_plan_is_work_even_for_a_broker_that_has_polled_since(
    edge: Edge, name: str
) -> None:
    held = hold(edge)
    edge.post_plan(plan(mission(mission_id=77, vehicle_id=2)))
    cursor = edge.work()[-1]["id"]
    answer = dispatch(edge, held[name])
    assert answer.status_code == 200
    assert [m["dispatch_state"] for m in answer.json["missions"]] == ["queued"]
    assert answer.json["dispatch"] is True
    (given,) = edge.work(after=cursor)
    assert given["mission"]["mission_id"] == held["missions"][0]["mission_id"]
    assert given["plan_id"] == held["plan_id"]


@pytest.mark.first_case
def test_dispatching_twice_is_once(edge: Edge) -> None:
    held = hold(edge)
    assert dispatch(edge, held["id"]).json == dispatch(edge, held["id"]).json
    assert len(edge.work()) == 1


@pytest.mark.first_case
def test_a_held_plan_takes_no_place_in_the_queue(edge: Edge) -> None:
    for number in range(edge.config.queue_limit + 1):
        hold(edge, missions=[mission(mission_id=number)])
    assert edge.post_plan(plan(mission(mission_id=99))).status_code == 201


@pytest.mark.first_case
def test_at_dispatch_the_queue_counts(edge: Edge) -> None:
    held = hold(edge)
    assert edge.post_plan(plan()).status_code == 201
    answer = dispatch(edge, held["id"])
    assert answer.status_code == 409
    assert list(answer.json["detail"]["json"]) == ["missions.0.mission_id"]
    assert edge.get(f"/plans/{held['id']}") == held


@pytest.mark.first_case
def test_at_dispatch_the_vehicle_must_still_be_there(edge: Edge) -> None:
    held = hold(edge)
    assert edge.ask("DELETE", "/vehicles/1", "admin").status_code == 204
    answer = dispatch(edge, held["id"])
    assert answer.status_code == 422
    assert list(answer.json["detail"]["json"]) == ["missions.0.vehicle_id"]
    assert edge.get(f"/plans/{held['id']}") == held


def test_the_lifetime_of_a_held_plan_begins_anew_with_its_dispatch(edge: Edge) -> None:
    """Plans are drawn in the evening, and their next batteries flown days later."""
    number = hold(edge)["id"]
    edge.clock.pass_s(2 * edge.config.plan_lifetime_s)
    assert dispatch(edge, number).status_code == 200
    edge.clock.pass_s(edge.config.plan_lifetime_s - 1.0)
    assert len(edge.work()) == 1
    edge.clock.pass_s(2.0)
    assert edge.work() == []


def test_a_held_plan_ends_after_a_lifetime_of_its_own_and_at_the_time_that_it_names(
    edge: Edge,
) -> None:
    hold(edge)
    hold(edge, expires_at="2026-11-21T12:01:00Z")
    edge.clock.pass_s(61.0)
    statuses = {one["id"]: one["plan_status_name"] for one in edge.get("/plans/")}
    assert sorted(statuses.values()) == ["ABORTED", "NOT_STARTED"]
    edge.clock.pass_s(edge.config.held_plan_lifetime_s)
    assert {one["plan_status_name"] for one in edge.get("/plans/")} == {"ABORTED"}


@pytest.mark.first_case
def test_an_expired_plan_is_not_dispatched(edge: Edge) -> None:
    held = hold(edge)
    edge.clock.pass_s(edge.config.held_plan_lifetime_s + 1.0)
    answer = dispatch(edge, held["id"])
    assert answer.status_code == 409
    assert "expired" in answer.json["message"]
    assert edge.work() == []
    assert edge.get(f"/plans/{held['id']}")["plan_status_name"] == "ABORTED"


@pytest.mark.first_case
def test_a_held_plan_can_be_replaced_by_one_to_be_flown(edge: Edge) -> None:
    held = hold(edge)
    answer = edge.ask("PUT", f"/plans/{held['id']}", "operator", json=plan())
    assert answer.status_code == 200
    assert len(edge.work()) == 1


@pytest.mark.first_case
def test_a_farmer_may_draft_and_not_fly(edge: Edge) -> None:
    refused = edge.post("/plans/", plan(), "farmer")
    assert refused.status_code == 403
    assert "dispatch" in (refused.json or {})["message"]
    assert edge.post("/plans/", plan(dispatch=False), "farmer").status_code == 201
    assert edge.work() == []


@pytest.mark.first_case
def test_a_plan_that_is_not_there_cannot_be_dispatched(edge: Edge) -> None:
    assert dispatch(edge, 5).status_code == 404
