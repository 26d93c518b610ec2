"""Somebody else had the vehicle armed: it stands disarmed for a while before a mission arms it.

Whoever has just landed it may be walking up to it. What counts is when the vehicle is ordered to
arm, and what the operator reads meanwhile.
"""

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.phases.waiting import WAITED
from mavlink_broker.mission.states import State
from mavlink_broker.vehicle.armed_period import ARMED_BY_OTHERS, LEFT_BY_OTHERS, STAND_S
from mavlink_broker.vehicle.control_authority import TAKEOVER_AFTER_S
from tests.support.broker_events import ABORT, PAUSE, RETURN_HOME, SPEED, answer_statuses
from tests.support.broker_world import (
    FAMILIES,
    FINISHED,
    GENERIC,
    World,
    first_flight,
    follow,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_reports import messages, warning
from tests.support.mission_scenes import in_mission
from tests.support.orders import orders
from tests.support.other_parties import LATE_S, assert_that_the_next_mission_waits, lands
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_LAND,
    COPTER_LOITER,
    COPTER_RETURN,
    COPTER_STABILIZE,
    PX4,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)


def flies_manually(vehicle: ScriptedVehicle) -> None:
    """A pilot arms the vehicle and takes off."""
    vehicle.armed = vehicle.airborne = True
    is_copter = vehicle.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    vehicle.steer(COPTER_LOITER if is_copter else PX4_POSITION)


def arms_on_the_ground(vehicle: ScriptedVehicle) -> None:
    vehicle.armed = True
    vehicle.heartbeat()


def flown_by_a_pilot(script: Script = PX4, *, flight_s: float = 20.0) -> World:
    """A pilot has just landed; a mission has come while he flew."""
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.run(12.0)
    flies_manually(vehicle)
    world.run(flight_s / 2)
    world.edge.plan(first_flight())
    world.run(flight_s / 2)
    lands(vehicle)
    return world


@FAMILIES
def test_a_mission_waits_after_a_pilots_landing(script: Script) -> None:
    world = flown_by_a_pilot(script)
    vehicle = world.only_vehicle
    since = len(vehicle.frames)
    world.run(STAND_S - 1.0)
    assert orders(vehicle, since) == []
    world.run_until(lambda: vehicle.armed, within_s=1.0 + LATE_S)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED


def test_vehicle_and_mission_say_why_and_for_how_long() -> None:
    world = flown_by_a_pilot()
    world.run(12.0)
    assert warning(world) in {f"{LEFT_BY_OTHERS}, and has for {n} s" for n in (10, 11, 12)}
    newest = world.edge.reports(1201)[-1]
    assert newest["mission_status_id"] == Status.NOT_STARTED
    assert newest["message"] in {f"{LEFT_BY_OTHERS}, and has for {n} s" for n in (8, 9, 10)}
    assert len(messages(world)) <= 4
    world.run_until(lambda: world.only_vehicle.armed)
    world.run(3.0)
    assert warning(world) == ""
    assert messages(world)[-1] == WAITED


def test_a_mission_that_comes_later_waits_for_the_rest_only() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(12.0)
    flies_manually(vehicle)
    world.run(10.0)
    lands(vehicle)
    world.run(20.0)
    world.edge.plan(first_flight())
    world.run(STAND_S - 20.0 - 1.0)
    assert vehicle.arm_orders == 0
    world.run_until(lambda: vehicle.armed, within_s=1.0 + LATE_S)


@FAMILIES
def test_the_wait_begins_anew_when_the_pilot_arms_again(script: Script) -> None:
    world = flown_by_a_pilot(script)
    vehicle = world.only_vehicle
    world.run(STAND_S - 5.0)
    arms_on_the_ground(vehicle)
    world.run(4.0)
    assert messages(world)[-1] == ARMED_BY_OTHERS
    lands(vehicle)
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == 0
    world.run_until(lambda: vehicle.armed, within_s=1.0 + LATE_S)


@FAMILIES
def test_armed_and_disarmed_on_the_ground_counts_as_a_flight(script: Script) -> None:
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.run(12.0)
    arms_on_the_ground(vehicle)
    world.run(2.0)
    lands(vehicle)
    world.edge.plan(first_flight())
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == 0
    world.run_until(lambda: vehicle.armed, within_s=1.0 + LATE_S)


@pytest.mark.parametrize("flight_s", [20.0, 55.0, 200.0])
def test_a_mission_that_has_begun_to_wait_does_not_fail_because_a_pilot_flies(
    flight_s: float,
) -> None:
    """Its limit of 60 s counts what the vehicle lacks, not how long somebody flies."""
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=25.0))
    world.run(12.0)
    world.edge.plan(first_flight())
    world.run(2.0)
    assert world.app.sessions[1].state is State.WAITING
    flies_manually(vehicle)
    world.run(flight_s)
    lands(vehicle)
    since = len(vehicle.frames)
    world.run(STAND_S - 1.0)
    assert orders(vehicle, since) == []
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED


def test_a_vehicle_that_is_not_ready_afterwards_fails_the_mission_as_ever() -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=1e6))
    world.run(12.0)
    flies_manually(vehicle)
    world.edge.plan(first_flight())
    world.run(5.0)
    lands(vehicle)
    world.run(STAND_S + 55.0)
    assert world.edge.status(1201) == Status.NOT_STARTED
    world.run_until_over(1201, within_s=15.0)
    assert "not ready after 60 s: it is not ready to arm" in messages(world)[-1]


@FAMILIES
def test_a_broker_that_finds_a_pilot_flying_waits_after_his_landing(script: Script) -> None:
    world = World()
    vehicle = world.add_vehicle(script=script)
    flies_manually(vehicle)
    world.run(15.0)
    world.restart_broker()
    world.edge.plan(first_flight())
    world.run(15.0)
    lands(vehicle)
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == 0
    world.run_until(lambda: vehicle.armed, within_s=1.0 + LATE_S)


def test_a_broker_without_a_journal_that_finds_the_vehicle_disarmed_begins_at_once() -> None:
    world = flown_by_a_pilot()
    world.run(6.0)
    assert LEFT_BY_OTHERS in messages(world)[-1]
    world.restart_broker()
    world.run_until(lambda: world.only_vehicle.armed, within_s=STAND_S - 6.0 - 2.0)
    world.run_until_over(1201)
    assert messages(world)[-1] == WAITED  # Not what the earlier run waited for


@pytest.mark.parametrize(
    ("script", "mode"), [(PX4, PX4_POSITION), (ARDUPILOT, COPTER_STABILIZE)], ids=["px4", "copter"]
)
def test_a_pilot_who_has_taken_the_vehicle_from_a_mission_has_the_same_time(
    script: Script, mode: int
) -> None:
    world = in_mission(script)
    vehicle = world.only_vehicle
    vehicle.steer(mode)
    world.run(10.0)
    assert world.edge.status(1201) == Status.FAILED
    world.edge.plan(first_flight(mission_id=1202))
    world.run(5.0)
    lands(vehicle)
    before = vehicle.arm_orders
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == before
    world.run_until(lambda: vehicle.arm_orders > before, within_s=1.0 + LATE_S)


@pytest.mark.parametrize("is_restarted", [False, True], ids=["same-broker", "restarted"])
@pytest.mark.parametrize(
    ("script", "mode"),
    [(PX4, PX4_LAND), (PX4, PX4_POSITION), (PX4, PX4_RETURN), (ARDUPILOT, COPTER_LAND)],
    ids=["px4-land", "px4-position", "px4-return", "copter-land"],
)
def test_so_has_one_who_takes_it_and_puts_it_down_within_seconds(
    script: Script, mode: int, *, is_restarted: bool, tmp_path: Path
) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=60.0))
    world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), waypoint(3)))
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(7.0)
    vehicle.set_mode(mode)
    vehicle.heartbeat()
    world.run(0.7)
    if is_restarted:
        world.restart_broker()
        world.run(1.8)
    sent = len(vehicle.frames)
    lands(vehicle)
    before = assert_that_the_next_mission_waits(world)
    assert not [one for one in orders(vehicle, sent) if not one.startswith("PARAM_SET")]
    assert world.edge.status(1201) == Status.FAILED
    assert "somebody else flies the vehicle" in [m for m in messages(world) if m][-1]
    assert not world.edge.bodies("/alarm/")
    world.run_until(lambda: vehicle.arm_orders > before, within_s=1.0 + TAKEOVER_AFTER_S + LATE_S)


@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4-position", "copter-loiter"])
def test_so_has_one_who_takes_it_on_its_last_leg(script: Script) -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(script, landing_s=600.0))
    world.edge.plan(mission(takeoff(1), waypoint(2), land(3)))
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.run_until(lambda: world.edge.statuses(1201)[-1] == Status.RUNNING)
    flies_manually(vehicle)
    world.run(1.5)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)
    assert world.edge.status(1201) == Status.FAILED


@pytest.mark.parametrize("flies", ["items", "live", "aborted", "nothing"])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_so_has_one_whom_a_killed_broker_saw_and_the_restarted_one_did_not(
    script: Script, flies: str, tmp_path: Path
) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=dataclasses.replace(script, item_time_s=20.0))
    if flies == "nothing":
        world.run(12.0)
    else:
        second = follow(2) if flies == "live" else waypoint(2, hold_time=60.0)
        world.edge.plan(mission(takeoff(1), second, waypoint(3)))
        world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
        world.run(7.0 if flies != "live" else 30.0)
    flies_manually(vehicle)
    if flies == "aborted":
        world.run(1.0)
        world.edge.event(ABORT)  # Refused: the pilot has it
    world.run(1.5)
    world.kill_broker()
    lands(vehicle)
    world.edge.plan(first_flight(mission_id=1202))
    before = vehicle.arm_orders
    world.restart_broker()
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == before
    if flies != "nothing":
        last = [message for message in messages(world) if message][-1]
        assert ("aborted" if flies == "aborted" else "somebody else flies the vehicle") in last
    assert not world.edge.bodies("/alarm/")
    world.run_until(lambda: vehicle.arm_orders > before, within_s=1.0 + TAKEOVER_AFTER_S + LATE_S)


@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_mission_that_a_pilot_gave_back_unseen_was_flown(script: Script, tmp_path: Path) -> None:
    """A broker that was killed has noted him; the vehicle lands where the mission ends."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(3.0)
    mode = vehicle.custom_mode
    vehicle.steer(PX4_POSITION if script is PX4 else COPTER_STABILIZE)
    world.run(2.0)
    world.kill_broker()
    world.run(1.0)
    vehicle.is_manual = False
    vehicle.set_mode(mode)
    world.run_until(lambda: not vehicle.armed)
    world.run(60.0)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED
    assert not world.edge.bodies("/alarm/")


@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_so_has_one_who_takes_it_in_the_first_seconds_of_a_return(script: Script) -> None:
    world = in_mission(dataclasses.replace(script, landing_s=600.0))
    vehicle = world.only_vehicle
    event = world.edge.event(RETURN_HOME)
    world.run_until(lambda: "done" in answer_statuses(world, event))
    world.run(0.5)
    flies_manually(vehicle)
    world.run(0.5)
    vehicle.set_mode(PX4_POSITION if script is PX4 else COPTER_STABILIZE)
    vehicle.heartbeat()
    world.run(0.5)
    lands(vehicle)
    assert_that_the_next_mission_waits(world)


@pytest.mark.parametrize("event", [{"maximum_speed": 2.0}, {}], ids=["speed", "pause"])
def test_an_event_upon_his_landing_is_refused(event: dict[str, Any]) -> None:
    world = in_mission(PX4)
    vehicle = world.only_vehicle
    flies_manually(vehicle)
    world.run(1.0)
    lands(vehicle)
    world.run(0.5)
    sent = len(vehicle.frames)
    work = world.edge.event(SPEED if event else PAUSE, **event)
    world.run(TAKEOVER_AFTER_S + 1.0)
    assert answer_statuses(world, work)[-1] == "refused"
    assert "somebody else" in world.edge.acknowledgements(work)[-1]["message"]
    assert not [one for one in orders(vehicle, sent) if not one.startswith(("PARAM_SET", "LOG_"))]


@pytest.mark.parametrize("takes", ["hover", "return"])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_so_has_one_who_has_taken_it_after_the_end_of_a_mission(script: Script, takes: str) -> None:
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until_over(1201)
    world.run(2.0)
    if takes == "return":
        world.edge.event(RETURN_HOME)
        returns = {PX4_RETURN, COPTER_RETURN}
        world.run_until(lambda: vehicle.custom_mode in returns)
        world.run(4.0)
    flies_manually(vehicle)
    world.run(6.0)
    world.edge.plan(first_flight(mission_id=1202))
    world.run(2.0)
    lands(vehicle)
    before = vehicle.arm_orders
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == before
    world.run_until(lambda: vehicle.arm_orders > before, within_s=1.0 + LATE_S)


def test_a_vehicle_that_stays_armed_behind_a_restart_shows_what_its_mission_waits_for() -> None:
    """The broker was killed while it armed the vehicle, which disarms by no timeout of its own."""
    world = World()
    vehicle = world.add_vehicle(script=PX4)
    world.edge.plan(first_flight())
    world.run_until(lambda: 1 in world.app.sessions and world.app.sessions[1].state is State.ARMING)
    world.restart_broker()
    world.run(30.0)
    assert vehicle.armed
    assert messages(world)[-1] == ARMED_BY_OTHERS
    lands(vehicle)
    world.run_until(lambda: vehicle.airborne, within_s=STAND_S + LATE_S)


def test_who_arms_after_the_vehicle_has_refused_the_broker_is_somebody_else() -> None:
    denied = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_DENIED}
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, results=denied))
    world.edge.plan(first_flight())
    world.run_until_over(1201)
    vehicle.script = PX4
    arms_on_the_ground(vehicle)
    world.run(3.0)
    lands(vehicle)
    world.edge.plan(first_flight(mission_id=1202))
    before = vehicle.arm_orders
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == before


def test_another_vehicle_with_the_system_id_does_not_wait() -> None:
    world = flown_by_a_pilot()
    world.run(2.0)
    session: Any = world.app.sessions[1]
    session.vehicle.replace()
    world.run_until(lambda: world.only_vehicle.armed, within_s=STAND_S - 5.0)


def test_a_restart_of_the_vehicle_does_not_end_the_wait() -> None:
    """The battery is being changed."""
    world = flown_by_a_pilot()
    vehicle = world.only_vehicle
    world.run(4.0)
    vehicle.reboot(world.clock.now)
    world.run(STAND_S - 5.0)
    assert vehicle.arm_orders == 0
    world.run_until(lambda: vehicle.armed, within_s=1.0 + 3 * LATE_S)


@pytest.mark.parametrize("landing", [PX4_LAND, COPTER_LAND])
def test_a_pilots_automatic_landing_is_his(landing: int) -> None:
    script = PX4 if landing == PX4_LAND else ARDUPILOT
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.run(12.0)
    flies_manually(vehicle)
    world.edge.plan(first_flight())
    world.run(10.0)
    vehicle.is_manual = False
    vehicle.set_mode(landing)
    world.run_until(lambda: not vehicle.armed, within_s=20.0)
    world.run(STAND_S - 1.0)
    assert vehicle.arm_orders == 0
    world.run_until(lambda: vehicle.armed, within_s=1.0 + LATE_S)


def test_a_pilot_of_an_unknown_autopilot_is_known_to_a_restarted_broker(tmp_path: Path) -> None:
    """Its heartbeats have shown by their standard bits that a pilot would show in them."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=dataclasses.replace(GENERIC, item_time_s=60.0))
    world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), waypoint(3)))
    world.run_until(lambda: vehicle.airborne and world.edge.status(1201) == Status.RUNNING)
    world.run(7.0)
    world.kill_broker()
    flies_manually(vehicle)
    world.restart_broker()
    sent = len(vehicle.frames)
    world.run(2.0)
    event = world.edge.event(ABORT)
    world.run(10.0)
    assert answer_statuses(world, event)[-1] == "refused"
    assert not [one for one in orders(vehicle, sent) if not one.startswith("PARAM_SET")]
