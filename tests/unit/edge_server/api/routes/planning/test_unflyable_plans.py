"""What no vehicle of the fleet can fly is refused at post, by its field and with the reason."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from afarcloud.flyable import VehicleLimits
from edge_server.app import context_of, create_app
from edge_server.config import Config
from tests.unit.edge_server.conftest import Clock, Edge
from tests.unit.edge_server.documents import home, mission, plan, speed_event, takeoff, waypoint

NORTH, WEST = 40.4434, -3.7382
CORNER = [NORTH, WEST]
EAST = [NORTH, WEST + 0.001]
NORTHEAST = [NORTH + 0.001, WEST + 0.001]
NORTHWEST = [NORTH + 0.001, WEST]
BOW_TIE = [CORNER, NORTHEAST, EAST, NORTHWEST]


@pytest.fixture
def fleet(config: Config) -> Iterator[Edge]:
    """An edge server whose fleet flies neither far nor long legs."""
    app = create_app(replace(config, longest_leg_m=900.0, farthest_m=10_000.0), clock=Clock())
    edge = Edge(app.test_client(), context_of(app), Clock())
    edge.register(1)
    yield edge
    edge.context.close()


def flight_to(**place: Any) -> dict[str, Any]:
    return mission(command_array=[takeoff(), waypoint(**place), home()])


def landing(height_m: float) -> dict[str, Any]:
    place = {"latitude": NORTH, "longitude": WEST, "landing_altitude": height_m}
    land = {"command_id": 2, "command_type_id": 2, "parameters": place}
    return mission(command_array=[takeoff(), land])


def refusal(edge: Edge, document: dict[str, Any]) -> dict[str, list[str]]:
    answer = edge.post_plan(document)
    assert answer.status_code == 422, answer.json
    faults: dict[str, list[str]] = (answer.json or {})["detail"]["json"]
    return faults


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("document", "path", "text"),
    [
        (plan(mission(maximum_speed=5e-324)), "missions.0.maximum_speed", "at least 0.1 m/s"),
        (
            plan(flight_to(latitude=-NORTH)),
            "missions.0.command_array.1.parameters",
            "at most 10000 m (farthest_m)",
        ),
        (
            plan(flight_to(latitude=NORTH + 0.01)),
            "missions.0.command_array.1.parameters",
            "at most 900 m (longest_leg_m)",
        ),
        (
            plan(flight_to(altitude=-50.0)),
            "missions.0.command_array.1.parameters.altitude",
            "greater than or equal to 0",
        ),
        (
            plan(rally_points=[{"latitude": NORTH, "longitude": 3.0, "altitude": 10.0}]),
            "rally_points.0",
            "farthest_m",
        ),
        (plan(geofence={"inclusion": [[CORNER] * 3]}), "geofence.inclusion.0", "has no area"),
        (
            plan(geofence={"exclusion": [[CORNER, EAST, NORTHEAST], [CORNER, EAST, CORNER]]}),
            "geofence.exclusion.1",
            "has no area",
        ),
        (
            plan(geofence={"inclusion": [BOW_TIE]}),
            "geofence.inclusion.0",
            "crosses itself: side 0 and side 2",
        ),
    ],
)
def test_a_plan_that_no_vehicle_can_fly_is_refused_by_its_field(
    fleet: Edge, document: dict[str, Any], path: str, text: str
) -> None:
    ((named, faults),) = refusal(fleet, document).items()
    assert named == path
    assert text in str(faults)


@pytest.mark.first_case
@pytest.mark.parametrize("height_m", [-50.0, 0.0])
def test_a_landing_on_the_hillside_below_home_is_taken(edge: Edge, height_m: float) -> None:
    assert edge.post_plan(plan(landing(height_m))).status_code == 201


def test_an_outline_that_is_closed_by_its_first_corner_is_taken(edge: Edge) -> None:
    square = [
        [NORTH - 0.001, WEST - 0.001],
        [NORTH - 0.001, WEST + 0.001],
        [NORTH + 0.001, WEST + 0.001],
        [NORTH + 0.001, WEST - 0.001],
    ]
    closed = [*square, square[0]]
    assert edge.post_plan(plan(geofence={"inclusion": [closed]})).status_code == 201


@pytest.mark.thorough
def test_a_fleet_sets_how_far_it_flies(edge: Edge, fleet: Edge) -> None:
    far = plan(
        flight_to(latitude=-NORTH),
        rally_points=[{"latitude": 0.0, "longitude": 0.0, "altitude": 10.0}],
    )
    assert edge.post_plan(far).status_code == 201
    assert fleet.post_plan(far).status_code == 422


def test_the_limits_are_those_of_a_vehicle_unless_they_are_set(edge: Edge) -> None:
    assert edge.context.vehicle_limits == VehicleLimits()


def test_a_new_speed_without_a_flight_is_refused(edge: Edge) -> None:
    assert edge.post_plan(plan()).status_code == 201
    answer = edge.post("/events/", speed_event(1e-300), "operator")
    assert answer.status_code == 422
    assert "at least 0.1 m/s" in str(answer.json)
