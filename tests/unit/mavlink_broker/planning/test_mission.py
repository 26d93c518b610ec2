"""Missions to items and back: any valid mission of the flown kinds."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.commands import FLYING
from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import ARDUPILOT, FAMILIES, GENERIC, OWN, PX4, Family
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import from_message
from mavlink_broker.mission.exchanges import difference
from mavlink_broker.planning.mission import FlightPlan, LiveCommand, translate
from mavlink_broker.planning.situation import RefusedError
from tests.support.stored_items import Keeping, as_ardupilot_keeps, as_px4_keeps
from tests.support.translated_missions import HOME, missions, over_the_wire, stretches_of

families = st.sampled_from([PX4, ARDUPILOT, GENERIC, OWN])


def plan_of(mission: Mission, family: Family) -> FlightPlan:
    """The stretch that a mission is, when nothing in it is flown live."""
    (plan,) = translate(mission, family, HOME).segments
    assert isinstance(plan, FlightPlan)
    return plan


@given(missions(), families)
def test_every_command_is_flown_once_and_in_order(mission: Mission, family: Family) -> None:
    segments = translate(mission, family, HOME).segments
    flown = [command for segment in segments for command in segment.commands]
    assert flown == list(range(len(mission.command_array)))


@given(missions(), families)
def test_every_item_belongs_to_a_command_and_commands_come_in_order(
    mission: Mission, family: Family
) -> None:
    for plan in stretches_of(mission, family):
        assert len(plan.command_of_item) == len(plan.items)
        assert list(plan.command_of_item) == sorted(plan.command_of_item)
        assert set(plan.command_of_item) == set(plan.commands)
        for command, done in zip(plan.commands, plan.done_item, strict=True):
            assert plan.command_of_item[done] == command


@given(missions(), families)
def test_what_a_vehicle_gives_back_is_what_was_meant(mission: Mission, family: Family) -> None:
    for plan in stretches_of(mission, family):
        assert difference(plan, over_the_wire(plan), family) is None


@pytest.mark.thorough
@given(missions(), families, st.data())
def test_a_changed_item_is_noticed(mission: Mission, family: Family, data: st.DataObject) -> None:
    plan = data.draw(st.sampled_from(stretches_of(mission, family)))
    held = over_the_wire(plan)
    places = [i for i, item in enumerate(plan.items) if item.is_positional and i >= plan.first_item]
    if not places:
        return
    index = data.draw(st.sampled_from(places))
    held[index].z += 1.0
    assert difference(plan, held, family) == f"item {index} on the vehicle differs in altitude"


@given(missions(), st.sampled_from([(PX4, as_px4_keeps), (ARDUPILOT, as_ardupilot_keeps)]))
def test_what_an_autopilot_keeps_of_its_mission_is_the_mission(
    mission: Mission, autopilot: tuple[Family, Keeping]
) -> None:
    """Whole numbers, radians and dropped parameters are how it stores, and no difference."""
    family, keeps = autopilot
    for plan in stretches_of(mission, family):
        held = [keeps(message) for message in over_the_wire(plan)]
        assert [item for item in held if isinstance(item, int)] == []
        assert difference(plan, held, family) is None


@given(missions(), families)
def test_nothing_is_nan_but_the_yaw_of_places_and_the_rates_of_gimbals(
    mission: Mission, family: Family
) -> None:
    may = {mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_TAKEOFF}
    for plan in stretches_of(mission, family):
        for item in plan.items:
            if item.command == mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW:
                no_rate = math.isnan(family.gimbal_rate_deg_s)
                unset = [math.isnan(number) for number in item.parameters]
                assert unset == [0, 0, no_rate, no_rate]
                continue
            if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
                assert math.isnan(item.parameters[3]) is math.isnan(family.hold_yaw_deg)
                continue
            numbers = (*item.parameters[:3], *(item.latitude_deg, item.longitude_deg))
            assert not any(math.isnan(number) for number in (*numbers, item.altitude_m))
            assert item.command in may or not math.isnan(item.parameters[3])


@given(missions(), families)
def test_a_waypoint_never_has_a_pass_radius(mission: Mission, family: Family) -> None:
    for plan in stretches_of(mission, family):
        for item in plan.items:
            if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
                assert item.parameters[2] == 0.0


@given(missions(), families)
def test_the_speed_is_set_once_in_each_stretch_before_anything_flies(
    mission: Mission, family: Family
) -> None:
    for plan in stretches_of(mission, family):
        if family.resets_speed_each_leg:
            continue
        places = [item.is_positional for item in plan.items[plan.first_item :]]
        speeds = [
            i - plan.first_item
            for i, item in enumerate(plan.items)
            if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED
        ]
        flies = any(mission.command_array[c].command_type_id in FLYING for c in plan.commands)
        assert len(speeds) == int(flies)
        if flies:
            speed = plan.items[plan.first_item + speeds[0]]
            assert not any(places[: speeds[0]])
            assert speed.parameters[:3] == (1.0, mission.maximum_speed, -1.0)


@given(missions())
def test_no_leg_of_arducopter_begins_at_its_own_speed(mission: Mission) -> None:
    """Behind its take-off and a circle it forgets the speed set before, which is set twice."""
    speed, forgets = mavlink.MAV_CMD_DO_CHANGE_SPEED, {18}
    for plan in stretches_of(mission, ARDUPILOT):
        before, speeds = 0, []
        for item in plan.items[plan.first_item :]:
            if item.command == speed:
                speeds.append(item.parameters[1])
            elif item.command <= mavlink.MAV_CMD_NAV_LAST:
                if before in forgets and item.command in {16, 17}:
                    assert speeds[:2] == [mission.maximum_speed] * 2
                    assert all(slower < mission.maximum_speed for slower in speeds[2:])  # A slope
                before, speeds = item.command, []
        first = plan.items[plan.first_item]
        if first.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            behind = plan.items[plan.first_item + 1 : plan.first_item + 3]
            assert [item.command for item in behind] == [speed] * 2


@given(missions(), families)
def test_a_stretch_ends_on_the_ground_or_holding(mission: Mission, family: Family) -> None:
    lands = {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}
    for plan in stretches_of(mission, family):
        last = plan.items[-1].command
        assert (last in lands) == plan.ends_on_ground
        assert plan.ends_on_ground or last == mavlink.MAV_CMD_NAV_LOITER_UNLIM
        assert not any(item.command in lands for item in plan.items[:-1])


@given(missions(), families)
def test_translation_depends_on_nothing_else(mission: Mission, family: Family) -> None:
    first, second = (translate(mission, family, HOME) for _ in range(2))
    assert repr(first) == repr(second)


@given(missions())
def test_ardupilot_has_home_first_and_px4_has_not(mission: Mission) -> None:
    for plan in stretches_of(mission, ARDUPILOT):
        assert plan.first_item == 1
        assert plan.items[0].frame == mavlink.MAV_FRAME_GLOBAL
        assert plan.items[0].altitude_m == HOME.altitude_amsl_m
    assert all(plan.first_item == 0 for plan in stretches_of(mission, PX4))


def mission_with(*commands: dict[str, Any]) -> Mission:
    numbered = [{"command_id": i + 1} | c for i, c in enumerate(commands)]
    return Mission.model_validate({"mission_id": 1, "vehicle_id": 1, "command_array": numbered})


def test_home_without_landing_goes_home_at_the_height_of_the_command_before() -> None:
    plan = plan_of(
        mission_with(
            {
                "command_type_id": 3,
                "parameters": {"latitude": 40, "longitude": -3, "altitude": 33},
            },
            {"command_type_id": 11, "parameters": {"landing": False}},
        ),
        PX4,
    )
    go = plan.items[plan.done_item[1]]
    assert (go.latitude_deg, go.longitude_deg) == (HOME.latitude_deg, HOME.longitude_deg)
    assert go.altitude_m == 33


def test_a_takeoff_is_followed_by_a_waypoint_because_it_climbs_in_place() -> None:
    place = {"latitude": 40.1, "longitude": -3.1, "altitude": 7}
    plan = plan_of(mission_with({"command_type_id": 1, "parameters": place}), PX4)
    commands = [item.command for item in plan.items]
    assert commands == [178, 22, 16, 17]
    assert plan.done_item == (2,)


def test_what_is_left_out_has_a_note() -> None:
    place = {"latitude": 40.1, "longitude": -3.1, "altitude": 7, "trajectory_control": 2}
    plan = plan_of(mission_with({"command_type_id": 3, "parameters": place}), PX4)
    assert plan.notes == (("trajectory_control is not supported and was left out",),)


@pytest.mark.parametrize(
    ("kind", "parameters", "family", "noted"),
    [
        (1, {"altitude": 5, "minimum_pitch": 10}, PX4, "minimum_pitch"),
        (2, {"landing_altitude": 2.0}, ARDUPILOT, "landing_altitude"),
        (2, {"minimum_target_altitude": 2.5}, ARDUPILOT, "minimum_target_altitude"),
        (2, {"minimum_target_altitude": 2.0}, PX4, "minimum_target_altitude"),
        (2, {"precision_land_mode": 1}, ARDUPILOT, "precision_land_mode"),
        (3, {"altitude": 5, "hold_time": 1.5}, ARDUPILOT, "hold_time"),
        (3, {"altitude": 5, "acceptance_radius": 20.0}, ARDUPILOT, "acceptance_radius"),
    ],
)
def test_a_parameter_that_is_not_honoured_is_named(
    kind: int, parameters: dict[str, Any], family: Family, noted: str
) -> None:
    place = {"latitude": 40.1, "longitude": -3.1}
    command = {"command_type_id": kind, "parameters": place | parameters}
    (notes,) = translate(mission_with(command), family, HOME).notes
    assert [note.split(":")[0].split(" ")[0] for note in notes] == [noted]


def test_a_circle_that_would_take_days_is_refused_before_take_off() -> None:
    place = {"latitude": 40, "longitude": -3, "orbit_altitude": 5, "radius": 5}
    slow = {"command_type_id": 7, "parameters": place | {"angular_velocity": 1e-300}}
    with pytest.raises(RefusedError, match="angular_velocity: a turn at 1e-300 deg/s takes"):
        translate(mission_with(slow), PX4, HOME)


def test_what_flies_behind_a_landing_is_refused_before_take_off() -> None:
    place = {"latitude": 40, "longitude": -3}
    land = {"command_type_id": 2, "parameters": place}
    waypoint = {"command_type_id": 3, "parameters": place | {"altitude": 5}}
    with pytest.raises(RefusedError, match="command 2: command_type_id: it follows a landing"):
        translate(mission_with(land, waypoint), PX4, HOME)


def test_a_second_take_off_begins_a_stretch_of_its_own() -> None:
    place = {"latitude": 40, "longitude": -3}
    takeoff = {"command_type_id": 1, "parameters": place | {"altitude": 5}}
    land = {"command_type_id": 2, "parameters": place}
    itinerary = translate(mission_with(takeoff, land, takeoff, land), PX4, HOME)
    assert [list(segment.commands) for segment in itinerary.segments] == [[0, 1], [2, 3]]
    assert itinerary.ends_on_ground


@pytest.mark.parametrize("family", [OWN, PX4, ARDUPILOT, GENERIC], ids=lambda one: one.name)
def test_a_mission_that_never_goes_anywhere_is_done_live_where_the_vehicle_is(
    family: Family,
) -> None:
    video = {"command_type_id": 5, "parameters": {}}
    picture = {"command_type_id": 4, "parameters": {"pitch_angle": -90}}
    panorama = {"command_type_id": 10, "parameters": {}}
    segments = translate(mission_with(video, picture, panorama), family, HOME).segments
    live = [segment.action for segment in segments if isinstance(segment, LiveCommand)]
    assert len(live) == 3
    assert not any(action.moves for action in live[:2])


def test_frames_of_the_older_kind_are_read_as_their_integer_twins() -> None:
    plan = plan_of(
        mission_with(
            {"command_type_id": 3, "parameters": {"latitude": 1, "longitude": 2, "altitude": 3}}
        ),
        PX4,
    )
    message = over_the_wire(plan)[1]
    message.frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    assert from_message(message).frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT


def test_a_vehicle_that_holds_fewer_items_differs_from_the_plan() -> None:
    plan = plan_of(mission_with({"command_type_id": 11, "parameters": {}}), PX4)
    assert difference(plan, (), PX4) == "the vehicle holds 0 items instead of 2"


def test_the_heartbeat_identifies_the_family() -> None:
    assert FAMILIES[mavlink.MAV_AUTOPILOT_PX4] is PX4
    assert FAMILIES[mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA] is ARDUPILOT
