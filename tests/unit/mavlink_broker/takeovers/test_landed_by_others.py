"""Somebody else lands a vehicle where its own mission would land it, or while no broker looks."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.config import DEFAULT_SYSTEM_ID
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.armed_period import LEFT_BY_OTHERS
from tests.support.broker_events import RETURN_HOME
from tests.support.broker_world import (
    FAMILIES,
    FINISHED,
    GENERIC,
    World,
    first_flight,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_reports import messages, warning
from tests.support.mission_scenes import (
    at_its_waypoint,
    hovering_after_its_mission,
    on_its_way_home,
)
from tests.support.other_parties import (
    LATE_S,
    acknowledge,
    assert_that_the_next_mission_waits,
    lands,
)
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_LAND,
    COPTER_RETURN,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)


def in_its_return_mode(journal: Path | None = None) -> World:
    """The same with PX4, which flies an item that returns in its return mode."""
    world = on_its_way_home(dataclasses.replace(PX4, return_changes_mode=True), journal)
    world.run_until(lambda: world.only_vehicle.custom_mode == PX4_RETURN)
    world.run(2.0)
    return world


def land_in(vehicle: ScriptedVehicle, mode: int) -> None:
    """Somebody else orders a mode, in which the vehicle lands and disarms."""
    vehicle.set_mode(mode)
    lands(vehicle)


@pytest.mark.parametrize(
    ("script", "mode"),
    [(PX4, PX4_LAND), (ARDUPILOT, COPTER_LAND), (ARDUPILOT, COPTER_RETURN)],
    ids=["px4-land", "copter-land", "copter-rtl"],
)
def test_who_lands_it_on_its_way_home_has_it(script: Script, mode: int) -> None:
    world = on_its_way_home(script)
    vehicle = world.only_vehicle
    vehicle.set_mode(mode)
    vehicle.heartbeat()
    world.run(1.5)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED
    assert "somebody else flies the vehicle" in [m for m in messages(world) if m][-1]
    assert not world.edge.bodies("/alarm/")


def test_so_has_who_returns_one_that_its_mission_lands_elsewhere() -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=30.0, landing_s=600.0))
    world.edge.plan(mission(takeoff(1), waypoint(2), land(3)))
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.run_until(lambda: world.edge.statuses(1201)[-1] == Status.RUNNING, within_s=200.0)
    vehicle.set_mode(PX4_RETURN)
    vehicle.heartbeat()
    world.run(1.5)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED


def test_so_has_a_station_whose_order_leads_to_the_mode_of_the_return() -> None:
    """Only the acknowledgement shows who."""
    world = in_its_return_mode()
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    world.run(8.0)
    assert world.edge.status(1201) == Status.FAILED
    text = "system 255 has ordered it to come down by MAV_CMD_NAV_RETURN_TO_LAUNCH"
    assert text in [m for m in messages(world) if m][-1]
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


@pytest.mark.parametrize("addressee", ["everybody", "broker", "vehicle"])
def test_an_answer_to_no_other_system_shows_no_order_of_somebody_else(addressee: str) -> None:
    """PX4 acknowledges what its own modules order too."""
    world = in_its_return_mode()
    vehicle = world.only_vehicle
    systems = {"everybody": 0, "broker": DEFAULT_SYSTEM_ID, "vehicle": vehicle.system}
    acknowledge(vehicle, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, systems[addressee])
    world.run(8.0)
    lands(vehicle)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED


def test_so_it_has_for_a_broker_that_is_restarted_within_these_seconds(tmp_path: Path) -> None:
    """The acknowledgement was received by the run before, which has noted whose the mode is."""
    world = in_its_return_mode(tmp_path)
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    world.run(2.0)
    world.restart_broker()
    world.run(10.0)
    assert world.edge.status(1201) == Status.FAILED
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


def test_and_one_whose_order_comes_behind_that_of_an_abort() -> None:
    world = in_its_return_mode()
    vehicle = world.only_vehicle
    event = world.edge.event(RETURN_HOME)
    world.run_until(lambda: world.edge.acknowledgements(event)[-1:] != [])
    world.run(4.0)
    acknowledge(vehicle, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    world.run(2.0)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


@pytest.mark.parametrize("is_on_last_leg", [False, True], ids=["items", "return"])
@FAMILIES
def test_one_that_nobody_has_seen_land_stands_before_it_is_armed(
    script: Script, tmp_path: Path, *, is_on_last_leg: bool
) -> None:
    """The broker is killed in flight, and finds it disarmed; its mission was not complete."""
    fly = on_its_way_home if is_on_last_leg else at_its_waypoint
    world = fly(script, tmp_path)
    world.kill_broker()
    is_copter = script is ARDUPILOT
    land_in(world.only_vehicle, COPTER_LAND if is_copter else PX4_LAND)
    world.run(5.0)
    world.restart_broker()
    world.run(2.0)
    before = assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED or is_on_last_leg
    vehicle = world.only_vehicle
    world.run_until(lambda: vehicle.arm_orders > before, within_s=10.0 + LATE_S)


@pytest.mark.parametrize(
    "script",
    [
        *(PX4, ARDUPILOT, GENERIC),
        *(dataclasses.replace(one, sends_mission_state=False) for one in (PX4, ARDUPILOT)),
    ],
    ids=["px4", "ardupilot", "generic", "old-px4", "old-ardupilot"],
)
def test_one_whose_mission_has_landed_it_unseen_needs_not_stand(
    script: Script, tmp_path: Path
) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(3.0)
    world.kill_broker()
    world.run_until(lambda: not vehicle.armed)
    world.run(5.0)
    world.edge.plan(first_flight(mission_id=1202))
    before = vehicle.arm_orders
    world.restart_broker()
    world.run_until(lambda: vehicle.arm_orders > before, within_s=LATE_S)
    assert LEFT_BY_OTHERS not in warning(world)
    assert world.edge.statuses(1201) == FINISHED


def test_a_mission_that_fails_before_its_flight_delays_none() -> None:
    """A broker that was just started has never seen its vehicle armed either."""
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, refused_item=1))
    world.edge.plan(first_flight())
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FAILED
    vehicle.script = PX4
    vehicle.missions.script = PX4
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: vehicle.arm_orders > 0, within_s=LATE_S)


def pause_and_resume(world: World, *, is_resumption_seen: bool) -> None:
    """A station pauses the mission, and resumes it before its return begins."""
    vehicle = world.only_vehicle
    mode = vehicle.custom_mode
    vehicle.set_mode(PX4_HOLD)
    vehicle.heartbeat()
    acknowledge(vehicle, mavlink.MAV_CMD_DO_SET_MODE)
    world.run(4.0)
    vehicle.silent = not is_resumption_seen
    world.run(2.0)
    vehicle.set_mode(mode)
    vehicle.heartbeat()
    world.run(0.2)
    acknowledge(vehicle, mavlink.MAV_CMD_DO_SET_MODE)
    world.run(0.4)
    vehicle.set_mode(PX4_RETURN)
    vehicle.heartbeat()
    world.run(2.0)
    vehicle.silent = False


@pytest.mark.parametrize("is_resumption_seen", [False, True])
def test_a_station_that_has_resumed_the_mission_has_not_ordered_its_return(
    *, is_resumption_seen: bool
) -> None:
    """The link is away meanwhile, or the acknowledgement comes behind the mode that it led to."""
    world = on_its_way_home(dataclasses.replace(PX4, return_changes_mode=True))
    pause_and_resume(world, is_resumption_seen=is_resumption_seen)
    world.run(10.0)
    assert world.edge.status(1201) == Status.RUNNING
    lands(world.only_vehicle)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED
    assert LEFT_BY_OTHERS not in warning(world)


@pytest.mark.parametrize("hovers", [False, True], ids=["mission", "hover"])
@pytest.mark.parametrize("event", [103, 1], ids=["return", "land"])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_one_that_a_killed_broker_has_sent_down_needs_not_stand(
    script: Script, event: int, tmp_path: Path, *, hovers: bool
) -> None:
    fly = hovering_after_its_mission if hovers else at_its_waypoint
    world = fly(script, tmp_path)
    vehicle = world.only_vehicle
    world.edge.event(event)
    world.run(0.4)
    world.kill_broker()
    world.run_until(lambda: not vehicle.armed, within_s=200.0)
    world.run(5.0)
    world.edge.plan(first_flight(mission_id=1202))
    before = vehicle.arm_orders
    world.restart_broker()
    world.run_until(lambda: vehicle.arm_orders > before, within_s=15.0)
    assert LEFT_BY_OTHERS not in warning(world)


@pytest.mark.parametrize("is_on_last_leg", [False, True], ids=["items", "return"])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_one_that_is_landed_while_its_link_is_away_stands(
    script: Script, *, is_on_last_leg: bool
) -> None:
    world = on_its_way_home(script) if is_on_last_leg else at_its_waypoint(script)
    vehicle = world.only_vehicle
    vehicle.silent = True
    world.run(8.0)
    land_in(vehicle, COPTER_LAND if script is ARDUPILOT else PX4_POSITION)
    world.run(4.0)
    vehicle.silent = False
    world.run(1.0)
    assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED
    assert "somebody else flies the vehicle" in [m for m in messages(world) if m][-1]


@pytest.mark.parametrize(
    ("script", "is_on_last_leg"),
    [
        *((PX4, False), (PX4, True), (GENERIC, False), (GENERIC, True)),
        (dataclasses.replace(PX4, sends_mission_state=False), False),
    ],
    ids=["px4-items", "px4-return", "generic-items", "generic-return", "old-px4-items"],
)
def test_so_does_one_that_is_disarmed_in_its_mission_mode_before_the_end(
    script: Script, *, is_on_last_leg: bool
) -> None:
    world = on_its_way_home(script) if is_on_last_leg else at_its_waypoint(script)
    vehicle = world.only_vehicle
    vehicle.silent = True
    world.run(8.0)
    lands(vehicle)
    world.run(4.0)
    vehicle.silent = False
    world.run(1.0)
    assert_that_the_next_mission_waits(world)


@pytest.mark.parametrize("is_awaited", [False, True], ids=["idle", "mission-waits"])
@pytest.mark.parametrize("is_restarted", [False, True], ids=["link-away", "broker-killed"])
def test_so_does_one_that_hovered_for_the_broker(
    tmp_path: Path, *, is_restarted: bool, is_awaited: bool
) -> None:
    world = hovering_after_its_mission(PX4, tmp_path)
    vehicle = world.only_vehicle
    if is_restarted:
        world.kill_broker()
    vehicle.silent = True
    world.run(8.0)
    lands(vehicle)
    world.run(2.0)
    vehicle.silent = False
    if is_awaited:  # It comes before a heartbeat has shown that
        world.edge.plan(first_flight(mission_id=1202))
    if is_restarted:
        world.restart_broker()
    before = vehicle.arm_orders
    world.run(2.0)
    assert_that_the_next_mission_waits(world, mission_id=1203 if is_awaited else 1202)
    assert vehicle.arm_orders == before


@pytest.mark.parametrize("is_answer_late", [False, True])
def test_a_station_that_disarms_it_has_it(*, is_answer_late: bool) -> None:
    world = at_its_waypoint(PX4)
    vehicle = world.only_vehicle
    command = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    if is_answer_late:
        lands(vehicle)
        world.run(0.6)
        acknowledge(vehicle, command)
    else:
        acknowledge(vehicle, command)
        world.run(0.4)
        lands(vehicle)
    assert_that_the_next_mission_waits(world)


def killed_when_sent_down(journal: Path, *, hovers: bool) -> World:
    """A broker that is killed when it has ordered the vehicle to return: from a hover, or not."""
    world = (hovering_after_its_mission if hovers else at_its_waypoint)(PX4, journal)
    event = world.edge.event(RETURN_HOME)
    world.run_until(lambda: world.edge.acknowledgements(event)[-1:] != [])
    world.run(2.0)
    world.kill_broker()
    return world


@pytest.mark.parametrize("hovers", [False, True])
def test_one_that_returns_unseen_needs_not_stand_unless_it_is_taken_meanwhile(
    tmp_path: Path, *, hovers: bool
) -> None:
    for is_taken in (False, True):
        world = killed_when_sent_down(tmp_path / str(is_taken), hovers=hovers)
        vehicle = world.only_vehicle
        if is_taken:
            vehicle.steer(PX4_POSITION)
            world.run(2.0)
        lands(vehicle)
        world.run(5.0)
        world.edge.plan(first_flight(mission_id=1203))
        before = vehicle.arm_orders
        world.restart_broker()
        world.run(15.0)
        assert (vehicle.arm_orders > before) is not is_taken
