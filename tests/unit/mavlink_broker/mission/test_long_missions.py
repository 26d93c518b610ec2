"""Missions with more items than their vehicle has space for; simulated time."""

import dataclasses
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.vehicle_script import ARDUPILOT, PX4, Script

COMMANDS = 150
AUTOPILOTS = pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])


def long_mission(count: int = COMMANDS) -> Any:
    rows = (waypoint(i, 10.0 + i % 40) for i in range(2, count))
    return mission(takeoff(1), *rows, go_home(count))


def long_world(script: Script, most_items: int) -> World:
    world = World()
    world.add_vehicle(script=dataclasses.replace(script, most_items=most_items, item_time_s=0.1))
    world.edge.plan(long_mission())
    return world


@pytest.mark.first_case
@AUTOPILOTS
@pytest.mark.parametrize(("most_items", "parts"), [(120, 2), (60, 4)])
def test_one_is_flown_in_parts(script: Script, most_items: int, parts: int) -> None:
    world = long_world(script, most_items)
    vehicle = world.only_vehicle
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * COMMANDS
    assert vehicle.uploads >= parts
    assert vehicle.commands.count(mavlink.MAV_CMD_NAV_TAKEOFF) == 0
    assert "NO_SPACE" in str(world.edge.reports(1201)[-1]["message"])
    assert not vehicle.airborne


@pytest.mark.first_case
@AUTOPILOTS
def test_a_restarted_broker_recognises_the_parts(script: Script) -> None:
    world = long_world(script, 120)
    vehicle = world.only_vehicle
    world.run_until(lambda: vehicle.airborne and vehicle.current > 20)
    uploads = vehicle.uploads
    world.restart_broker()
    world.run(2.0)
    assert vehicle.uploads == uploads
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * COMMANDS


def test_a_vehicle_without_space_for_the_shortest_part_refuses_with_the_number() -> None:
    world = long_world(PX4, 10)
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FAILED
    assert "NO_SPACE for" in world.edge.reports(1201)[-1]["message"]
    assert not world.only_vehicle.airborne
