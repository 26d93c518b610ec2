"""A broker that stands still for a while: its process was stopped, or its machine suspended.

Vehicles fly on meanwhile. The buffer of the link keeps the oldest datagrams and loses the newest,
so that the broker reads next what was true long ago.
"""

import dataclasses
import logging
from collections.abc import Callable
from typing import Final

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_events import ABORT, answer_statuses
from tests.support.broker_world import (
    FINISHED,
    World,
    flying_world,
    go_home,
    hotpoint,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import in_mission, live
from tests.support.orders import commands
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, COPTER_RETURN, PX4, PX4_HOLD, PX4_RETURN, Script

FAMILIES = pytest.mark.parametrize(
    ("script", "home"), [(PX4, PX4_RETURN), (ARDUPILOT, COPTER_RETURN)], ids=["px4", "ardupilot"]
)
PHASES = pytest.mark.parametrize("phase", [in_mission, live], ids=["mission", "live"])
STOPS = pytest.mark.parametrize(
    ("stopped_s", "is_full"), [(40.0, True), (4.0, False)], ids=["newest-lost", "short"]
)
"""Longer than a link takes to count as lost, and the buffer is full soon; and shorter."""
LONG_S: Final = 40.0
KEPT_S: Final = 3.0
"""What a buffer holds that is full soon."""


def stand_still(world: World, seconds: float, *, is_full: bool = True) -> None:
    """Suspend the broker; a full buffer has the first seconds alone."""
    world.suspend_broker(KEPT_S)
    world.suspend_broker(seconds - KEPT_S, is_full=is_full)


def return_meanwhile(world: World, home: int, seconds: float, *, is_full: bool) -> int:
    """Have somebody order a return while the broker stands still, and 2 s more pass.

    Gives how many frames the vehicle had by then.
    """
    stand_still(world, seconds, is_full=is_full)
    world.only_vehicle.set_mode(home)
    world.suspend_broker(2.0, is_full=is_full)
    return len(world.only_vehicle.frames)


@FAMILIES
@PHASES
@STOPS
def test_a_vehicle_that_was_taken_over_meanwhile_is_not_ordered(
    phase: Callable[[Script], World], script: Script, home: int, stopped_s: float, is_full: bool
) -> None:
    world = phase(script)
    ordered = return_meanwhile(world, home, stopped_s, is_full=is_full)
    world.run(30.0)
    assert commands(world.only_vehicle, ordered) == []
    if phase is live:  # A mission that ends with a return may have come to it unseen
        assert world.edge.status(1201) == Status.FAILED


@FAMILIES
@PHASES
@STOPS
def test_an_abort_meanwhile_does_not_end_the_return_that_somebody_ordered(
    phase: Callable[[Script], World], script: Script, home: int, stopped_s: float, is_full: bool
) -> None:
    world = phase(script)
    ordered = return_meanwhile(world, home, stopped_s, is_full=is_full)
    event = world.edge.event(ABORT)
    world.suspend_broker(0.5, is_full=is_full)
    world.run(10.0)
    assert commands(world.only_vehicle, ordered) == []
    if phase is live:
        assert answer_statuses(world, event)[-1] == "refused"


def test_what_follows_a_circle_that_ended_meanwhile_is_not_ordered() -> None:
    """The buffer holds the end of the circle, and not the return behind it."""
    world = World(tick_s=0.02)
    vehicle = world.add_vehicle(script=OWN)
    world.run(2.0)
    world.edge.plan(mission(takeoff(1), hotpoint(2, start_point=4), waypoint(3), go_home(4)))
    world.run_until(lambda: world.app.sessions[1].state is State.FLYING_LIVE)
    world.suspend_broker(30.0)
    assert vehicle.custom_mode == PX4_HOLD
    world.suspend_broker(10.0, is_full=True)
    vehicle.set_mode(PX4_RETURN)
    ordered = len(vehicle.frames)
    world.suspend_broker(1.5, is_full=True)
    world.run(30.0)
    assert commands(vehicle, ordered) == []


@FAMILIES
def test_a_mission_goes_on_behind_it(script: Script, home: int) -> None:
    del home
    world = in_mission(script)
    stand_still(world, LONG_S)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED


@FAMILIES
def test_an_abort_meanwhile_is_carried_out(script: Script, home: int) -> None:
    del home
    world = in_mission(script)
    vehicle = world.only_vehicle
    vehicle.script = dataclasses.replace(vehicle.script, item_time_s=2 * LONG_S)
    event = world.edge.event(ABORT)
    stand_still(world, LONG_S)
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.ABORTED
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")
    world.run_until(lambda: not vehicle.armed)


@FAMILIES
def test_a_mission_that_was_flown_to_its_end_meanwhile_is_not_aborted(
    script: Script, home: int
) -> None:
    del home
    world = in_mission(script)
    event = world.edge.event(ABORT)
    stand_still(world, LONG_S)
    assert not world.only_vehicle.armed
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")


def test_its_log_says_for_how_long(caplog: pytest.LogCaptureFixture) -> None:
    world = in_mission(PX4)
    stand_still(world, LONG_S)
    with caplog.at_level(logging.WARNING):
        world.run(1.0)
    (line,) = [one for one in caplog.messages if "stood still" in one]
    assert "for 40 s" in line


def test_the_transfer_of_a_log_is_ended_though_nothing_may_be_ordered_yet() -> None:
    """Some vehicles write no further log before; to end it changes nothing that they do."""
    world = flying_world()
    vehicle = world.only_vehicle
    world.run_until(lambda: "LOG_REQUEST_LIST" in kinds_of(vehicle, 0), within_s=200.0)
    asked = len(vehicle.frames)
    stand_still(world, LONG_S)
    world.run(0.5)
    assert "LOG_REQUEST_END" in kinds_of(vehicle, asked)


def kinds_of(vehicle: ScriptedVehicle, since: int) -> set[str]:
    """Kinds of the messages that a vehicle has received behind the first so many."""
    return {message.get_type() for message in vehicle.frames[since:]}
