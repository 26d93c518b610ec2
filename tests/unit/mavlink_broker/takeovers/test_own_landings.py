"""Landings that the broker has ordered: its next mission need not wait behind them."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.vehicle.armed_period import LEFT_BY_OTHERS, STAND_S
from tests.support.broker_events import ABORT, RETURN_HOME
from tests.support.broker_world import FAMILIES, FINISHED, World, first_flight
from tests.support.mission_reports import messages, warning
from tests.support.mission_scenes import in_mission, returning
from tests.support.other_parties import LATE_S, assert_that_the_next_mission_waits, lands
from tests.support.vehicle_script import ARDUPILOT, PX4, PX4_POSITION, PX4_RETURN, Script


@FAMILIES
@pytest.mark.parametrize("is_restarted", [False, True])
def test_nothing_waits_after_a_flight_of_the_broker(script: Script, *, is_restarted: bool) -> None:
    """Also one that an earlier run of the broker has begun."""
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne)
    if is_restarted:
        world.restart_broker()
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until_over(1201)
    orders_before = vehicle.arm_orders
    world.run_until(lambda: vehicle.arm_orders > orders_before, within_s=LATE_S)
    world.run_until_over(1202)
    assert world.edge.statuses(1202) == FINISHED
    assert not any(LEFT_BY_OTHERS in text for text in messages(world, 1202))


@pytest.mark.parametrize("killed_again_after_s", [0.4, 1.0, 1.6, 2.4, 5.0])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_flight_of_a_broker_that_is_killed_again_and_again_is_its_own(
    script: Script, killed_again_after_s: float, tmp_path: Path
) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(3.0)
    world.restart_broker()
    world.run(killed_again_after_s)
    world.kill_broker()
    world.run_until(lambda: not vehicle.armed)
    world.run(5.0)
    world.edge.plan(first_flight(mission_id=1202))
    before = vehicle.arm_orders
    world.restart_broker()
    world.run_until(lambda: vehicle.arm_orders > before, within_s=2 * LATE_S)
    assert LEFT_BY_OTHERS not in warning(world)


@pytest.mark.parametrize("event", [ABORT, RETURN_HOME], ids=["abort", "return-home"])
@FAMILIES
def test_a_landing_that_an_event_ordered_is_the_brokers(script: Script, event: int) -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=60.0))
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(3.0)
    world.edge.event(event)
    world.run_until(lambda: not vehicle.armed, within_s=300.0)
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: vehicle.armed, within_s=STAND_S - 10.0)


def test_a_return_that_the_broker_ordered_is_its_own() -> None:
    world = in_mission(PX4)
    vehicle = world.only_vehicle
    world.edge.event(ABORT)
    world.run_until(lambda: not vehicle.armed)
    before = vehicle.arm_orders
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: vehicle.arm_orders > before, within_s=LATE_S)


def test_so_is_one_that_an_earlier_run_has_ordered(tmp_path: Path) -> None:
    world, vehicle = returning(tmp_path)
    world.restart_broker()
    world.run(3.0)
    lands(vehicle)
    before = vehicle.arm_orders
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: vehicle.arm_orders > before, within_s=LATE_S)
    assert LEFT_BY_OTHERS not in warning(world)


def test_so_is_one_that_lands_before_the_restarted_broker_has_read_its_journal(
    tmp_path: Path,
) -> None:
    world, vehicle = returning(tmp_path)
    world.restart_broker()
    world.run_until(lambda: world.app.sessions)
    found = world.app.sessions[1].vehicle
    world.run_until(lambda: found.snapshot.armed, within_s=3.0)
    assert not found.recovery.tracker.is_loaded
    lands(vehicle)
    before = vehicle.arm_orders
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: vehicle.arm_orders > before, within_s=LATE_S)


def test_a_pilots_flight_behind_such_a_return_is_his(tmp_path: Path) -> None:
    world, vehicle = returning(tmp_path)
    world.kill_broker()
    vehicle.steer(PX4_POSITION)
    world.restart_broker()
    world.run(3.0)
    vehicle.is_manual = False
    vehicle.set_mode(PX4_RETURN)
    world.run(3.0)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)
