"""Conditional requests prevent lost updates."""

from typing import Any

import pytest

from edge_server.api.routes.planning.fields import EXAMPLE as FIELD
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan, telemetry


def make(edge: Edge, kind: str) -> tuple[str, Any]:
    """A resource: its path, and a body for PUT."""
    if kind == "plan":
        posted = edge.post_plan(plan()).json or {}
        return f"/plans/{posted['id']}", plan(mission(mission_id=99))
    if kind == "pose":
        posted = edge.report("pose", telemetry("pose")).json or {}
        return f"/pose/{posted['id']}", telemetry("pose", 9)
    if kind == "field":
        posted = edge.ask("POST", "/fields/", "farmer", json=FIELD).json or {}
        return f"/fields/{posted['id']}", {**FIELD, "name": "South field"}
    return "/vehicles/1", {"link_state": "lost"}


def put(edge: Edge, path: str, body: Any, **headers: str) -> Any:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return edge.ask("PUT", path, "admin", json=body, headers=named)


KINDS = pytest.mark.parametrize("kind", ["plan", "field", "pose", "vehicle"])


@pytest.mark.first_case
@KINDS
def test_a_put_with_the_tag_that_was_read_is_taken(edge: Edge, kind: str) -> None:
    path, body = make(edge, kind)
    tag = edge.ask("GET", path, "operator").headers["ETag"]
    assert put(edge, path, body, If_Match=tag).status_code == 200


@pytest.mark.first_case
@KINDS
def test_a_put_with_an_older_tag_changes_nothing(edge: Edge, kind: str) -> None:
    path, body = make(edge, kind)
    tag = edge.ask("GET", path, "operator").headers["ETag"]
    assert put(edge, path, body, If_Match=tag).status_code == 200
    seen = edge.get(path)
    edge.clock.pass_s(1.0)
    assert put(edge, path, body, If_Match=tag).status_code == 412
    assert edge.get(path) == seen


def test_a_condition_that_is_cut_off_changes_nothing(edge: Edge) -> None:
    path, body = make(edge, "plan")
    seen = edge.get(path)
    for cut in ("", '"', '"old', 'W/"', ",", '"old" and more'):
        assert put(edge, path, body, If_Match=cut).status_code == 412, cut
        assert edge.get(path) == seen


@pytest.mark.first_case
@KINDS
def test_any_tag_will_do_for_a_star_and_for_no_condition(edge: Edge, kind: str) -> None:
    path, body = make(edge, kind)
    assert put(edge, path, body, If_Match="*").status_code == 200
    assert put(edge, path, body).status_code == 200


@pytest.mark.parametrize("kind", ["plan", "field"])
def test_a_refused_put_names_the_last_change(edge: Edge, kind: str) -> None:
    path, body = make(edge, kind)
    tag = edge.ask("GET", path, "operator").headers["ETag"]
    edge.clock.pass_s(60.0)
    assert edge.ask("PUT", path, "operator", json=body).status_code == 200
    refused = put(edge, path, body, If_Match=tag)
    assert refused.status_code == 412
    action = f"{kind}s.put"
    at = "2026-11-21T12:01:00Z"
    assert (refused.json or {})["changed"] == {"by": "operator", "at": at, "action": action}


def test_a_dispatch_is_a_change_of_its_plan(edge: Edge) -> None:
    posted = edge.post_plan(plan(dispatch=False)).json or {}
    path = f"/plans/{posted['plan_id']}"
    tag = edge.ask("GET", path, "operator").headers["ETag"]
    assert edge.ask("POST", f"{path}/dispatch", "operator").status_code == 200
    refused = put(edge, path, plan(), If_Match=tag)
    assert (refused.json or {})["changed"]["action"] == "plans.dispatch"


def test_a_plan_that_has_changed_is_not_dispatched_unseen(edge: Edge) -> None:
    posted = edge.post_plan(plan(dispatch=False)).json or {}
    path = f"/plans/{posted['id']}"
    seen = edge.ask("GET", path, "operator").headers["ETag"]
    assert put(edge, path, plan(mission(mission_id=99), dispatch=False)).status_code == 200
    refused = edge.ask("POST", f"{path}/dispatch", "operator", headers={"If-Match": seen})
    assert refused.status_code == 412
    assert edge.work() == []
    now = edge.ask("GET", path, "operator").headers["ETag"]
    for _ in range(2):  # Repeated after a lost answer
        dispatched = edge.ask("POST", f"{path}/dispatch", "operator", headers={"If-Match": now})
        assert dispatched.status_code == 200
    assert len(edge.work()) == 1


@pytest.mark.parametrize("kind", ["plan", "field"])
def test_what_has_changed_is_not_deleted_unseen(edge: Edge, kind: str) -> None:
    path, body = make(edge, kind)
    seen = edge.ask("GET", path, "operator").headers["ETag"]
    edge.clock.pass_s(60.0)
    assert edge.ask("PUT", path, "operator", json=body).status_code == 200
    refused = edge.ask("DELETE", path, "operator", headers={"If-Match": seen})
    assert refused.status_code == 412
    assert (refused.json or {})["changed"]["action"] == f"{kind}s.put"
    now = edge.ask("GET", path, "operator").headers["ETag"]
    assert edge.ask("DELETE", path, "operator", headers={"If-Match": now}).status_code == 204
    assert edge.ask("GET", path, "operator").status_code == 404


def test_a_star_asks_for_something_that_is_there(edge: Edge) -> None:
    assert put(edge, "/vehicles/7", {"link_state": "lost"}, If_Match="*").status_code == 412
    assert edge.ask("GET", "/vehicles/7", "operator").status_code == 404


@pytest.mark.first_case
@KINDS
def test_what_has_not_changed_is_not_sent_again(edge: Edge, kind: str) -> None:
    path, _ = make(edge, kind)
    tag = edge.ask("GET", path, "operator").headers["ETag"]
    again = edge.ask("GET", path, "operator", headers={"If-None-Match": tag})
    assert (again.status_code, again.data) == (304, b"")


def test_a_plan_that_has_begun_is_another_plan(edge: Edge) -> None:
    path, body = make(edge, "plan")
    tag = edge.ask("GET", path, "operator").headers["ETag"]
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    assert put(edge, path, body, If_Match=tag).status_code == 412


@pytest.mark.thorough
def test_a_put_of_a_vehicle_answers_with_its_tag(edge: Edge) -> None:
    first = put(edge, "/vehicles/9", {"link_state": "lost"})
    assert first.status_code == 201
    assert first.headers["ETag"] == edge.ask("GET", "/vehicles/9", "operator").headers["ETag"]
    second = put(edge, "/vehicles/9", {"link_state": "stale"}, If_Match=first.headers["ETag"])
    assert second.status_code == 200
    assert (
        put(edge, "/vehicles/9", {"link_state": "lost"}, If_Match=first.headers["ETag"]).status_code
        == 412
    )
    third = put(edge, "/vehicles/9", {"link_state": "lost"}, If_Match=second.headers["ETag"])
    assert third.status_code == 200


def test_two_forms_of_a_field_have_two_tags(edge: Edge) -> None:
    made = edge.post("/fields/", FIELD, "operator").json or {}
    path = f"/fields/{made['id']}"
    own, geojson = (
        edge.ask("GET", f"{path}{query}", "operator").headers["ETag"]
        for query in ("", "?format=geojson")
    )
    assert own != geojson
    for query, tag, status in (
        ("", own, 304),
        ("", geojson, 200),
        ("?format=geojson", own, 200),
        ("?format=geojson", geojson, 304),
    ):
        headers = {"If-None-Match": tag}
        assert edge.ask("GET", path + query, "operator", headers=headers).status_code == status
    assert put(edge, path, FIELD | {"name": "South"}, If_Match=geojson).status_code == 200
    assert put(edge, path, FIELD, If_Match=own).status_code == 412
