"""Whole missions by the whole broker, in simulated time."""

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.dialect import mavlink
from tests.support.broker_world import World, first_flight
from tests.support.scripted_vehicle import ARDUPILOT, PX4, Script

FINISHED = [Status.FINISHED] * 3


@pytest.mark.parametrize(
    "script", [PX4, ARDUPILOT, Script(autopilot=mavlink.MAV_AUTOPILOT_GENERIC)]
)
def test_a_mission_is_flown_and_every_command_reported(script: Script) -> None:
    world = World()
    world.add_vehicle(script=script)
    work = world.edge.plan(first_flight())
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED
    assert world.edge.statuses(1201) == FINISHED
    assert world.edge.acknowledgements(work) == [{"status": "accepted"}]
    assert len(world.edge.bodies("/pose/")) == 3
    assert len(world.edge.bodies("/battery/")) == 3
