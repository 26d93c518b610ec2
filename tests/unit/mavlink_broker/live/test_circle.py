"""A circle from point to point: on it, a full turn, with the nose in the right direction."""

import itertools
import math
from typing import Any

import pytest

from afarcloud.enumerations import OrbitType, Status
from mavlink_broker.live.orbit import MAX_DEVIATION_M, point_count
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.autopilot_families import PX4_AND_ARDUPILOT
from tests.support.broker_world import World, go_home, mission, takeoff
from tests.support.geodesy import LocalGround
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, Script

RADIUS_M = 15.0
MAXIMUM_SPEED_M_S = 4.0
BACKWARDS = OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS
AWAY = OrbitType.AWAY_FROM_HOT_POINT


def hotpoint(heading: OrbitType, *, clockwise: bool = True, start: int = 0) -> dict[str, Any]:
    return {
        "command_id": 2,
        "command_type_id": 7,
        "parameters": {
            "latitude": HOME[0],
            "longitude": HOME[1],
            "orbit_altitude": 9.0,
            "radius": RADIUS_M,
            "angular_velocity": 10.0,
            "is_clockwise": clockwise,
            "start_point": start,
            "orbit_type": int(heading),
        },
    }


def flown(heading: OrbitType, script: Script, **how: Any) -> tuple[World, list[tuple[float, ...]]]:
    """The places that the vehicle was sent to on its circle, as orders."""
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(), hotpoint(heading, **how), go_home(3)))
    world.run_until_over(1201, within_s=400.0)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 3
    sent = [v for command, v in vehicle.parameters if command == mavlink.MAV_CMD_DO_REPOSITION]
    assert 0.9 * MAXIMUM_SPEED_M_S < sent[0][0] <= MAXIMUM_SPEED_M_S, "to where the circle begins"
    return world, sent[1:]


def north_east(order: tuple[float, ...]) -> tuple[float, float]:
    return LocalGround(*HOME[:2]).north_east_m(order[4] / 1e7, order[5] / 1e7)


@pytest.mark.first_case
@PX4_AND_ARDUPILOT
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_it_makes_a_full_turn_in_the_right_direction(script: Script, sense: float) -> None:
    _, orders = flown(AWAY, script, clockwise=sense > 0.0)
    places = [north_east(order) for order in orders]
    assert len(places) == point_count(RADIUS_M) + 1
    for place in places:
        assert math.hypot(*place) == pytest.approx(RADIUS_M, abs=0.05)
    bearings = [math.atan2(east, north) for north, east in places]
    steps = [math.remainder(b - a, math.tau) for a, b in itertools.pairwise(bearings)]
    assert math.fsum(steps) == pytest.approx(sense * math.tau, abs=1e-3)
    for order in orders:
        assert order[0] == pytest.approx(math.radians(10.0) * RADIUS_M)
        assert order[6] == HOME[2] + 9.0


@pytest.mark.first_case
@pytest.mark.parametrize(("start", "bearing"), [(0, 0.0), (1, 180.0), (2, 270.0), (3, 90.0)])
def test_it_begins_at_its_start_point(start: int, bearing: float) -> None:
    _, orders = flown(AWAY, PX4, start=start)
    north, east = north_east(orders[0])
    assert math.degrees(math.atan2(east, north)) % 360.0 == pytest.approx(bearing, abs=0.5)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("heading", "clockwise", "beyond_bearing"),
    [(AWAY, True, 0.0), (AWAY, False, 0.0), (BACKWARDS, True, -90.0), (BACKWARDS, False, 90.0)],
)
def test_the_nose_is_where_it_belongs(
    heading: OrbitType,
    clockwise: bool,
    beyond_bearing: float,
) -> None:
    _, orders = flown(heading, PX4, clockwise=clockwise)
    half_a_step = (180.0 if clockwise else -180.0) / point_count(RADIUS_M)
    for order in orders:
        north, east = north_east(order)
        middle = math.degrees(math.atan2(east, north)) - half_a_step
        nose = math.degrees(order[3]) - middle
        assert abs(math.remainder(nose - beyond_bearing, 360.0)) < 0.5


@pytest.mark.thorough
def test_ardupilot_turns_by_a_command_of_its_own_at_every_point() -> None:
    world, orders = flown(BACKWARDS, ARDUPILOT)
    sent = world.only_vehicle.parameters
    turns = [v[0] for command, v in sent if command == mavlink.MAV_CMD_CONDITION_YAW]
    assert len(turns) == len(orders)
    assert all(0.0 <= turn < 360.0 for turn in turns)


@pytest.mark.first_case
@PX4_AND_ARDUPILOT
def test_the_report_names_how_it_was_flown(script: Script) -> None:
    world, _ = flown(AWAY, script)
    report = world.edge.reports(1201)[-1]["command_report_array"][1]
    assert "orbit_type: flown from point to point" in report["message"]


def test_a_vehicle_that_will_not_be_sent_about_fails_with_its_reason() -> None:
    world = World()
    vehicle = world.add_vehicle(script=PX4)
    world.edge.plan(mission(takeoff(), hotpoint(AWAY), go_home(3)))
    world.run_until(lambda: (world.edge.status(1201) or 0) == Status.RUNNING)
    denied = {mavlink.MAV_CMD_DO_REPOSITION: mavlink.MAV_RESULT_DENIED}
    vehicle.script = Script(results=denied)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]


@pytest.mark.parametrize("radius", [5.0, 20.0, 100.0, 500.0])
def test_the_chords_keep_to_the_circle(radius: float) -> None:
    sagitta = radius * (1.0 - math.cos(math.pi / point_count(radius)))
    assert sagitta <= MAX_DEVIATION_M
