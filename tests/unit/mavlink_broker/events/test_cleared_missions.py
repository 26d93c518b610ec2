"""A ground station clears the mission that an event has paused: an event brings the vehicle down.

The mission fails in the air within seconds. Its vehicle hovers in the mode in which the broker
left it, so it is the broker's until somebody else takes it.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN, REAL_AUTOPILOTS
from tests.support.broker_events import (
    ABORT,
    RESUME,
    RETURN_HOME,
    SOFT_ABORT,
    answer,
    answer_statuses,
)
from tests.support.broker_world import GENERIC, World, flying_world
from tests.support.mission_scenes import paused
from tests.support.orders import orders
from tests.support.other_parties import STATION
from tests.support.real_autopilots import COPTER_4_1, COPTER_4_6, PX4_1_14, PX4_1_17
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_BRAKE,
    COPTER_LAND,
    COPTER_LOITER,
    COPTER_RETURN,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

SCRIPTS = {
    "px4": PX4,
    "px4 1.14": PX4_1_14,
    "px4 1.17": PX4_1_17,
    "own": OWN,
    "ardupilot": ARDUPILOT,
    "copter 4.1": COPTER_4_1,
    "copter 4.6": COPTER_4_6,
    "generic": GENERIC,
}
EVERY = pytest.mark.parametrize("script", SCRIPTS.values(), ids=SCRIPTS)


def cleared(script: Script, *, journal: Path | None = None, station: int | None = None) -> World:
    """A world whose paused mission has failed: a ground station has cleared it."""
    world = paused(script, journal)
    world.only_vehicle.clear_mission(acknowledged_to=station)
    world.edge.event(RESUME)
    world.run_until_over(1201, within_s=20.0)
    assert world.edge.status(1201) == Status.FAILED
    world.run(2.0)
    assert world.only_vehicle.airborne
    return world


def is_copter(world: World) -> bool:
    return bool(world.only_vehicle.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)


@pytest.mark.first_case
@EVERY
@pytest.mark.parametrize("kind", [ABORT, RETURN_HOME, SOFT_ABORT])
def test_an_event_brings_the_vehicle_down(script: Script, kind: int) -> None:
    world = cleared(script)
    world.run(60.0)
    event = world.edge.event(kind)
    world.run(3.0)
    ordered = (COPTER_LAND, PX4_LAND) if kind == ABORT else (COPTER_RETURN, PX4_RETURN)
    if script is GENERIC:
        last = [c for c, _ in world.only_vehicle.parameters][-1]
        lands = mavlink.MAV_CMD_NAV_LAND
        assert last == (lands if kind == ABORT else mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    else:
        assert world.only_vehicle.custom_mode == ordered[not is_copter(world)]
        world.run_until(lambda: not world.only_vehicle.armed)
        world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]


@pytest.mark.first_case
@EVERY
@pytest.mark.parametrize("station", [None, STATION], ids=["unseen", "seen"])
def test_the_report_names_what_has_happened(script: Script, station: int | None) -> None:
    world = cleared(script, station=station)
    who = "somebody else" if station is None else "system 255"
    reason = world.edge.reports(1201)[-1]["message"]
    assert reason.removeprefix(who) == " cleared the mission from the vehicle" or (
        reason == "somebody else cleared the mission from the vehicle"  # By its id, which is first
    )


@REAL_AUTOPILOTS
def test_the_vehicle_gets_no_order_until_the_event(script: Script) -> None:
    world = cleared(script)
    since = len(world.only_vehicle.frames)
    world.run(60.0)
    assert orders(world.only_vehicle, since) == []
    assert world.only_vehicle.airborne
    assert world.app.sessions[1].state is State.IDLE


@pytest.mark.first_case
@EVERY
@pytest.mark.parametrize("kind", [ABORT, RETURN_HOME])
def test_a_restarted_broker_brings_it_down_too(script: Script, kind: int, tmp_path: Path) -> None:
    world = cleared(script, journal=tmp_path)
    world.restart_broker()
    world.run(5.0)
    event = world.edge.event(kind)
    world.run(15.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert not world.only_vehicle.armed or script is GENERIC


@REAL_AUTOPILOTS
@pytest.mark.parametrize("kind", [ABORT, RETURN_HOME])
def test_a_broker_that_was_away_when_it_was_cleared_brings_it_down_too(
    script: Script, kind: int, tmp_path: Path
) -> None:
    world = paused(script, tmp_path)
    world.kill_broker()
    world.run(3.0)
    world.only_vehicle.clear_mission()
    world.run(3.0)
    world.restart_broker()
    world.run_until_over(1201, within_s=40.0)
    assert world.edge.status(1201) == Status.FAILED
    assert "cleared the mission" in world.edge.reports(1201)[-1]["message"]
    world.run(2.0)
    event = world.edge.event(kind)
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]


@REAL_AUTOPILOTS
def test_a_pilot_who_takes_it_keeps_it(script: Script) -> None:
    world = cleared(script)
    vehicle = world.only_vehicle
    mode = COPTER_LOITER if is_copter(world) else PX4_POSITION
    vehicle.steer(mode)
    world.tick()
    since = len(vehicle.frames)
    event = world.edge.event(ABORT)
    world.run(5.0)
    vehicle.is_manual = False
    vehicle.set_mode(COPTER_BRAKE if is_copter(world) else PX4_HOLD)
    world.run(1.5)
    later = world.edge.event(RETURN_HOME)
    world.run(5.0)
    assert orders(vehicle, since) == []
    assert answer_statuses(world, event) == ["refused"]
    name = world.app.sessions[1].vehicle.mode
    who = "where another system or its pilot has to move it"
    assert answer(world, later) == (
        "refused",
        f"no active mission: the vehicle is in {name}, {who}",
    )


@REAL_AUTOPILOTS
@pytest.mark.parametrize("restarts", ["never", "before it flies", "behind that"])
def test_a_ground_station_that_flies_its_own_mission_keeps_it(
    script: Script, restarts: str, tmp_path: Path
) -> None:
    world = paused(script, tmp_path)
    vehicle = world.only_vehicle
    items = vehicle.items[:-1]
    vehicle.clear_mission()
    world.run_until_over(1201, within_s=20.0)
    world.run(2.0)
    if restarts == "before it flies":
        world.kill_broker()
    vehicle.fly_foreign_mission(items)
    world.run(2.0)
    if restarts != "never":
        world.restart_broker()
        world.run(3.0)
    since = len(vehicle.frames)
    event = world.edge.event(ABORT)
    world.run(10.0)
    assert orders(vehicle, since) == []
    assert answer_statuses(world, event) == ["refused"]


@REAL_AUTOPILOTS
def test_one_that_replaces_the_mission_in_flight_keeps_it(script: Script) -> None:
    world = paused(script)
    vehicle = world.only_vehicle
    items = vehicle.items[:-1]
    world.edge.event(RESUME)
    world.run(2.0)
    vehicle.fly_foreign_mission(items)
    world.run_until_over(1201, within_s=20.0)
    assert "another mission" in world.edge.reports(1201)[-1]["message"]
    since = len(vehicle.frames)
    event = world.edge.event(ABORT)
    world.run(5.0)
    assert orders(vehicle, since) == []
    assert answer_statuses(world, event) == ["refused"]


@REAL_AUTOPILOTS
def test_a_mission_that_is_replaced_in_a_pause_leaves_the_vehicle_to_the_broker(
    script: Script,
) -> None:
    """Until the ground station flies its mission, the vehicle is where an event has stopped it."""
    world = paused(script)
    vehicle = world.only_vehicle
    vehicle.store_foreign_mission(vehicle.items[:-1], acknowledged_to=STATION)
    world.run_until_over(1201, within_s=20.0)
    world.run(2.0)
    event = world.edge.event(ABORT)
    world.run_until(lambda: not vehicle.armed)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]


@pytest.mark.parametrize(("ago_s", "is_named"), [(12.0, False), (1.0, True)])
def test_what_the_vehicle_has_said_long_before_is_not_the_reason(
    ago_s: float, *, is_named: bool
) -> None:
    """A ground station's order was refused, the flight went on, then the mission was cleared."""
    world = flying_world(replace(PX4, item_time_s=30.0))
    world.run(2.0)
    world.only_vehicle.send_status_text("DO_SET_MODE refused: No manual control input")
    world.run(ago_s)
    world.only_vehicle.clear_mission()
    world.run_until_over(1201, within_s=20.0)
    message = world.edge.reports(1201)[-1]["message"]
    assert "cleared the mission" in message
    assert ("No manual control input" in message) is is_named
