"""Surveys: all plans of a field are stored, or none."""

from typing import Any

import pytest

from afarcloud.numbers import INT32_MAX
from edge_server.api.routes.planning.surveys import EXAMPLE
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan


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


def refusal(answer: Any) -> tuple[int, Any]:
    return answer.status_code, {**(answer.json or {}), "request_id": None}


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"vehicles": [9]}, 422),
        ({"vehicles": [1, 9]}, 422),
        ({"first_mission_id": 7, "dispatch": True}, 409),
        ({"dispatch": True, "most_commands": 12, "endurance": 3600}, 409),
    ],
    ids=["not registered", "one of two", "an unfinished mission", "a full queue"],
)
def test_a_preview_refuses_what_the_post_refuses(
    edge: Edge, changes: dict[str, Any], status: int
) -> None:
    edge.post_plan(plan(mission(7)))
    preview = refusal(ask(edge, "?preview=true", **changes))
    assert preview[0] == status
    assert preview == refusal(ask(edge, **changes))
    assert len(edge.get("/plans/")) == 1


@pytest.mark.parametrize("query", ["", "?preview=true"])
@pytest.mark.parametrize("name", ["\u200b", "North\u202e", "\x07"])
def test_a_survey_whose_name_cannot_be_shown_is_refused(edge: Edge, query: str, name: str) -> None:
    answer = ask(edge, query, name=name)
    assert answer.status_code == 422
    assert list(answer.json["detail"]["json"]) == ["name"]


def test_a_dispatched_survey_is_work_for_the_broker(edge: Edge) -> None:
    assert ask(edge, vehicles=[1, 2], most_commands=700, dispatch=True).status_code == 201
    assert sorted(item["vehicle_id"] for item in edge.work()) == [1, 2]


@pytest.mark.thorough
def test_all_plans_or_none(edge: Edge) -> None:
    answer = ask(edge, dispatch=True, most_commands=12, endurance=3600)
    assert answer.status_code == 409  # More flights than a vehicle's queue takes
    assert edge.get("/plans/") == []


@pytest.mark.first_case
@pytest.mark.parametrize("query", ["", "?preview=true"])
def test_a_survey_has_no_mission_id_beyond_the_largest(edge: Edge, query: str) -> None:
    answer = ask(edge, query, first_mission_id=INT32_MAX)
    assert answer.status_code == 422
    assert list(answer.json["detail"]["json"]) == ["first_mission_id"]
    assert ask(edge, query, first_mission_id=INT32_MAX - 1).status_code in {200, 201}


@pytest.mark.thorough
def test_a_survey_that_finds_no_free_mission_ids_is_refused(edge: Edge) -> None:
    edge.clock.now = float(INT32_MAX - 1)
    edge.post_plan(plan(mission(INT32_MAX)))
    assert ask(edge).status_code == 409
    assert len(edge.get("/plans/")) == 1


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
    for query in ("", "?preview=true"):
        assert ask(edge, query, role="farmer", dispatch=True).status_code == 403
    assert ask(edge, role="farmer").status_code == 201


def without_boundary(**changes: Any) -> dict[str, Any]:
    return {name: value for name, value in EXAMPLE.items() if name != "boundary"} | changes


def test_a_field_that_is_kept_is_covered_like_its_boundary(edge: Edge) -> None:
    hole = [[40.4434, -3.7387], [40.4436, -3.7387], [40.4436, -3.7385]]
    field = {"name": "Hill", "boundary": EXAMPLE["boundary"], "exclusions": [hole]}
    assert edge.post("/fields/", field, "farmer").status_code == 201
    drawn = ask(edge, "?preview=true", exclusions=[hole])
    named = edge.post("/surveys/?preview=true", without_boundary(field_id=1, name=None), "farmer")
    assert named.status_code == 200
    known: Any = named.json
    assert known["duration_s"] == drawn.json["duration_s"]
    assert known["area_m2"] == drawn.json["area_m2"]
    assert {plan["field_id"] for plan in known["plans"]} == {1}
    assert known["plans"][0]["name"] == "Hill 1"
    kept = edge.post("/surveys/", without_boundary(field_id=1, exclusions=[hole]), "operator")
    assert kept.status_code == 201
    assert {plan["field_id"] for plan in edge.get("/plans/")} == {1}


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("order", "path"),
    [
        (without_boundary(), "boundary"),
        ({**EXAMPLE, "field_id": 1}, "boundary"),
        (without_boundary(field_id=9), "field_id"),
        (without_boundary(field_id="1"), "field_id"),
        (without_boundary(field_id=1, altitude=3), "field_id"),
    ],
)
def test_a_survey_has_one_field(edge: Edge, order: dict[str, Any], path: str) -> None:
    large = [[40.0, -3.0], [40.0, -2.9], [40.1, -2.9], [40.1, -3.0]]
    assert edge.post("/fields/", {"boundary": large}, "operator").status_code == 201
    answer = edge.post("/surveys/", order, "operator")
    assert answer.status_code == 422
    assert path in (answer.json or {})["detail"]["json"]


WEST_HALF = [[40.4430, -3.7392], [40.4440, -3.7392], [40.4440, -3.7386], [40.4430, -3.7386]]


def test_a_part_of_a_field_is_covered_and_the_field_stays(edge: Edge) -> None:
    pond = [[40.4434, -3.7383], [40.4436, -3.7383], [40.4436, -3.7381]]
    field = {"name": "Hill", "boundary": EXAMPLE["boundary"], "holes": [pond]}
    edge.post("/fields/", field, "farmer")
    before = edge.get("/fields/1")
    whole = edge.post("/surveys/?preview=true", without_boundary(field_id=1), "operator")
    half = edge.post("/surveys/", without_boundary(field_id=1, area=WEST_HALF), "operator")
    assert half.status_code == 201
    shown: Any = half.json
    alone = ask(edge, "?preview=true", boundary=WEST_HALF)
    assert shown["area_m2"] == alone.json["area_m2"]
    assert shown["pictures"] == alone.json["pictures"] < (whole.json or {})["pictures"]
    assert {plan["field_id"] for plan in shown["plans"]} == {1}
    commands = [
        command
        for stored in shown["plans"]
        for flown in stored["missions"]
        for command in flown["command_array"]
    ]
    assert max(one["parameters"].get("longitude", -4) for one in commands) < -3.7386
    assert edge.get("/fields/1") == before


def test_a_flight_to_a_part_goes_round_what_lies_in_the_rest_of_the_field(edge: Edge) -> None:
    wall = [[40.4432, -3.7383], [40.4438, -3.7383], [40.4438, -3.7382], [40.4432, -3.7382]]
    home = {"latitude": 40.4435, "longitude": -3.7380}
    order = without_boundary(area=WEST_HALF, home=home)
    easternmost = []
    for exclusions in ([], [wall]):
        field = {"boundary": EXAMPLE["boundary"], "exclusions": exclusions}
        order["field_id"] = (edge.post("/fields/", field, "operator").json or {})["id"]
        planned = edge.post("/surveys/?preview=true", order, "operator")
        _, *flown = (planned.json or {})["plans"][0]["missions"][0]["command_array"]
        easternmost.append(max(one["parameters"].get("longitude", -4) for one in flown))
    assert easternmost[0] < -3.7386 < -3.7383 < easternmost[1]


def test_a_plan_whose_home_lies_in_a_no_fly_area_has_a_warning(edge: Edge) -> None:
    around = [[40.4446, -3.7392], [40.4446, -3.7388], [40.4449, -3.7388], [40.4449, -3.7392]]
    home = {"latitude": 40.4447, "longitude": -3.7390}
    assert ask(edge, exclusions=[around], home=home).status_code == 201
    for stored in edge.get("/plans/"):
        assert "is enclosed by no-fly areas" in str(stored["warnings"])


def test_a_survey_round_a_hole_for_a_vehicle_of_unknown_place_has_a_warning(edge: Edge) -> None:
    hole = [[40.4434, -3.7388], [40.4434, -3.7384], [40.4437, -3.7384]]
    assert ask(edge, holes=[hole], name="with").status_code == 201
    assert ask(edge, name="without").status_code == 201
    for stored in edge.get("/plans/"):
        is_warned = "is not known" in str(stored["warnings"])
        assert is_warned is stored["name"].startswith("with "), stored


def test_the_flights_go_round_a_no_fly_area_of_another_field(edge: Edge) -> None:
    home = {"latitude": 40.4435, "longitude": -3.7410}
    between = [[40.4425, -3.7402], [40.4425, -3.7400], [40.4445, -3.7400], [40.4445, -3.7402]]
    around_home = [[40.4434, -3.7412], [40.4434, -3.7409], [40.4436, -3.7409]]
    far = [[40.50, -3.80], [40.50, -3.79], [40.51, -3.79]]

    def flown() -> list[tuple[float, float]]:
        (first, *_) = ask(edge, "?preview=true", home=home).json["plans"]
        commands = first["missions"][0]["command_array"]
        places = [one["parameters"] for one in commands if "latitude" in one["parameters"]]
        return [(one["latitude"], one["longitude"]) for one in places]

    straight = flown()
    yard = {"boundary": [[40.44, -3.75], [40.44, -3.74], [40.45, -3.74]]}
    edge.post("/fields/", yard | {"exclusions": [around_home, far]}, "operator")
    assert flown() == straight
    edge.post("/fields/", yard | {"exclusions": [between]}, "operator")
    assert flown() != straight
    assert all(not 40.4425 < at[0] < 40.4445 or not -3.7402 < at[1] < -3.7400 for at in flown())


@pytest.mark.parametrize(("altitude", "is_warned"), [(30.0, True), (0.4, False)])
def test_a_survey_from_where_a_vehicle_flies_has_a_warning(
    edge: Edge, altitude: float, *, is_warned: bool
) -> None:
    """It will take off from another place: the paths from there may cross a no-fly area."""
    at = {"latitude": 40.4447, "longitude": -3.7390, "altitude": altitude}
    state = at | {"link_state": "connected", "armed": True}
    assert edge.ask("PUT", "/vehicles/1", "broker", json=state).status_code == 200
    assert ask(edge).status_code == 201
    given = {"latitude": 40.4447, "longitude": -3.7390}
    assert ask(edge, home=given, name="given").status_code == 201
    for stored in edge.get("/plans/"):
        expected = is_warned and not stored["name"].startswith("given")
        assert ("flies now" in str(stored["warnings"])) is expected, stored["warnings"]


NORTH = {"latitude": 40.4447, "longitude": -3.7390}
SOUTH = {"latitude": 40.4425, "longitude": -3.7386}


def takeoffs(answer: Any) -> dict[int, dict[str, float] | None]:
    """Where the first mission of each vehicle takes off; None: at its first place."""
    found: dict[int, dict[str, float] | None] = {}
    for one in answer.json["plans"][0]["missions"]:
        start, first = (
            {name: round(command["parameters"][name], 6) for name in ("latitude", "longitude")}
            for command in one["command_array"][:2]
        )
        found[one["vehicle_id"]] = None if start == first else start
    return found


def stands(edge: Edge, vehicle_id: int, state: dict[str, Any]) -> None:
    document = {"link_state": "connected", "armed": False, "altitude": 0.0, **state}
    assert edge.ask("PUT", f"/vehicles/{vehicle_id}", "broker", json=document).status_code == 200


def test_each_vehicle_of_a_survey_takes_off_where_it_stands(edge: Edge) -> None:
    stands(edge, 1, NORTH)
    stands(edge, 2, SOUTH)
    assert takeoffs(ask(edge, vehicles=[1, 2])) == {1: NORTH, 2: SOUTH}
    assert takeoffs(ask(edge, vehicles=[2, 1])) == {1: NORTH, 2: SOUTH}
    elsewhere = [{"vehicle_id": 2, "latitude": 40.4426, "longitude": -3.7391}]
    given = {"latitude": 40.4426, "longitude": -3.7391}
    assert takeoffs(ask(edge, vehicles=[1, 2], homes=elsewhere)) == {1: NORTH, 2: given}


def test_vehicles_that_share_a_home_do_not_meet_above_it(edge: Edge) -> None:
    stands(edge, 1, NORTH)
    assert takeoffs(ask(edge, vehicles=[1, 2])) == {1: NORTH, 2: None}
    assert takeoffs(ask(edge, vehicles=[1, 2], home=SOUTH)) == {1: None, 2: None}
    assert takeoffs(ask(edge, vehicles=[1], home=SOUTH)) == {1: SOUTH}


def test_a_vehicle_in_the_air_takes_off_nowhere_yet(edge: Edge) -> None:
    stands(edge, 1, {**NORTH, "altitude": 30.0, "armed": True})
    stands(edge, 2, SOUTH)
    assert takeoffs(ask(edge, vehicles=[1, 2])) == {1: None, 2: SOUTH}


def test_a_vehicle_of_unknown_place_is_warned_of_where_there_is_something_to_go_round(
    edge: Edge,
) -> None:
    stands(edge, 1, NORTH)
    hole = [[40.4434, -3.7388], [40.4434, -3.7384], [40.4437, -3.7384]]
    for holes, is_warned in (([hole], True), ([], False)):
        stored = ask(edge, vehicles=[1, 2], holes=holes).json["plans"][0]
        text = "that of the others: where vehicle 2 stands is not known"
        assert (text in str(stored["warnings"])) is is_warned
        assert "vehicle 1" not in str(stored["warnings"])


@pytest.mark.parametrize("vehicle_ids", [[1, 1], [3]])
def test_homes_are_those_of_the_vehicles_that_fly(edge: Edge, vehicle_ids: list[int]) -> None:
    homes = [{**NORTH, "vehicle_id": one} for one in vehicle_ids]
    answer = ask(edge, vehicles=[1, 2], homes=homes)
    assert answer.status_code == 422
    (faults,) = answer.json["detail"]["json"].values()
    assert "names a vehicle twice, or one that is not in vehicles" in str(faults)
    assert list(answer.json["detail"]["json"]) == ["homes"]


@pytest.mark.parametrize(
    ("area", "path", "text"),
    [
        (
            [[40.4432, -3.7390], [40.4438, -3.7384], [40.4438, -3.7390], [40.4432, -3.7384]],
            "area",
            "crosses itself",
        ),
        ([[40.4432, -3.7390], [40.4438, -3.7390], [40.4438, -3.7376]], "area.2", "is 34 m outside"),
        ([[40.4432, -3.7390]] * 3, "area", "has no area"),
        ([[40.4432, -3.7390], [40.4438, -3.7390]], "area", "at least 3"),
    ],
)
def test_an_area_that_is_no_part_of_the_field_is_refused(
    edge: Edge, area: list[list[float]], path: str, text: str
) -> None:
    edge.post("/fields/", {"boundary": EXAMPLE["boundary"]}, "operator")
    answer = edge.post("/surveys/", without_boundary(field_id=1, area=area), "operator")
    assert answer.status_code == 422
    assert text in str((answer.json or {})["detail"]["json"][path])
    assert edge.get("/plans/") == []


def test_an_area_that_cannot_be_flown_is_named_and_not_its_field(edge: Edge) -> None:
    edge.post("/fields/", {"boundary": EXAMPLE["boundary"], "holes": [WEST_HALF]}, "operator")
    inner = [[40.4431, -3.7391], [40.4439, -3.7391], [40.4439, -3.7387]]
    answer = edge.post("/surveys/", without_boundary(field_id=1, area=inner), "operator")
    assert list((answer.json or {})["detail"]["json"]) == ["area"]
    assert ask(edge, area=WEST_HALF).status_code == 422


@pytest.mark.thorough
def test_a_repeated_survey_of_a_field_that_has_changed_is_another_one(edge: Edge) -> None:
    edge.post("/fields/", {"boundary": EXAMPLE["boundary"]}, "operator")
    order = without_boundary(field_id=1)
    assert edge.post("/surveys/", order, "operator", key="one").status_code == 201
    assert edge.post("/surveys/", order, "operator", key="one").status_code == 201
    corners = [*EXAMPLE["boundary"][:3], [40.4429, -3.7380]]  # type: ignore[index]  # it is a list
    edge.ask("PUT", "/fields/1", "operator", json={"boundary": corners})
    assert edge.post("/surveys/", order, "operator", key="one").status_code == 422


@pytest.mark.first_case
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


def test_a_survey_begins_at_the_entry_of_its_field(edge: Edge) -> None:
    corners = EXAMPLE["boundary"]
    assert isinstance(corners, list)
    begins = []
    for entry in (corners[0], corners[2]):
        field = {"name": "North field", "boundary": corners, "entry": entry}
        stored = edge.post("/fields/", field, "operator").json or {}
        assert stored["entry"] == entry
        order = {name: value for name, value in EXAMPLE.items() if name != "boundary"}
        planned = edge.post(
            "/surveys/?preview=true", {**order, "field_id": stored["id"]}, "operator"
        ).json
        place = (planned or {})["plans"][0]["missions"][0]["command_array"][0]["parameters"]
        begins.append((place["latitude"], place["longitude"]))
    assert begins[0][0] < 40.4435 < begins[1][0]
    assert begins[0][1] < -3.7386 < begins[1][1]
