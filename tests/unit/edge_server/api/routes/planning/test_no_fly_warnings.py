"""A plan names the no-fly areas of fields that it enters, whenever it is posted or released."""

from typing import Any

import pytest

from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import home, mission, plan, takeoff, waypoint

NORTH, SOUTH, WEST, EAST = 40.4440, 40.4438, -3.7384, -3.7380
"""Between the takeoff, 40.4434, and the far waypoint: 22 m by 34 m."""
FAR = {"latitude": 40.4450}
CIRCLE = {
    "latitude": 40.4444,
    "longitude": -3.7382,
    "orbit_altitude": 20.0,
    "angular_velocity": 4.0,
}


def ring(south: float = SOUTH, north: float = NORTH) -> list[list[float]]:
    return [[south, WEST], [south, EAST], [north, EAST], [north, WEST]]


def draw(edge: Edge, *exclusions: list[list[float]]) -> int:
    outline = [[40.443, -3.739], [40.443, -3.737], [40.446, -3.737], [40.446, -3.739]]
    answer = edge.post("/fields/", {"boundary": outline, "exclusions": exclusions}, "farmer")
    assert answer.status_code == 201, answer.text
    stored: Any = answer.json
    return int(stored["id"])


def across(**changes: Any) -> dict[str, Any]:
    """Over the field from south to north."""
    commands = [takeoff(), waypoint(), waypoint(4, **FAR), home()]
    return plan(mission(command_array=commands), **changes)


def warnings(answer: Any) -> list[dict[str, str]]:
    assert answer.status_code in {200, 201}, answer.text
    listed: list[dict[str, str]] = answer.json["warnings"]
    return listed


def test_a_leg_across_a_no_fly_area_is_named_and_flown(edge: Edge) -> None:
    field = draw(edge, ring(40.4455, 40.4457), ring())
    answer = edge.post_plan(across())
    assert warnings(answer) == [
        {
            "path": "missions.0.command_array.2.parameters",
            "message": f"vehicle 1 enters no-fly area 2 of field {field} on the way to step 3",
        }
    ]
    assert len(edge.work()) == 1


def test_a_draft_names_the_area_that_was_drawn_after_it_when_it_is_dispatched(edge: Edge) -> None:
    held = edge.post_plan(across(dispatch=False))
    assert warnings(held) == []
    draw(edge, ring())
    (stored,) = edge.get("/plans/")
    number = stored["id"]
    (warning,) = warnings(edge.ask("POST", f"/plans/{number}/dispatch", "operator"))
    assert warning["message"].startswith("vehicle 1 enters no-fly area 1")


@pytest.mark.parametrize("radius", [30.0, 50.0])
def test_a_circle_enters_what_its_line_crosses(edge: Edge, radius: float) -> None:
    draw(edge, ring())
    turn = {"command_id": 2, "command_type_id": 7, "parameters": CIRCLE | {"radius": radius}}
    begin = takeoff(latitude=40.4452)
    found = warnings(edge.post_plan(plan(mission(command_array=[begin, turn, home(5)]))))
    assert len(found) == (radius == 50.0)


def test_a_mission_that_begins_in_an_area_may_leave_it(edge: Edge) -> None:
    draw(edge, ring(40.4432, 40.4436))
    assert warnings(edge.post_plan(across())) == []


def test_each_vehicle_and_each_area_has_a_warning_of_its_own(edge: Edge) -> None:
    draw(edge, ring(), ring(40.4441, 40.4442))
    commands = across()["plan"]["missions"][0]["command_array"]
    both = [mission(number, number, command_array=commands) for number in (1, 2)]
    found = [one["message"] for one in warnings(edge.post_plan(plan(*both)))]
    assert [one[: len("vehicle 1 enters no-fly area 1")] for one in found] == [
        f"vehicle {vehicle} enters no-fly area {area}" for vehicle in (1, 2) for area in (1, 2)
    ]


def test_a_plan_beside_all_areas_has_no_warning(edge: Edge) -> None:
    draw(edge, ring(40.4452, 40.4455))
    assert warnings(edge.post_plan(across())) == []


def test_an_area_is_named_however_many_others_lie_nearer_to_the_beginning(edge: Edge) -> None:
    """Four hundred small ones west of the path."""
    beside = [[40.4434, WEST], [40.4434, WEST - 5e-5], [40.44345, WEST]]
    for _ in range(8):
        draw(edge, *[beside] * 50)
    field = draw(edge, ring())
    (warning,) = warnings(edge.post_plan(across()))
    assert f"no-fly area 1 of field {field} " in warning["message"]


def test_how_many_areas_are_too_many_is_said(edge: Edge) -> None:
    """Four hundred in a row beside a path that goes round them."""
    for _ in range(8):
        draw(edge, *[ring(40.4440, 40.4441)] * 50)
    around = [
        waypoint(number, longitude=-3.7378, latitude=40.4440 + 1e-4 * number) for number in (2, 3)
    ]
    found = warnings(edge.post_plan(plan(mission(command_array=[takeoff(), *around, home(4)]))))
    assert found[-1] == {
        "path": "missions.0",
        "message": "vehicle 1 and 100 no-fly areas near its path are not compared",
    }


def test_an_area_is_named_however_many_fields_are_older(edge: Edge) -> None:
    corners = [[-3.0, 41.0], [-2.9, 41.0], [-2.9, 41.1], [-3.0, 41.0]]
    geometry = {"type": "Polygon", "coordinates": [corners]}
    features = [{"type": "Feature", "properties": {}, "geometry": geometry}] * 100
    for _ in range(11):
        answer = edge.post(
            "/fields/", {"type": "FeatureCollection", "features": features}, "farmer"
        )
        assert answer.status_code == 201, answer.text
    draw(edge, ring())
    assert len(warnings(edge.post_plan(across()))) == 1


def test_a_mission_over_the_date_line_enters_an_area_there(edge: Edge) -> None:
    square = [[40.4438, 179.9999], [40.4438, -179.9999], [40.444, -179.9999], [40.444, 179.9999]]
    outline = [[40.443, 179.999], [40.443, -179.999], [40.446, -179.999], [40.446, 179.999]]
    answer = edge.post("/fields/", {"boundary": outline, "exclusions": [square]}, "farmer")
    assert answer.status_code == 201, answer.text
    begin, far = takeoff(longitude=179.9998), waypoint(2, latitude=40.4444, longitude=-179.9998)
    plans = [plan(mission(command_array=[begin, far, home()]))]
    plans += [plan(mission(2, 2, command_array=[begin, waypoint(2, longitude=179.9997), home()]))]
    assert [len(warnings(edge.post_plan(one))) for one in plans] == [1, 0]
