"""An operator changes their mind: an abort while the vehicle carries out the one before.

The first one has ended the mission and was answered; the vehicle is on its way home, or comes down.
"""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.autopilot_families import REAL_AUTOPILOTS
from tests.support.broker_events import ABORT, RETURN_HOME, SOFT_ABORT, answer, answer_statuses
from tests.support.broker_world import World, first_flight
from tests.support.mission_scenes import paused
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import (
    COPTER_LAND,
    COPTER_LOITER,
    COPTER_RETURN,
    HOME,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)


def is_copter(world: World) -> bool:
    return bool(world.only_vehicle.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)


def mode_of(world: World, kind: int) -> int:
    modes = (COPTER_LAND, PX4_LAND) if kind == ABORT else (COPTER_RETURN, PX4_RETURN)
    return modes[not is_copter(world)]


def aborted(script: Script, kind: int) -> World:
    """A world whose mission an event has ended in the air."""
    world = paused(script)
    event = world.edge.event(kind)
    world.run(4.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert world.edge.status(1201) == Status.ABORTED
    assert world.only_vehicle.custom_mode == mode_of(world, kind)
    assert world.only_vehicle.airborne
    return world


@pytest.mark.first_case
@REAL_AUTOPILOTS
@pytest.mark.parametrize(
    ("first", "second"),
    [(RETURN_HOME, ABORT), (ABORT, RETURN_HOME), (ABORT, SOFT_ABORT), (ABORT, ABORT)],
)
def test_the_second_event_is_carried_out(script: Script, first: int, second: int) -> None:
    world = aborted(script, first)
    event = world.edge.event(second)
    world.run(4.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert world.only_vehicle.custom_mode == mode_of(world, second)
    third = world.edge.event(first)
    world.run(4.0)
    assert answer_statuses(world, third) == ["accepted", "done"]
    assert world.only_vehicle.custom_mode == mode_of(world, first)


@pytest.mark.first_case
@REAL_AUTOPILOTS
@pytest.mark.parametrize("second", [RETURN_HOME, ABORT])
def test_the_same_number_of_a_fresh_edge_server_is_another_abort(
    script: Script, second: int
) -> None:
    """Each answer repeats the identity of its own event, whatever the numbers."""
    world = paused(script)
    number = world.edge.event(RETURN_HOME, identity="of the lost database")
    world.run(0.2)
    del world.edge.work[number]
    assert world.edge.event(second, identity="of the new one") == number
    world.run(4.0)
    answers = world.edge.acknowledgements(number)
    new = [one["status"] for one in answers if one["identity"] == "of the new one"]
    assert new == ["accepted", "done"]
    assert len(answers) > len(new)
    assert world.only_vehicle.custom_mode == mode_of(world, second)


@REAL_AUTOPILOTS
def test_so_it_is_behind_a_restart_that_finds_the_first_in_the_journal(
    script: Script, tmp_path: Path
) -> None:
    world = paused(script, tmp_path)
    vehicle = world.only_vehicle
    world.air.is_uplink_up = False
    number = world.edge.event(RETURN_HOME, identity="of the lost database")
    world.run(1.0)
    world.kill_broker()
    world.air.is_uplink_up = True
    del world.edge.work[number]
    assert world.edge.event(ABORT, identity="of the new one") == number
    world.restart_broker()
    world.run(12.0)
    answers = world.edge.acknowledgements(number)
    new = [one["status"] for one in answers if one["identity"] == "of the new one"]
    assert new == ["accepted", "done"]
    assert vehicle.custom_mode == mode_of(world, ABORT)


@REAL_AUTOPILOTS
def test_a_vehicle_that_a_pilot_has_taken_meanwhile_is_left_alone(script: Script) -> None:
    world = aborted(script, RETURN_HOME)
    vehicle = world.only_vehicle
    vehicle.set_mode(COPTER_LOITER if is_copter(world) else PX4_POSITION)
    world.run(3.0)
    vehicle.set_mode(mode_of(world, RETURN_HOME))  # By the pilot's own switch
    world.run(3.0)
    event = world.edge.event(ABORT)
    world.run(4.0)
    assert answer_statuses(world, event) == ["refused"]
    assert "its pilot has to move it" in (answer(world, event)[1] or "")
    assert vehicle.custom_mode == mode_of(world, RETURN_HOME)


@REAL_AUTOPILOTS
def test_on_the_ground_there_is_nothing_to_end(script: Script) -> None:
    world = aborted(script, ABORT)
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(2.0)
    event = world.edge.event(RETURN_HOME)
    world.run(4.0)
    assert answer_statuses(world, event) == ["refused"]


FAR = {"latitude": HOME[0] + 4e-4, "longitude": HOME[1], "altitude": 7.0}
"""So far away that the vehicle is on its way for some seconds."""


@REAL_AUTOPILOTS
@pytest.mark.parametrize("gap_s", [0.0, 0.4, 4.0])
@pytest.mark.parametrize("first", [RETURN_HOME, ABORT])
@pytest.mark.parametrize("second", [ABORT, SOFT_ABORT])
def test_a_vehicle_that_comes_down_flies_to_the_place_of_the_second_event(
    script: Script, first: int, second: int, gap_s: float
) -> None:
    """Its descent shows, or begins to show, when the order that replaces it is sent."""
    world = paused(script)
    vehicle = world.only_vehicle
    vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=True)
    before = world.edge.event(first)
    world.run(gap_s)
    event = world.edge.event(second, abort=FAR)
    world.run_until(lambda: len(answer_statuses(world, event)) == 2, within_s=120.0)
    assert answer_statuses(world, before)[-1] == "done"
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert vehicle.place == pytest.approx((FAR["latitude"], FAR["longitude"]))
    if second == ABORT:
        assert vehicle.custom_mode == mode_of(world, ABORT)
        return
    third = world.edge.event(ABORT)
    world.run(4.0)
    assert answer_statuses(world, third) == ["accepted", "done"]
    assert vehicle.custom_mode == mode_of(world, ABORT)


@REAL_AUTOPILOTS
def test_an_abort_of_what_waits_does_not_count_as_one_of_a_vehicle_that_a_pilot_flies(
    script: Script,
) -> None:
    world = aborted(script, RETURN_HOME)
    vehicle = world.only_vehicle
    vehicle.set_mode(COPTER_LOITER if is_copter(world) else PX4_POSITION)
    world.run(6.0)
    world.edge.plan(first_flight(1202))
    world.run(2.0)
    event = world.edge.event(ABORT)
    world.run(4.0)
    assert world.edge.status(1202) == Status.ABORTED
    assert answer_statuses(world, event)[-1] == "refused"
    assert "its pilot has to move it; the missions that waited were ended" in str(
        answer(world, event)[1]
    )
    assert vehicle.airborne


def moves(vehicle: ScriptedVehicle) -> int:
    """How often it was ordered to a place."""
    return sum(command == mavlink.MAV_CMD_DO_REPOSITION for command, _ in vehicle.parameters)


@REAL_AUTOPILOTS
def test_the_descent_of_the_first_event_may_show_behind_the_order_of_the_second(
    script: Script,
) -> None:
    """A vehicle takes some time to show a mode; its heartbeats are a second apart."""
    world = paused(script)
    vehicle = world.only_vehicle
    vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=True)
    world.edge.event(RETURN_HOME)
    world.run(0.4)
    event = world.edge.event(ABORT, abort=FAR)
    world.run_until(lambda: moves(vehicle) == 1, within_s=2.0)
    guided = vehicle.custom_mode
    vehicle.custom_mode = mode_of(world, RETURN_HOME)
    world.run(2.0)
    vehicle.custom_mode = guided
    world.run_until(lambda: len(answer_statuses(world, event)) == 2)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert vehicle.place == pytest.approx((FAR["latitude"], FAR["longitude"]))


@REAL_AUTOPILOTS
def test_a_vehicle_that_accepts_a_place_and_comes_down_on_has_not_obeyed(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = aborted(script, RETURN_HOME)
    vehicle = world.only_vehicle
    monkeypatch.setattr(vehicle, "set_mode", lambda _mode: None)
    here = {"latitude": vehicle.place[0], "longitude": vehicle.place[1], "altitude": 5.0}
    event = world.edge.event(SOFT_ABORT, abort=here)
    world.run(3.0)
    assert answer_statuses(world, event) == ["accepted"]
    monkeypatch.undo()
    world.run(3.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert vehicle.custom_mode != mode_of(world, RETURN_HOME)
