"""People who order one after the other: whoever has the vehicle last keeps it."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.armed_period import LEFT_BY_OTHERS
from tests.support.autopilot_families import PAUSED_MODES
from tests.support.broker_events import ABORT, PAUSE, RESUME, RETURN_HOME, answer
from tests.support.broker_world import (
    FAMILIES,
    FINISHED,
    GENERIC,
    World,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_reports import warning
from tests.support.mission_scenes import (
    at_its_waypoint,
    hovering_after_its_mission,
    on_its_way_home,
    paused,
)
from tests.support.orders import orders
from tests.support.other_parties import acknowledge, assert_that_the_next_mission_waits, lands
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_GUIDED,
    COPTER_LAND,
    COPTER_RETURN,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

SCRIPTS = {"px4": PX4, "ardupilot": ARDUPILOT}


def in_its_items(script: Script, journal: Path, *, is_paused: bool) -> World:
    """A mission that an event has paused, or has paused and resumed."""
    world = paused(script, journal)
    if not is_paused:
        world.edge.event(RESUME)
        world.run(3.0)
    return world


@pytest.mark.parametrize("is_restarted", [False, True])
@pytest.mark.parametrize("family", SCRIPTS)
def test_no_event_resumes_what_a_station_holds(
    family: str, tmp_path: Path, *, is_restarted: bool
) -> None:
    """The station has taken a vehicle that an event had paused, and leaves it in that mode."""
    world = paused(SCRIPTS[family], tmp_path)
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_DO_SET_MODE)
    vehicle.set_mode(PAUSED_MODES[family])
    vehicle.heartbeat()
    world.run(3.0)
    if is_restarted:
        world.restart_broker()
        world.run(8.0)
    since = len(vehicle.frames)
    event = world.edge.event(RESUME)
    world.run(3.0)
    assert answer(world, event) == (
        "refused",
        "system 255 has paused or moved the vehicle meanwhile",
    )
    assert orders(vehicle, since) == []


@pytest.mark.parametrize("family", SCRIPTS)
def test_without_a_journal_the_report_knows_who_holds_it(family: str, tmp_path: Path) -> None:
    """An event had paused it before the station did."""
    world = paused(SCRIPTS[family], tmp_path)
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_DO_SET_MODE)
    vehicle.set_mode(PAUSED_MODES[family])
    vehicle.heartbeat()
    world.run(8.0)
    world.kill_broker()
    for record in tmp_path.iterdir():
        record.unlink()
    world.restart_broker()
    world.run(8.0)
    since = len(vehicle.frames)
    event = world.edge.event(RESUME)
    world.run(3.0)
    assert answer(world, event)[0] == "refused"
    assert orders(vehicle, since) == []


@pytest.mark.parametrize("is_paused", [False, True])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_restarted_broker_orders_nothing_of_what_a_station_holds(
    script: Script, tmp_path: Path, *, is_paused: bool
) -> None:
    """Not even another speed, which an earlier run may have ordered."""
    world = in_its_items(script, tmp_path, is_paused=is_paused)
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_DO_REPOSITION)
    vehicle.set_mode(PX4_HOLD if script is PX4 else COPTER_GUIDED)
    vehicle.heartbeat()
    world.run(3.0)
    since = len(vehicle.frames)
    world.restart_broker()
    world.run(10.0)
    assert orders(vehicle, since) == []


@pytest.mark.first_case
@pytest.mark.parametrize("is_paused", [False, True])
@pytest.mark.parametrize(
    "command",
    [
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_DO_REPOSITION,
    ],
)
def test_who_takes_one_of_unknown_modes_has_it_behind_a_restart(
    command: int, tmp_path: Path, *, is_paused: bool
) -> None:
    world = in_its_items(GENERIC, tmp_path, is_paused=is_paused)
    vehicle = world.only_vehicle
    acknowledge(vehicle, command)
    world.run(2.0)
    since = len(vehicle.frames)
    world.restart_broker()
    world.run(3.0)
    event = world.edge.event(RESUME)
    world.run(6.0)
    assert answer(world, event)[0] == "refused"
    assert orders(vehicle, since) == []
    assert world.edge.status(1201) == Status.FAILED


@pytest.mark.parametrize("is_paused", [False, True])
def test_no_event_pauses_or_resumes_one_of_unknown_modes_in_its_failsafe(
    tmp_path: Path, *, is_paused: bool
) -> None:
    world = in_its_items(GENERIC, tmp_path, is_paused=is_paused)
    vehicle = world.only_vehicle
    vehicle.fail_safe(9)
    vehicle.heartbeat()
    world.run(1.0)
    since = len(vehicle.frames)
    event = world.edge.event(RESUME if is_paused else PAUSE)
    world.run(3.0)
    assert answer(world, event) == ("refused", "the vehicle's own failsafe holds it")
    assert orders(vehicle, since) == []


def test_an_event_that_pauses_what_a_station_has_paused_does_not_make_it_the_brokers() -> None:
    world = at_its_waypoint(PX4)
    vehicle = world.only_vehicle
    vehicle.set_mode(PX4_HOLD)
    acknowledge(vehicle, mavlink.MAV_CMD_DO_SET_MODE)
    vehicle.heartbeat()
    world.run(3.0)
    since = len(vehicle.frames)
    for number in (PAUSE, RESUME):
        event = world.edge.event(number)
        world.run(3.0)
        assert answer(world, event)[0] == "refused"
    assert orders(vehicle, since) == []


@FAMILIES
def test_who_disarms_one_that_hovers_for_the_broker_has_it(script: Script) -> None:
    world = hovering_after_its_mission(script)
    lands(world.only_vehicle)
    world.run(1.0)
    assert_that_the_next_mission_waits(world)


@FAMILIES
def test_so_has_who_disarms_one_in_the_middle_of_its_items(script: Script) -> None:
    world = at_its_waypoint(script)
    lands(world.only_vehicle)
    world.run(1.0)
    assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED


@pytest.mark.parametrize("is_restarted", [False, True])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_mission_that_a_station_disarms_on_its_last_leg_is_not_finished(
    script: Script, tmp_path: Path, *, is_restarted: bool
) -> None:
    world = on_its_way_home(script, tmp_path)
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    world.run(0.4)
    lands(vehicle)
    world.run(0.4)
    if is_restarted:
        world.restart_broker()
    assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED
    if is_restarted:
        world.restart_broker()
    world.run_until_over(1202)
    assert world.edge.statuses(1202) == FINISHED


@pytest.mark.parametrize("event", [ABORT, RETURN_HOME])
@pytest.mark.parametrize("delay_s", [1.0, 5.0, 12.0])
def test_a_pilot_who_takes_an_unknown_autopilot_behind_an_abort_has_it(
    event: int, delay_s: float
) -> None:
    world = at_its_waypoint(dataclasses.replace(GENERIC, landing_s=600.0))
    vehicle = world.only_vehicle
    world.edge.event(event)
    world.run_until(lambda: world.edge.status(1201) == Status.ABORTED)
    world.run(delay_s)
    vehicle.steer(PX4_POSITION)
    world.run(4.0)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


STATIONS_ORDERS = [
    mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_DO_REPOSITION,
]


@pytest.mark.parametrize("command", STATIONS_ORDERS)
@pytest.mark.parametrize("is_on_last_leg", [False, True], ids=["items", "return"])
def test_a_station_that_orders_an_unknown_autopilot_has_it(
    command: int, *, is_on_last_leg: bool
) -> None:
    world = (on_its_way_home if is_on_last_leg else at_its_waypoint)(GENERIC)
    vehicle = world.only_vehicle
    acknowledge(vehicle, command)
    since = len(vehicle.frames)
    world.run(8.0)
    assert world.edge.status(1201) == Status.FAILED
    event = world.edge.event(RETURN_HOME)
    world.run(3.0)
    assert answer(world, event)[0] == "refused"
    assert orders(vehicle, since) == []
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


@pytest.mark.parametrize("command", STATIONS_ORDERS)
def test_so_has_one_that_orders_it_behind_an_abort(command: int) -> None:
    world = at_its_waypoint(dataclasses.replace(GENERIC, landing_s=600.0))
    vehicle = world.only_vehicle
    world.edge.event(RETURN_HOME)
    world.run_until(lambda: world.edge.status(1201) == Status.ABORTED)
    world.run(6.0)
    acknowledge(vehicle, command)
    world.run(6.0)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


def test_a_station_that_resumes_the_mission_of_an_unknown_autopilot_gives_it_back() -> None:
    world = at_its_waypoint(GENERIC)
    vehicle = world.only_vehicle
    acknowledge(vehicle, mavlink.MAV_CMD_DO_REPOSITION)
    world.run(2.0)
    acknowledge(vehicle, mavlink.MAV_CMD_DO_SET_MODE)
    world.run(10.0)
    assert world.edge.status(1201) == Status.RUNNING


@pytest.mark.parametrize("event", [ABORT, RETURN_HOME])
def test_an_unknown_autopilot_that_an_abort_lands_needs_not_stand(event: int) -> None:
    world = at_its_waypoint(dataclasses.replace(GENERIC, landing_s=600.0))
    world.edge.event(event)
    world.run_until(lambda: world.edge.status(1201) == Status.ABORTED)
    world.run(20.0)
    lands(world.only_vehicle)
    world.run(2.0)
    assert LEFT_BY_OTHERS not in warning(world)


@pytest.mark.parametrize(
    ("script", "event", "mode"),
    [
        *((PX4, ABORT, PX4_RETURN), (PX4, RETURN_HOME, PX4_LAND)),
        *((ARDUPILOT, ABORT, COPTER_RETURN), (ARDUPILOT, RETURN_HOME, COPTER_LAND)),
    ],
    ids=["px4-rtl", "px4-land", "copter-rtl", "copter-land"],
)
def test_who_changes_the_way_it_comes_down_within_seconds_has_it(
    script: Script, event: int, mode: int
) -> None:
    world = at_its_waypoint(dataclasses.replace(script, landing_s=600.0))
    vehicle = world.only_vehicle
    world.edge.event(event)
    world.run_until(lambda: world.edge.status(1201) == Status.ABORTED)
    world.run(1.5)
    vehicle.set_mode(mode)
    vehicle.heartbeat()
    world.run(6.0)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


def test_one_that_is_sent_home_and_then_to_the_ground_is_the_brokers() -> None:
    world = at_its_waypoint(dataclasses.replace(PX4, landing_s=30.0))
    vehicle = world.only_vehicle
    world.edge.event(RETURN_HOME)
    world.run(1.0)
    world.edge.event(ABORT)
    world.run_until(lambda: not vehicle.armed, within_s=100.0)
    world.run(2.0)
    assert LEFT_BY_OTHERS not in warning(world)


@pytest.mark.parametrize("after_s", [5.6, 5.8, 6.0, 6.2, 6.4])
@pytest.mark.parametrize("family", SCRIPTS)
def test_a_pause_that_the_end_of_the_mission_overtakes_is_the_brokers(
    family: str, after_s: float
) -> None:
    """ArduPilot holds in a mode then that the broker orders for a pause alone."""
    world = World()
    script = dataclasses.replace(SCRIPTS[family], item_time_s=6.0, landing_s=8.0)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until(lambda: vehicle.airborne and world.edge.statuses(1201)[-1:] == [Status.RUNNING])
    world.run(after_s)
    world.edge.event(PAUSE)
    world.run(6.0)
    event = world.edge.event(ABORT)
    world.run(20.0)
    assert answer(world, event) == ("done", None)
    assert not vehicle.armed


@pytest.mark.parametrize("event", [ABORT, RETURN_HOME])
@pytest.mark.parametrize("delay_s", [0.2, 0.4])
@pytest.mark.parametrize("family", SCRIPTS)
def test_an_abort_replaces_a_pause_that_came_with_a_restarted_broker(
    family: str, delay_s: float, event: int, tmp_path: Path
) -> None:
    world = at_its_waypoint(dataclasses.replace(SCRIPTS[family], landing_s=8.0), tmp_path)
    vehicle = world.only_vehicle
    world.kill_broker()
    world.run(2.0)
    world.restart_broker()
    world.edge.event(PAUSE)
    world.run(delay_s)
    abort = world.edge.event(event)
    world.run_until(lambda: not vehicle.armed, within_s=60.0)
    world.run(2.0)
    assert answer(world, abort) == ("done", None)
    assert LEFT_BY_OTHERS not in warning(world)
