"""An abort of a vehicle that is out of reach is answered by that vehicle, not by its heartbeat.

The first heartbeat behind a lost link may be that of a vehicle that was restarted, or of another
one with the same system id; the time since boot follows it.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.phases.ending import FLOWN_TO_ITS_END
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import PX4_AND_ARDUPILOT
from tests.support.broker_events import ABORT, POINT, answer_statuses
from tests.support.broker_world import ELSEWHERE, World, first_flight
from tests.support.mission_scenes import REFUSING_RETURN, in_mission, slow, state, world_at
from tests.support.orders import ASKING
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import COPTER_RETURN, PX4, PX4_LAND, PX4_RETURN, Script

HERE = ("192.0.2.1", 14581)
ADDRESSES = pytest.mark.parametrize("address", [HERE, ELSEWHERE], ids=["same-port", "new-port"])
UPTIME_S = 50.0
AWAY_S = 8.0


def flying(script: Script, since: float = 0.0) -> tuple[World, ScriptedVehicle]:
    """A vehicle that flies its mission, and was switched on at that time of its world [s]."""
    world = World()
    world.run(since)
    vehicle = world.add_vehicle(script=slow(script))
    world.run(UPTIME_S)
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run(2.0)
    return world, vehicle


def abort_while_away(world: World, kind: int = ABORT) -> None:
    """Take the vehicle out of reach, and order the abort there."""
    world.air.vehicles = {}
    world.run(AWAY_S)
    world.edge.event(kind)
    world.run(1.0)
    assert answer_statuses(world, 2) == ["accepted"]
    assert world.edge.status(1201) == Status.RUNNING  # No order has reached it


def come_back(world: World, vehicle: ScriptedVehicle, address: tuple[str, int] = HERE) -> None:
    """Be received again, at first by a heartbeat."""
    vehicle.heartbeat()
    world.air.vehicles[address] = vehicle


def orders(vehicle: ScriptedVehicle) -> list[int]:
    """The commands that it was given, requests for messages left out."""
    return [command for command in vehicle.commands if command not in ASKING]


def switch_on_another(world: World, booted_at: float, script: Script = PX4) -> ScriptedVehicle:
    """One on the ground with the same system id, elsewhere."""
    other = ScriptedVehicle(1, script, booted_at=booted_at)
    come_back(world, other, ELSEWHERE)
    return other


@PX4_AND_ARDUPILOT
@ADDRESSES
@pytest.mark.parametrize("kind", [ABORT, EventType.RETURN_HOME], ids=["land", "return"])
def test_one_that_was_restarted_refuses_it(
    script: Script, address: tuple[str, int], kind: int
) -> None:
    world, vehicle = flying(script)
    abort_while_away(world, kind)
    vehicle.reboot(world.clock.now)
    vehicle.commands.clear()
    come_back(world, vehicle, address)
    world.run(15.0)
    assert answer_statuses(world, 2) == ["accepted", "refused"]
    assert "the vehicle was restarted" in world.edge.acknowledgements(2)[-1]["message"]
    assert orders(vehicle) == []
    assert state(world) is State.IDLE


@ADDRESSES
def test_one_that_was_restarted_refuses_it_also_between_its_heartbeat_and_its_clock(
    address: tuple[str, int],
) -> None:
    world, vehicle = flying(PX4)
    world.air.vehicles = {}
    world.run(AWAY_S)
    vehicle.reboot(world.clock.now)
    come_back(world, vehicle, address)
    world.run(0.2)
    world.edge.event(ABORT)
    world.run(15.0)
    assert answer_statuses(world, 2) == ["accepted", "refused"]


def test_one_that_shows_no_clock_any_more_is_waited_for_three_seconds() -> None:
    world, vehicle = flying(PX4)
    abort_while_away(world)
    vehicle.script = replace(vehicle.script, streams_unasked=False)
    vehicle.ignores_intervals = True
    vehicle.armed = vehicle.airborne = False
    for name in ("position", "attitude"):
        vehicle.stop_stream(name)
    come_back(world, vehicle)
    world.run(2.5)
    assert answer_statuses(world, 2) == ["accepted"]
    world.run(2.0)
    assert answer_statuses(world, 2) == ["accepted", "done"]


@PX4_AND_ARDUPILOT
@ADDRESSES
def test_the_same_one_that_flies_on_is_ordered_to_land(
    script: Script, address: tuple[str, int]
) -> None:
    world, vehicle = flying(script)
    abort_while_away(world)
    come_back(world, vehicle, address)
    world.run_until(lambda: answer_statuses(world, 2)[-1] == "done", within_s=10.0)
    assert vehicle.custom_mode == (PX4_LAND if script is PX4 else 9)
    world.run_until(lambda: not vehicle.armed, within_s=60.0)
    assert answer_statuses(world, 2) == ["accepted", "done"]


@PX4_AND_ARDUPILOT
@ADDRESSES
def test_the_same_one_that_has_landed_meanwhile_has_done_it(
    script: Script, address: tuple[str, int]
) -> None:
    world, vehicle = flying(script)
    abort_while_away(world)
    vehicle.armed = vehicle.airborne = False
    come_back(world, vehicle, address)
    world.run_until(lambda: answer_statuses(world, 2)[-1] == "done", within_s=5.0)


def has_begun_since(world: World, vehicle: ScriptedVehicle) -> float:
    del vehicle
    return world.clock.now


def is_behind(world: World, vehicle: ScriptedVehicle) -> float:
    del world
    return vehicle.booted_at + 30.0


def is_ahead(world: World, vehicle: ScriptedVehicle) -> float:
    del world
    return vehicle.booted_at - 30.0


CLOCKS = pytest.mark.parametrize("booted_at", [has_begun_since, is_behind, is_ahead])


@PX4_AND_ARDUPILOT
@CLOCKS
def test_another_one_on_the_ground_does_not_answer_it(
    script: Script, booted_at: Callable[[World, ScriptedVehicle], float]
) -> None:
    """One that was just switched on may be the same, restarted; of any other none is believed."""
    world, vehicle = flying(script, since=40.0)
    abort_while_away(world)
    other = switch_on_another(world, booted_at(world, vehicle))
    world.run(20.0)
    assert orders(other) == []
    if booted_at is has_begun_since:
        assert answer_statuses(world, 2) == ["accepted", "refused"]
        return
    assert answer_statuses(world, 2) == ["accepted"]
    come_back(world, vehicle)
    world.run_until(lambda: answer_statuses(world, 2)[-1] == "done", within_s=10.0)
    world.run_until(lambda: not vehicle.armed, within_s=60.0)
    assert orders(other) == []


@pytest.mark.parametrize("booted_at", [is_behind, is_ahead])
def test_another_one_that_sends_its_clock_when_asked_does_not_answer_it(
    booted_at: Callable[[World, ScriptedVehicle], float],
) -> None:
    world, vehicle = flying(PX4, since=40.0)
    abort_while_away(world)
    other = switch_on_another(world, booted_at(world, vehicle), replace(PX4, streams_unasked=False))
    world.run(20.0)
    assert orders(other) == []
    assert answer_statuses(world, 2) == ["accepted", "refused"]


@pytest.mark.parametrize("heartbeats", [1, 2])
def test_a_few_heartbeats_of_another_one_do_not_answer_it(heartbeats: int) -> None:
    world, vehicle = flying(PX4)
    abort_while_away(world)
    other = ScriptedVehicle(1, PX4, booted_at=world.clock.now - 1.0)
    for name in ("position", "attitude"):
        other.stop_stream(name)
    come_back(world, other, ELSEWHERE)
    world.run(float(heartbeats))
    world.air.vehicles = {}
    world.run(10.0)
    assert answer_statuses(world, 2) == ["accepted"]
    come_back(world, vehicle)
    world.run_until(lambda: answer_statuses(world, 2)[-1] == "done", within_s=10.0)
    assert vehicle.custom_mode == PX4_LAND


def test_one_that_was_restarted_has_not_done_what_an_earlier_run_of_the_broker_ordered(
    tmp_path: Path,
) -> None:
    world = world_at(1, journal=tmp_path)
    vehicle = world.only_vehicle
    world.air.is_uplink_up = False
    world.edge.event(ABORT, abort=POINT)
    world.run(1.0)
    world.kill_broker()
    vehicle.reboot(world.clock.now)
    for name in ("position", "attitude"):
        vehicle.stop_stream(name)
    world.air.is_uplink_up = True
    world.run(1.0)
    world.restart_broker()
    world.run(2.0)
    assert answer_statuses(world, 2) == ["accepted"]
    boot_ms = round((world.clock.now - vehicle.booted_at) * 1e3)
    place = (round(degrees * 1e7) for degrees in vehicle.place)
    vehicle.send(mavlink.MAVLink_global_position_int_message(boot_ms, *place, *[0] * 6))
    world.run(1.0)
    assert answer_statuses(world, 2)[-1] == "refused"
    assert "restarted" in world.edge.acknowledgements(2)[-1]["message"]


@pytest.mark.parametrize("answer", ["obeys", "refuses", "none"])
def test_an_abort_says_if_the_vehicle_has_landed_without_an_answer(answer: str) -> None:
    """A link of one direction: the broker sees it fly its mission to the end."""
    world = in_mission(PX4)
    world.air.is_uplink_up = answer != "none"
    if answer == "refuses":
        vehicle = world.only_vehicle
        vehicle.script = replace(vehicle.script, results=REFUSING_RETURN)
    event = world.edge.event(ABORT)
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(2.0)
    last = world.edge.acknowledgements(event)[-1]
    assert last["status"] == ("refused" if answer == "none" else "done")
    assert (last.get("message") == FLOWN_TO_ITS_END) is (answer == "none")


def test_one_that_lands_last_and_was_restarted_has_not_finished_its_mission() -> None:
    world = in_mission(replace(PX4, goes_to_places=False))
    vehicle = world.only_vehicle
    world.run_until(lambda: world.edge.statuses(1201)[-1] == Status.RUNNING)
    world.air.vehicles = {}
    world.run(AWAY_S)
    vehicle.reboot(world.clock.now)
    come_back(world, vehicle)
    world.run(15.0)
    assert world.edge.status(1201) == Status.FAILED


def test_progress_of_one_that_has_not_shown_its_clock_does_not_count() -> None:
    """It has flown the same mission before; its link is active before the other one is missed."""
    world, vehicle = flying(PX4, since=40.0)
    other = ScriptedVehicle(1, PX4, booted_at=is_behind(world, vehicle))
    other.missions = vehicle.missions
    other.current, other.mission_state = len(vehicle.items) - 1, mavlink.MISSION_STATE_COMPLETE
    for one in (vehicle, other):
        one.ignores_intervals = True
        for name in ("position", "attitude"):
            one.stop_stream(name)
    come_back(world, other, ELSEWHERE)
    world.run(5.0)
    before = world.edge.statuses(1201)
    del world.air.vehicles[HERE]
    world.run(3.5)
    assert world.edge.statuses(1201) == before
    assert world.edge.status(1201) == Status.RUNNING


@PX4_AND_ARDUPILOT
@pytest.mark.parametrize("lost_s", [6.0, 14.0, 20.0])
def test_a_return_that_does_not_arrive_is_no_landing_later(script: Script, lost_s: float) -> None:
    """The vehicle is received all the time, and does not receive the broker."""
    world, vehicle = flying(script)
    world.air.is_uplink_up = False
    world.edge.event(EventType.RETURN_HOME)
    world.run(lost_s)
    world.air.is_uplink_up = True
    world.run(20.0)
    assert mavlink.MAV_CMD_NAV_LAND not in orders(vehicle)
    assert vehicle.custom_mode in {PX4_RETURN, COPTER_RETURN}
    assert answer_statuses(world, 2)[-1] == "done"
