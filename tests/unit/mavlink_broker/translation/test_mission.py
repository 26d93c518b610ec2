"""Missions to items and back: any valid mission of the flown kinds."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.enumerations import CommandType
from afarcloud.plan import Mission
from mavlink_broker.codec import Decoder, Encoder
from mavlink_broker.dialect import mavlink
from mavlink_broker.translation.commands import TRANSLATORS
from mavlink_broker.translation.families import ARDUPILOT, FAMILIES, GENERIC, PX4, Family
from mavlink_broker.translation.mission import FlightPlan, Home, RefusedError, translate
from mavlink_broker.translation.mission_item import from_message
from mavlink_broker.translation.read_back import difference

HOME = Home(40.4434, -3.7382, 650.0)
families = st.sampled_from([PX4, ARDUPILOT, GENERIC])
yaws = st.none() | st.floats(-180, 359.99)


def _place() -> dict[str, st.SearchStrategy[Any]]:
    return {"latitude": st.floats(-90, 90), "longitude": st.floats(-180, 180)}


PARAMETERS: dict[int, st.SearchStrategy[dict[str, Any]]] = {
    CommandType.NAV_TAKEOFF: st.fixed_dictionaries(
        {**_place(), "altitude": st.floats(0.5, 120), "yaw_angle": yaws},
        optional={"minimum_pitch": st.floats(0, 45)},
    ),
    CommandType.NAV_LAND: st.fixed_dictionaries(
        {**_place(), "desired_yaw_angle": yaws, "landing_altitude": st.floats(-50, 120)},
        optional={
            "minimum_target_altitude": st.floats(0, 120),
            "precision_land_mode": st.integers(0, 2),
        },
    ),
    CommandType.NAV_WAYPOINT: st.fixed_dictionaries(
        {**_place(), "altitude": st.floats(0, 120), "desired_yaw_angle": yaws},
        optional={
            "hold_time": st.floats(0, 3600),
            "acceptance_radius": st.floats(0.1, 50),
            "trajectory_control": st.floats(-50, 50),
        },
    ),
    CommandType.NAV_HOME: st.fixed_dictionaries({"landing": st.booleans()}),
}


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    kinds = draw(st.lists(st.sampled_from(sorted(PARAMETERS)), min_size=1, max_size=12))
    commands = [
        {"command_id": i, "command_type_id": int(kind), "parameters": draw(PARAMETERS[kind])}
        for i, kind in enumerate(kinds)
    ]
    return Mission.model_validate(
        {
            "mission_id": 1,
            "vehicle_id": 1,
            "maximum_speed": draw(st.floats(0.1, 100)),
            "command_array": commands,
        }
    )


def over_the_wire(plan: FlightPlan) -> list[Any]:
    encoder, decoder = Encoder(1, 1), Decoder()
    frames = [encoder.encode(message) for message in plan.messages(1, 1)]
    return [message for frame in frames for message in decoder.decode(frame)]


@given(missions(), families)
def test_every_item_belongs_to_a_command_and_commands_come_in_order(
    mission: Mission, family: Family
) -> None:
    plan = translate(mission, family, HOME)
    assert len(plan.command_of_item) == len(plan.items)
    assert list(plan.command_of_item) == sorted(plan.command_of_item)
    assert set(plan.command_of_item) == set(range(len(mission.command_array)))
    for command, done in enumerate(plan.done_item):
        assert plan.command_of_item[done] == command


@given(missions(), families)
def test_what_a_vehicle_gives_back_is_what_was_meant(mission: Mission, family: Family) -> None:
    plan = translate(mission, family, HOME)
    assert difference(plan, over_the_wire(plan), family) is None


@given(missions(), families, st.data())
def test_a_changed_item_is_noticed(mission: Mission, family: Family, data: st.DataObject) -> None:
    plan = translate(mission, family, HOME)
    held = over_the_wire(plan)
    places = [i for i, item in enumerate(plan.items) if item.is_positional and i >= plan.first_item]
    if not places:
        return
    index = data.draw(st.sampled_from(places))
    held[index].z += 1.0
    assert difference(plan, held, family) == f"item {index} on the vehicle differs in altitude"


@given(missions(), families)
def test_nothing_is_nan_but_the_yaw_of_waypoint_land_and_takeoff(
    mission: Mission, family: Family
) -> None:
    may = {mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_TAKEOFF}
    for item in translate(mission, family, HOME).items:
        numbers = (*item.parameters[:3], item.latitude_deg, item.longitude_deg, item.altitude_m)
        assert not any(math.isnan(number) for number in numbers)
        assert item.command in may or not math.isnan(item.parameters[3])


@given(missions(), families)
def test_a_waypoint_never_has_a_pass_radius(mission: Mission, family: Family) -> None:
    for item in translate(mission, family, HOME).items:
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            assert item.parameters[2] == 0.0


@given(missions(), families)
def test_the_speed_is_set_once_before_anything_flies(mission: Mission, family: Family) -> None:
    plan = translate(mission, family, HOME)
    speeds = [
        i for i, item in enumerate(plan.items) if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED
    ]
    assert speeds == [plan.first_item]
    assert plan.items[speeds[0]].parameters[:3] == (1.0, mission.maximum_speed, -1.0)


@given(missions(), families)
def test_a_mission_ends_on_the_ground_or_holding(mission: Mission, family: Family) -> None:
    plan = translate(mission, family, HOME)
    lands = {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}
    last = plan.items[-1].command
    assert (last in lands) == plan.ends_on_ground
    assert plan.ends_on_ground or last == mavlink.MAV_CMD_NAV_LOITER_UNLIM


@given(missions(), families)
def test_translation_depends_on_nothing_else(mission: Mission, family: Family) -> None:
    first, second = (translate(mission, family, HOME) for _ in range(2))
    assert repr(first) == repr(second)


@given(missions())
def test_ardupilot_has_home_first_and_px4_has_not(mission: Mission) -> None:
    plan = translate(mission, ARDUPILOT, HOME)
    assert plan.first_item == 1
    assert plan.items[0].frame == mavlink.MAV_FRAME_GLOBAL
    assert plan.items[0].altitude_m == HOME.altitude_amsl_m
    assert translate(mission, PX4, HOME).first_item == 0


def mission_with(*commands: dict[str, Any]) -> Mission:
    numbered = [{"command_id": i + 1} | c for i, c in enumerate(commands)]
    return Mission.model_validate({"mission_id": 1, "vehicle_id": 1, "command_array": numbered})


def test_home_without_landing_goes_home_at_the_height_of_the_command_before() -> None:
    plan = translate(
        mission_with(
            {
                "command_type_id": 3,
                "parameters": {"latitude": 40, "longitude": -3, "altitude": 33},
            },
            {"command_type_id": 11, "parameters": {"landing": False}},
        ),
        PX4,
        HOME,
    )
    go = plan.items[plan.done_item[1]]
    assert (go.latitude_deg, go.longitude_deg) == (HOME.latitude_deg, HOME.longitude_deg)
    assert go.altitude_m == 33


def test_a_takeoff_is_followed_by_a_waypoint_because_it_climbs_in_place() -> None:
    place = {"latitude": 40.1, "longitude": -3.1, "altitude": 7}
    plan = translate(mission_with({"command_type_id": 1, "parameters": place}), PX4, HOME)
    commands = [item.command for item in plan.items]
    assert commands == [178, 22, 16, 17]
    assert plan.done_item == (2,)


def test_what_is_left_out_is_said() -> None:
    place = {"latitude": 40.1, "longitude": -3.1, "altitude": 7, "trajectory_control": 2}
    plan = translate(mission_with({"command_type_id": 3, "parameters": place}), PX4, HOME)
    assert plan.notes == (("trajectory_control is not supported and was left out",),)


@pytest.mark.parametrize("kind", sorted(set(CommandType) - set(TRANSLATORS)))
def test_other_kinds_are_refused_by_id_and_reason(kind: CommandType) -> None:
    place = {"latitude": 40, "longitude": -3}
    parameters: dict[int, dict[str, Any]] = {
        CommandType.CAMERA_IMAGE: {"pitch_angle": -90},
        CommandType.NAV_HOTPOINT: place | {"orbit_altitude": 8, "radius": 10},
        CommandType.NAV_FOLLOW_TARGET: place | {"altitude": 8},
        CommandType.NAV_TRACK_SUBJECT: {"corners": [[0.1, 0.1], [0.9, 0.9]]},
    }
    command = {"command_type_id": int(kind), "parameters": parameters.get(kind, {})}
    with pytest.raises(RefusedError, match=f"command 1: {kind.name} cannot be flown yet"):
        translate(mission_with(command), PX4, HOME)


def test_frames_of_the_older_kind_are_read_as_their_integer_twins() -> None:
    plan = translate(
        mission_with(
            {"command_type_id": 3, "parameters": {"latitude": 1, "longitude": 2, "altitude": 3}}
        ),
        PX4,
        HOME,
    )
    message = over_the_wire(plan)[1]
    message.frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    assert from_message(message).frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT


def test_a_vehicle_that_holds_fewer_items_is_told_so() -> None:
    plan = translate(mission_with({"command_type_id": 11, "parameters": {}}), PX4, HOME)
    assert difference(plan, (), PX4) == "the vehicle holds 0 items instead of 2"


def test_families_are_told_by_the_heartbeat() -> None:
    assert FAMILIES[mavlink.MAV_AUTOPILOT_PX4] is PX4
    assert FAMILIES[mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA] is ARDUPILOT
