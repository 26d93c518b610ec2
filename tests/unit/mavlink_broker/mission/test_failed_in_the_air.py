"""A mission that fails in the air: the vehicle does not wait there for orders."""

import dataclasses

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.autopilot_families import OWN
from tests.support.broker_world import GENERIC, World, go_home, hotpoint, mission, takeoff, waypoint
from tests.support.vehicle_script import PX4, PX4_HOLD, PX4_LAND, PX4_ORBIT, PX4_RETURN, Script

REFUSED = {mavlink.MAV_CMD_DO_ORBIT: mavlink.MAV_RESULT_DENIED}
COMMANDS = (takeoff(1), hotpoint(2, radius=50.0, start_point=4), waypoint(3), go_home(4))


def failed(script: Script) -> World:
    """A world whose vehicle has refused a circle in the air."""
    world = World()
    world.add_vehicle(script=script)
    world.edge.plan(mission(*COMMANDS))
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FAILED
    return world


@pytest.mark.first_case
@pytest.mark.parametrize("script", [OWN, PX4], ids=["own", "PX4"])
def test_it_returns_and_lands_and_flies_the_next_one(script: Script) -> None:
    world = failed(dataclasses.replace(script, results=REFUSED))
    vehicle = world.only_vehicle
    world.run(3.0)
    assert vehicle.custom_mode == PX4_RETURN
    world.edge.plan(mission(takeoff(), go_home(2), mission_id=1202))
    world.run_until_over(1202)
    assert world.edge.status(1202) == Status.FINISHED


def test_the_return_is_ordered_until_the_vehicle_obeys(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, results=REFUSED))
    world.edge.plan(mission(*COMMANDS))
    world.run_until(lambda: mavlink.MAV_CMD_DO_ORBIT in vehicle.commands)
    monkeypatch.setattr(vehicle, "set_mode", lambda _mode: None)
    world.run(5.0)
    assert vehicle.custom_mode not in {PX4_RETURN, PX4_LAND}
    monkeypatch.undo()
    world.run(4.0)
    assert vehicle.custom_mode == PX4_RETURN


def test_an_autopilot_whose_modes_are_unknown_gets_the_order_too() -> None:
    world = failed(dataclasses.replace(GENERIC, results=REFUSED))
    world.run(1.0)
    assert mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH in world.only_vehicle.commands


def test_one_that_another_system_has_stopped_is_left_to_it() -> None:
    world = World()
    vehicle = world.add_vehicle(script=PX4)
    world.edge.plan(mission(*COMMANDS))
    world.run_until(lambda: vehicle.custom_mode == PX4_ORBIT)
    world.run(2.0)
    vehicle.set_mode(PX4_HOLD)
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FAILED
    world.run(10.0)
    assert vehicle.custom_mode == PX4_HOLD


def test_no_order_goes_to_a_vehicle_on_the_ground() -> None:
    world = World()
    vehicle = world.add_vehicle(script=PX4)
    world.edge.plan(mission(hotpoint(1), go_home(2)))
    world.run_until_over(1201)
    world.run(5.0)
    assert mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH not in vehicle.commands
    assert vehicle.custom_mode == PX4_HOLD
