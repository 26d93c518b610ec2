"""Parameters that a command needs are set before it begins, and are as they were behind it."""

import dataclasses
from typing import Any

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.autopilot_families import OWN, PX4_AND_ARDUPILOT
from tests.support.broker_world import (
    FINISHED,
    World,
    circle,
    follow,
    go_home,
    mission,
    panorama,
    takeoff,
    waypoint,
)
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, COPTER_FOLLOW, PX4, PX4_FOLLOW, Script


def setting_out(*commands: dict[str, Any], script: Script) -> tuple[World, ScriptedVehicle]:
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(*commands))
    return world, vehicle


def fly(*commands: dict[str, Any], script: Script) -> tuple[World, ScriptedVehicle]:
    world, vehicle = setting_out(*commands, script=script)
    world.run_until_over(1201, within_s=400.0)
    world.run(10.0)
    return world, vehicle


def message(world: World, command: int) -> str:
    return str(world.edge.reports(1201)[-1]["command_report_array"][command].get("message"))


@pytest.mark.first_case
@PX4_AND_ARDUPILOT
def test_a_follow_command_sets_height_distance_and_angle_and_restores_them(script: Script) -> None:
    world, vehicle = setting_out(takeoff(), follow(altitude=10.0), go_home(3), script=script)
    mode = PX4_FOLLOW if script is PX4 else COPTER_FOLLOW
    world.run_until(lambda: vehicle.custom_mode == mode)
    held = dict(vehicle.settings)
    world.run_until_over(1201)
    world.run(10.0)
    wanted = (
        {"FLW_TGT_HT": 10.0, "FLW_TGT_DST": 8.0, "FLW_TGT_FA": 180.0, "FLW_TGT_ALT_M": 0.0}
        if script is PX4
        else {"FOLL_ENABLE": 1.0, "FOLL_SYSID": 254.0, "FOLL_OFS_X": -8.0, "FOLL_YAW_BEHAVE": 1.0}
    )
    assert {name: held[name] for name in wanted} == wanted
    assert vehicle.settings == dict(script.settings)
    assert world.edge.statuses(1201) == FINISHED


@pytest.mark.first_case
@pytest.mark.parametrize("script", [PX4, OWN], ids=["px4", "own"])
@pytest.mark.parametrize(("planned", "lent"), [(1.0, 1.0), (8.0, 5.0)])
def test_a_follower_is_no_faster_than_the_mission(
    script: Script, planned: float, lent: float
) -> None:
    """Neither does the mission make it faster than it is set to be."""
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(), follow(), go_home(3)) | {"maximum_speed": planned})
    world.run_until(lambda: vehicle.custom_mode == PX4_FOLLOW)
    assert vehicle.settings["FLW_TGT_MAX_VEL"] == lent
    assert message(world, 1) == "None"
    world.run_until_over(1201)
    world.run(10.0)
    assert vehicle.settings == dict(script.settings)


@pytest.mark.first_case
@pytest.mark.parametrize("script", [PX4, OWN], ids=["px4", "own"])
def test_a_new_speed_is_that_of_a_follower_at_once(script: Script) -> None:
    world, vehicle = setting_out(takeoff(), follow(), go_home(3), script=script)
    world.run_until(lambda: vehicle.custom_mode == PX4_FOLLOW)
    assert vehicle.settings["FLW_TGT_MAX_VEL"] == 4.0
    world.edge.event(EventType.DRONE_SPEED, maximum_speed=1.5)
    world.run(5.0)
    assert vehicle.custom_mode == PX4_FOLLOW
    assert vehicle.settings["FLW_TGT_MAX_VEL"] == 1.5
    world.run_until_over(1201)
    world.run(10.0)
    assert vehicle.settings == dict(script.settings)


def test_a_follower_slower_than_it_can_be_set_is_noted() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), follow(), go_home(3)) | {"maximum_speed": 0.3})
    world.run_until(lambda: vehicle.custom_mode == PX4_FOLLOW)
    assert vehicle.settings["FLW_TGT_MAX_VEL"] == 0.5
    assert "maximum_speed: farm-flight follows no slower than 0.5 m/s" in message(world, 1)


def test_px4_follows_no_lower_than_it_can_and_the_report_notes_it() -> None:
    world, vehicle = setting_out(takeoff(), follow(altitude=3.0), go_home(3), script=PX4)
    world.run_until(lambda: vehicle.custom_mode == PX4_FOLLOW)
    assert vehicle.settings["FLW_TGT_HT"] == 8.0
    assert "altitude: px4 follows no lower than 8 m" in message(world, 1)


def test_a_circle_of_ardupilot_has_the_rate_of_the_command() -> None:
    world, vehicle = setting_out(takeoff(), circle(), go_home(3), script=ARDUPILOT)
    world.run_until(lambda: vehicle.airborne)
    assert vehicle.settings["CIRCLE_RATE"] == 5.0
    assert vehicle.settings["CIRCLE_OPTIONS"] == 2.0
    world.run_until_over(1201)
    world.run(10.0)
    assert vehicle.settings == dict(ARDUPILOT.settings)
    assert message(world, 1) == "None"


def test_two_circles_of_different_rates_are_two_segments() -> None:
    commands = takeoff(), circle(2), circle(3, angular_velocity=8.0), go_home(4)
    world, vehicle = fly(*commands, script=ARDUPILOT)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4
    rates = [value for name, value in vehicle.written if name == "CIRCLE_RATE"]
    assert rates == [5.0, 8.0, 20.0]
    assert vehicle.uploads == 2


def test_an_acceptance_radius_that_all_waypoints_share_is_set() -> None:
    _, vehicle = fly(takeoff(), waypoint(acceptance_radius=3.0), go_home(), script=ARDUPILOT)
    assert vehicle.written == [("WPNAV_RADIUS", 300.0), ("WPNAV_RADIUS", 200.0)]


def test_radii_that_differ_are_reported() -> None:
    commands = waypoint(2, acceptance_radius=3.0), waypoint(3, acceptance_radius=2.0)
    world, vehicle = fly(takeoff(), *commands, go_home(4), script=ARDUPILOT)
    assert vehicle.written == []
    assert "acceptance_radius: ardupilot uses its own" in message(world, 1)


@pytest.mark.thorough
def test_an_abort_restores_every_parameter() -> None:
    world, vehicle = setting_out(takeoff(), circle(), go_home(3), script=ARDUPILOT)
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.edge.event(EventType.ABORT_MISSION)
    world.run(60.0)
    assert world.edge.status(1201) == Status.ABORTED
    assert vehicle.settings == dict(ARDUPILOT.settings)


def test_a_vehicle_that_lacks_a_parameter_flies_and_the_report_names_it() -> None:
    script = dataclasses.replace(ARDUPILOT, settings={}, battery_capacity_mah=None)
    world, _ = fly(takeoff(), circle(), go_home(3), script=script)
    assert world.edge.statuses(1201) == FINISHED
    assert "parameter CIRCLE_RATE: no answer" in message(world, 1)
    assert "parameter CIRCLE_OPTIONS: no answer" in message(world, 1)


@pytest.mark.first_case
@pytest.mark.parametrize(("script", "mode", "pictures"), [(PX4, 0, 8), (ARDUPILOT, 1, 5)])
def test_a_panorama_behind_a_follow_is_turned_on_the_spot(
    script: Script, mode: int, pictures: int
) -> None:
    commands = takeoff(), follow(altitude=10.0), panorama(3, mode), go_home(4)
    world, vehicle = fly(*commands, script=script)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4
    sent = vehicle.parameters
    taken = [v for command, v in sent if command == mavlink.MAV_CMD_IMAGE_START_CAPTURE]
    assert len(taken) == pictures
    assert len({values[3] for values in taken}) == pictures
    assert "turns from picture to picture" in message(world, 2)
