"""An event pauses a command that is flown live, and another one resumes the mission."""

import dataclasses

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import KNOWN_FAMILIES, PAUSED_MODES, SCRIPTS
from tests.support.broker_events import PAUSE, RESUME, RETURN_HOME, answer, answer_statuses
from tests.support.broker_world import World, follow, go_home, mission, takeoff, waypoint
from tests.support.mission_scenes import live, paused_live, slow, state
from tests.support.orders import orders
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_BRAKE,
    COPTER_GUIDED,
    COPTER_RETURN,
    PX4,
    PX4_FOLLOW,
    PX4_HOLD,
    PX4_RETURN,
)


@pytest.mark.first_case
@KNOWN_FAMILIES
def test_a_command_flown_live_begins_anew_when_the_mission_is_resumed(family: str) -> None:
    world = paused_live(SCRIPTS[family])
    vehicle = world.only_vehicle
    assert vehicle.custom_mode == PAUSED_MODES[family]
    since = len(vehicle.frames)
    world.run(100.0)
    assert orders(vehicle, since) == []
    assert world.edge.status(1201) == Status.RUNNING
    resume = world.edge.event(RESUME)
    world.run(12.0)
    assert answer_statuses(world, resume) == ["accepted", "done"]
    assert vehicle.custom_mode not in {PX4_HOLD, COPTER_BRAKE, COPTER_GUIDED}
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 3


@KNOWN_FAMILIES
def test_a_return_home_ends_it(family: str) -> None:
    world = paused_live(SCRIPTS[family])
    world.edge.event(RETURN_HOME)
    world.run(3.0)
    returning = COPTER_RETURN if family == "ardupilot" else PX4_RETURN
    assert world.only_vehicle.custom_mode == returning
    assert world.edge.statuses(1201) == [Status.FINISHED, Status.ABORTED, Status.ABORTED]


def test_a_return_home_waits_for_no_parameter() -> None:
    settings = {k: v for k, v in ARDUPILOT.settings.items() if k != "MIS_RESTART"}
    world = paused_live(dataclasses.replace(ARDUPILOT, settings=settings))
    world.edge.event(RETURN_HOME)
    world.run(3.0)
    assert world.only_vehicle.custom_mode == COPTER_RETURN


def test_a_refused_pause_lets_it_go_on() -> None:
    world = live(PX4)
    denied = mavlink.MAV_RESULT_DENIED
    results = {
        mavlink.MAV_CMD_DO_SET_MODE: denied,
        mavlink.MAV_CMD_DO_PAUSE_CONTINUE: denied,
    }
    world.run(12.0)
    before = world.only_vehicle.script
    world.only_vehicle.script = dataclasses.replace(before, results=results)
    pause = world.edge.event(PAUSE)
    world.run(5.0)
    assert answer(world, pause)[0] == "refused"
    world.only_vehicle.script = before
    assert world.only_vehicle.custom_mode == PX4_FOLLOW
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


@pytest.mark.first_case
@KNOWN_FAMILIES
def test_a_pause_between_items_and_a_live_command_ends_with_the_live_command(family: str) -> None:
    world = World()
    vehicle = world.add_vehicle(script=slow(SCRIPTS[family]))
    world.edge.plan(mission(takeoff(1), waypoint(2), follow(3), go_home(4)))
    world.run_until(lambda: state(world) is State.RUNNING and vehicle.airborne)
    world.run(1.0)
    world.edge.event(PAUSE)
    world.run(2.0)
    vehicle.current = len(vehicle.items) - 1  # It has braked behind its last waypoint
    vehicle.send(mavlink.MAVLink_mission_item_reached_message(vehicle.current))
    world.run(20.0)
    assert state(world) is State.RUNNING
    assert vehicle.custom_mode == PAUSED_MODES[family]
    resume = world.edge.event(RESUME)
    world.run_until_over(1201)
    assert answer_statuses(world, resume) == ["accepted", "done"]
    assert world.edge.status(1201) == Status.FINISHED
