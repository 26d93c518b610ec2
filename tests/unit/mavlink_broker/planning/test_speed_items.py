"""On PX4 and ArduPilot too the vector of a leg that climbs is at most the mission's speed."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.geodesy import distance_m, shifted
from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import ARDUPILOT, GENERIC, OWN, PX4, Family
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.planning.mission import FlightPlan, LiveCommand, translate
from tests.support.translated_missions import HOME

START = {"latitude": 40.4434, "longitude": -3.7382, "altitude": 10.0}
SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
bounded = st.sampled_from([PX4, ARDUPILOT, GENERIC])
legs = st.lists(
    st.tuples(st.floats(0, 359), st.floats(20, 100), st.floats(2, 120)), min_size=1, max_size=6
)
"""At most 80 degrees steep: 0.2 m/s across, the least that ArduCopter takes, is 1.2 m/s then."""


def mission(route: Sequence[tuple[float, float, float]], maximum_speed: float = 5.0) -> Mission:
    """Take off, then fly legs of a bearing [deg] and a distance [m], to an altitude [m]."""
    commands: list[dict[str, Any]] = [{"command_type_id": 1, "parameters": START}]
    place = START["latitude"], START["longitude"]
    for bearing, across, altitude in route:
        place = shifted(*place, bearing, across)
        where = {"latitude": place[0], "longitude": place[1], "altitude": altitude}
        commands.append({"command_type_id": 3, "parameters": where})
    commands.append({"command_type_id": 11, "parameters": {"landing": False}})
    return Mission.model_validate(
        {
            "sequence_number": 1,
            "vehicle_id": 1,
            "mission_id": 1,
            "maximum_speed": maximum_speed,
            "command_array": [
                one | {"command_id": number} for number, one in enumerate(commands, 1)
            ],
        }
    )


def items_of(route: Mission, family: Family) -> FlightPlan:
    (segment,) = translate(route, family, HOME).segments
    assert isinstance(segment, FlightPlan)
    return segment


def leg_speeds(plan: FlightPlan) -> list[float]:
    """Speed along each leg, as an autopilot flies that limits the horizontal speed alone.

    It keeps the direction of the leg: what lies across is at the limit, or below.
    """
    speeds, limit, at = [], math.inf, (START["latitude"], START["longitude"], START["altitude"])
    for item in plan.items[plan.first_item :]:
        if item.command == SPEED:
            limit = item.parameters[1]
        elif item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            to = item.latitude_deg, item.longitude_deg, item.altitude_m
            across = distance_m(*at[:2], *to[:2])
            if across >= 0.5:
                speeds.append(limit * math.hypot(across, to[2] - at[2]) / across)
            at = to
    return speeds


@given(legs, bounded, st.floats(1.5, 20.0))
def test_no_leg_is_faster_than_the_mission(
    route: list[tuple[float, float, float]], family: Family, maximum_speed: float
) -> None:
    plan = items_of(mission(route, maximum_speed), family)
    assert max(leg_speeds(plan)) <= 1.04 * maximum_speed


@pytest.mark.parametrize("family", [PX4, ARDUPILOT, GENERIC], ids=lambda one: one.name)
def test_a_level_leg_behind_a_climb_is_flown_at_the_whole_speed(family: Family) -> None:
    plan = items_of(mission([(0, 30, 50.0), (90, 30, 50.0), (180, 30, 10.0)]), family)
    climb, level, descent, _ = leg_speeds(plan)
    assert climb == pytest.approx(5.0, rel=1e-3)
    assert level == pytest.approx(5.0)
    assert descent == pytest.approx(5.0, rel=1e-3)
    for command, done in zip(plan.commands, plan.done_item, strict=True):
        assert plan.items[done].command == mavlink.MAV_CMD_NAV_WAYPOINT
        assert plan.command_of_item[done] == command


@pytest.mark.parametrize("family", [PX4, ARDUPILOT, GENERIC], ids=lambda one: one.name)
def test_legs_that_are_nearly_level_need_no_speed_of_their_own(family: Family) -> None:
    flat, gentle = ([(0, 30, altitude), (90, 30, 10.0)] for altitude in (10.0, 17.0))
    speeds = [
        [item.command for item in items_of(mission(route), family).items]
        for route in (flat, gentle)
    ]
    assert speeds[0] == speeds[1]


def test_the_projects_vehicle_bounds_the_vector_itself() -> None:
    plan = items_of(mission([(0, 30, 50.0), (90, 30, 10.0)]), OWN)
    assert [item.parameters[1] for item in plan.items if item.command == SPEED] == [5.0]


@given(legs, bounded, st.floats(0.1, 20.0))
def test_another_speed_changes_no_other_item(
    route: list[tuple[float, float, float]], family: Family, maximum_speed: float
) -> None:
    """An event changes the speed while the vehicle holds the items."""
    held, changed = (items_of(mission(route, speed), family) for speed in (5.0, maximum_speed))
    assert [item.command for item in held.items] == [item.command for item in changed.items]
    assert held.done_item == changed.done_item


def test_the_leg_to_a_live_command_is_bounded_too() -> None:
    place = shifted(START["latitude"], START["longitude"], 0.0, 30.0)
    orbit = {
        "latitude": place[0],
        "longitude": place[1],
        "orbit_altitude": 60.0,
        "radius": 10.0,
        "start_point": 1,
    }
    document = mission([(0, 30, 10.0)]).model_dump(mode="json")
    document["command_array"][1] |= {"command_type_id": 7, "parameters": orbit}
    speeds = {}
    for family in (PX4, OWN):
        segments = translate(Mission.model_validate(document), family, HOME).segments
        live = next(one for one in segments if isinstance(one, LiveCommand))
        speeds[family.name] = live.action.approach_speed_m_s
    assert speeds["farm-flight"] == 5.0
    assert speeds["px4"] is not None
    assert 1.0 < speeds["px4"] < 2.5
