"""A broker that is killed in flight, again and again; `make soak` does it at every second."""

from pathlib import Path

import pytest

from mavlink_broker.mavlink.dialect import mavlink
from tests.soak.broker_death import (
    Death,
    eleven_commands,
    fly,
    judge_reports,
    sorties,
    sweep_scripted,
    uploads,
)
from tests.support.autopilot_families import OWN
from tests.support.broker_world import GENERIC, follow, go_home, hotpoint, takeoff, waypoint
from tests.support.vehicle_script import ARDUPILOT, PX4, Script

pytestmark = pytest.mark.scenario

DEATHS = (
    Death(5.0, 1.0),  # Waiting for the vehicle
    Death(10.0, 1.0),  # Taking off
    Death(20.0, 2.0),  # Taking pictures
    Death(30.0, 4.0),  # Circling
    Death(40.0, 1.0),
    Death(49.0, 0.0),  # Taking a panorama
    Death(57.0, 3.0),  # Going home
    Death(66.0, 30.0),  # Landing
)
LONG = {8, 9}
"""Commands that last a minute each."""
MIXED = (
    takeoff(1),
    waypoint(2),
    hotpoint(3, start_point=2),
    waypoint(4),
    follow(5),
    go_home(6),
)


def test_a_mission_is_flown_once_though_the_broker_dies_eight_times(tmp_path: Path) -> None:
    """Each command is ordered and reported once, and the vehicle ends where it took off."""
    flown = eleven_commands()
    commands = flown["command_array"]
    flown["command_array"] = [c for c in commands if c["command_type_id"] not in LONG]
    world = fly(flown, DEATHS, tmp_path)
    judge_reports(world.edge, flown)
    assert uploads(world) == 2  # One per stretch of items
    assert world.order_counts[mavlink.MAV_CMD_DO_ORBIT] == 1
    assert world.order_counts[mavlink.MAV_CMD_PANORAMA_CREATE] == 1
    assert world.pictures == 3 + 8
    assert max(world.place[:2], key=abs) < 1.0
    assert not world.is_armed


@pytest.mark.parametrize("script", [OWN, PX4, ARDUPILOT, GENERIC])
def test_a_mission_is_seen_to_its_end_on_other_autopilots(script: Script) -> None:
    assert sweep_scripted(MIXED, script, every_s=31.0, seed=1) >= 3


@pytest.mark.promise
def test_equal_sorties_are_distinguished() -> None:
    assert sweep_scripted(sorties(), PX4, every_s=7.0, seed=1) >= 4
