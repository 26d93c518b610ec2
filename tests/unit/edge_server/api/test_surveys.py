"""A field in, plans out: kept together or not at all."""

from typing import Any

import pytest

from edge_server.api.surveys import EXAMPLE
from tests.unit.edge_server.conftest import Edge


def ask(edge: Edge, query: str = "", role: str = "operator", **changes: Any) -> Any:
    return edge.post(f"/surveys/{query}", {**EXAMPLE, **changes}, role)


def test_the_plans_of_a_survey_are_kept_and_held(edge: Edge) -> None:
    answer = ask(edge)
    assert answer.status_code == 201
    survey = answer.json
    assert survey["plans"] == edge.get("/plans/")
    assert len(survey["plans"]) == survey["flights"] > 1
    assert [plan["name"] for plan in survey["plans"]][:2] == ["North field 1", "North field 2"]
    assert {m["dispatch_state"] for plan in survey["plans"] for m in plan["missions"]} == {"held"}
    assert edge.work() == []


def test_a_preview_keeps_nothing(edge: Edge) -> None:
    answer = ask(edge, "?preview=true")
    assert answer.status_code == 200
    assert edge.get("/plans/") == []
    assert len(answer.json["plans"]) == answer.json["flights"]


def test_a_dispatched_survey_is_work_for_the_broker(edge: Edge) -> None:
    assert ask(edge, vehicles=[1, 2], most_commands=700, dispatch=True).status_code == 201
    assert sorted(item["vehicle_id"] for item in edge.work()) == [1, 2]


def test_all_plans_or_none(edge: Edge) -> None:
    answer = ask(edge, dispatch=True, most_commands=12, endurance=3600)
    assert answer.status_code == 409  # More flights than a vehicle's queue takes
    assert edge.get("/plans/") == []


def test_a_repeated_survey_is_the_same_survey(edge: Edge) -> None:
    first = edge.post("/surveys/", EXAMPLE, "operator", key="one")
    edge.clock.pass_s(60.0)
    again = edge.post("/surveys/", EXAMPLE, "operator", key="one")
    assert (again.status_code, again.json) == (201, first.json)


def test_the_flight_time_counts_from_where_the_vehicle_is(edge: Edge) -> None:
    near = ask(edge, "?preview=true").json["duration_s"]
    away = {"link_state": "connected", "latitude": 40.4460, "longitude": -3.7392}
    assert edge.ask("PUT", "/vehicles/1", "broker", json=away).status_code == 200
    assert ask(edge, "?preview=true").json["duration_s"] > near


def test_a_farmer_drafts(edge: Edge) -> None:
    assert ask(edge, role="farmer", dispatch=True).status_code == 403
    assert ask(edge, role="farmer").status_code == 201


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"swath_width": 5.0}, "camera"),
        ({"camera": None}, "camera"),
        ({"vehicles": [1, 1]}, "vehicles"),
        ({"vehicles": [9]}, "missions.0.vehicle_id"),
        ({"altitude": 121}, "altitude"),
        ({"altitude": 1.0, "front_overlap": 0.9}, "altitude"),
        ({"boundary": [[40, -3], [41, -3]]}, "boundary"),
        ({"boundary": [[40, -3], [41, -3], [41, -2]], "altitude": 3}, "boundary"),
        ({"side_overlap": 1.0}, "side_overlap"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_bad_survey_is_refused_by_field(edge: Edge, changes: dict[str, Any], field: str) -> None:
    answer = ask(edge, **changes)
    assert answer.status_code == 422
    assert field in (answer.json or {})["detail"]["json"]
    assert edge.get("/plans/") == []


def test_preview_is_true_or_false(edge: Edge) -> None:
    answer = ask(edge, "?preview=perhaps")
    assert answer.status_code == 422
    assert list(answer.json["detail"]["query"]) == ["preview"]
