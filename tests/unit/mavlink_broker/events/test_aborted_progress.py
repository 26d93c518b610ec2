"""What an aborted mission is reported to have flown: all that the vehicle flew until it obeyed.

An order to end a mission can reach the vehicle late or never. What it flies meanwhile is flown.
"""

from datetime import timedelta
from typing import Final

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.abort_executor import UNHEARD_S
from mavlink_broker.mission.phases.ending import FLOWN_TO_ITS_END, MAY_BE_FLOWN
from mavlink_broker.mission.progress_monitor import ProgressMonitor
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import PX4_AND_ARDUPILOT
from tests.support.broker_events import ABORT, answer_statuses
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.mission_scenes import slow, state
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, HOME, PX4, Script

KINDS = pytest.mark.parametrize("kind", [ABORT, EventType.RETURN_HOME], ids=["land", "return"])
FLOWN, CUT = Status.FINISHED, Status.ABORTED
ITEM_S: Final = 6.0
"""How long the vehicle flies each item."""
LEGS: Final = 6
DEGREES_PER_M: Final = 9e-6
RETURN_TO_LAUNCH: Final[int] = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH


def flying(script: Script) -> tuple[World, ScriptedVehicle]:
    """A vehicle on the first waypoint of a mission of take-off, six waypoints and return."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    legs = (waypoint(number) for number in range(2, 2 + LEGS))
    world.edge.plan(mission(takeoff(1), *legs, go_home(2 + LEGS)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run_until(lambda: world.edge.statuses(1201)[1] == Status.RUNNING)
    return world, vehicle


def count(world: World, status: Status) -> int:
    return world.edge.statuses(1201).count(status)


@PX4_AND_ARDUPILOT
@KINDS
def test_what_was_flown_while_no_broker_ran_is_finished(script: Script, kind: int) -> None:
    world, vehicle = flying(script)
    world.kill_broker()
    world.run(3.0 * ITEM_S)
    event = world.edge.event(kind)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.status(1201) == CUT
    assert world.edge.statuses(1201) == [FLOWN] * 4 + [CUT] * 4
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")
    world.run_until(lambda: not vehicle.armed)


@PX4_AND_ARDUPILOT
def test_an_abort_is_not_kept_waiting_for_a_vehicle_that_shows_no_progress(script: Script) -> None:
    world, vehicle = flying(script)
    world.kill_broker()
    vehicle.stop_stream("mission")
    world.edge.event(ABORT)
    world.restart_broker()
    world.run(8.0)
    assert world.edge.status(1201) == CUT


@PX4_AND_ARDUPILOT
@KINDS
def test_a_mission_that_no_order_reaches_is_flown_and_finished(script: Script, kind: int) -> None:
    world, vehicle = flying(script)
    world.air.is_uplink_up = False
    event = world.edge.event(kind)
    world.run(2.5 * ITEM_S)
    assert world.edge.status(1201) == Status.RUNNING
    assert count(world, FLOWN) == 3
    world.run_until(lambda: not vehicle.armed)
    world.run_until_over(1201)
    assert set(world.edge.statuses(1201)) == {FLOWN}
    assert world.edge.acknowledgements(event)[-1] == {
        "status": "refused",
        "message": FLOWN_TO_ITS_END,
    }


@PX4_AND_ARDUPILOT
def test_what_is_flown_before_an_order_comes_through_is_finished(script: Script) -> None:
    world, vehicle = flying(script)
    world.air.is_uplink_up = False
    event = world.edge.event(ABORT)
    world.run(2.5 * ITEM_S)
    world.air.is_uplink_up = True
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")
    world.run_until_over(1201)
    assert world.edge.status(1201) == CUT
    assert count(world, FLOWN) == 3
    assert count(world, CUT) == LEGS - 1
    world.run_until(lambda: not vehicle.armed)


@PX4_AND_ARDUPILOT
def test_what_a_silent_vehicle_may_have_flown_is_said_to_be_unknown(script: Script) -> None:
    world, vehicle = flying(script)
    vehicle.silent = True
    world.run(8.0)
    world.edge.event(ABORT)
    world.run(UNHEARD_S - 5.0)
    assert world.edge.status(1201) == Status.RUNNING
    world.run(10.0)
    assert world.edge.status(1201) == CUT
    assert MAY_BE_FLOWN in str(world.edge.reports(1201)[-1])


@PX4_AND_ARDUPILOT
@KINDS
def test_a_broker_that_is_killed_before_the_vehicle_obeys_ends_the_mission_once(
    script: Script, kind: int
) -> None:
    world, vehicle = flying(script)
    world.air.is_uplink_up = False
    event = world.edge.event(kind)
    world.run(1.0)
    assert world.edge.status(1201) == Status.RUNNING
    world.kill_broker()
    world.run(1.5 * ITEM_S)
    world.air.is_uplink_up = True
    world.restart_broker()
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")
    world.run_until_over(1201)
    assert world.edge.status(1201) == CUT
    assert count(world, FLOWN) == 3
    world.run_until(lambda: not vehicle.armed)


@PX4_AND_ARDUPILOT
@KINDS
def test_what_was_flown_unseen_before_it_obeyed_unseen_is_finished(
    script: Script, kind: int
) -> None:
    world, vehicle = flying(script)
    world.air.is_downlink_up = False
    world.run(2.5 * ITEM_S)
    event = world.edge.event(kind)
    world.run(6.0)
    assert answer_statuses(world, event) == ["accepted"]
    world.air.is_downlink_up = True
    world.run_until_over(1201)
    assert world.edge.status(1201) == CUT
    assert count(world, FLOWN) == 3
    assert MAY_BE_FLOWN not in str(world.edge.reports(1201)[-1])
    world.run_until(lambda: not vehicle.armed)


@PX4_AND_ARDUPILOT
@pytest.mark.parametrize("away_s", [3.0, 5.0, 7.0, 8.0])
def test_an_abort_does_not_expire_while_it_waits_for_the_progress(
    script: Script, away_s: float
) -> None:
    """It came while no broker ran, and is valid for ten seconds."""
    world, vehicle = flying(script)
    world.kill_broker()
    event = world.edge.event(ABORT)
    expires_at = world.clock.utc() + timedelta(seconds=10.0)
    world.edge.work[event]["expires_at"] = expires_at.isoformat().replace("+00:00", "Z")
    world.run(away_s)
    world.restart_broker()
    world.run_until(lambda: answer_statuses(world, event)[-1:] == ["done"])
    world.run_until(lambda: not vehicle.armed)


@KINDS
def test_a_hold_from_before_the_order_is_no_obedience(kind: int) -> None:
    """The vehicle is resumed just before, and the link to it is away for eight seconds."""
    world = World()
    vehicle = world.add_vehicle(script=slow(PX4, heartbeats_at_once=False))
    legs = (waypoint(number) for number in range(2, 2 + LEGS))
    world.edge.plan(mission(takeoff(1), *legs, go_home(2 + LEGS)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run(ITEM_S)
    world.edge.event(EventType.PAUSE_MISSION)
    world.run(4.0)
    world.edge.event(EventType.RESUME_MISSION)
    world.run(0.2)
    assert vehicle.in_mission
    world.air.is_uplink_up = False
    event = world.edge.event(kind)
    world.run(8.0)
    assert world.edge.status(1201) == Status.RUNNING
    world.air.is_uplink_up = True
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")
    assert not vehicle.in_mission


@PX4_AND_ARDUPILOT
def test_a_mission_whose_start_has_arrived_is_flown_and_finished(script: Script) -> None:
    world = World(tick_s=0.05)
    vehicle = world.add_vehicle(script=slow(script, heartbeats_at_once=False))
    world.edge.plan(mission(takeoff(1), waypoint(2), go_home(3)))
    world.run_until(lambda: state(world) is State.STARTING and vehicle.in_mission)
    world.air.is_uplink_up = False
    world.edge.event(ABORT)
    world.run_until(lambda: vehicle.airborne)
    world.run_until(lambda: not vehicle.armed)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [FLOWN] * 3


@PX4_AND_ARDUPILOT
def test_a_vehicle_that_is_switched_off_while_it_lands_ends_its_mission(script: Script) -> None:
    world, vehicle = flying(script)
    world.air.is_uplink_up = False
    world.edge.event(ABORT)
    world.run_until(lambda: vehicle.items[vehicle.current].command == RETURN_TO_LAUNCH)
    vehicle.stop_stream("landed")
    world.run_until(lambda: not vehicle.armed)
    vehicle.silent = True
    world.run(UNHEARD_S + 10.0)
    assert world.edge.status(1201) in {FLOWN, CUT}


@PX4_AND_ARDUPILOT
def test_an_internal_error_while_it_is_followed_brings_the_vehicle_home(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    world, vehicle = flying(script)
    world.air.is_uplink_up = False
    world.edge.event(ABORT)
    world.run(1.0)
    with monkeypatch.context() as broken:
        broken.setattr(ProgressMonitor, "step", lambda *_: 1 // 0)
        world.run(0.5)
    world.air.is_uplink_up = True
    world.run_until(lambda: not vehicle.in_mission)
    world.run_until(lambda: not vehicle.armed)


def test_an_abort_of_a_paused_vehicle_that_was_not_reached_survives_a_restart() -> None:
    """ArduPilot pauses in BRAKE, which is the broker's mode while it is paused."""
    world, vehicle = flying(ARDUPILOT)
    world.edge.event(EventType.PAUSE_MISSION)
    world.run(3.0)
    world.air.is_uplink_up = False
    event = world.edge.event(ABORT)
    world.run(1.0)
    world.kill_broker()
    world.air.is_uplink_up = True
    world.restart_broker()
    world.run_until(lambda: answer_statuses(world, event)[-1] == "done")
    world.run_until(lambda: not vehicle.armed)


@PX4_AND_ARDUPILOT
def test_what_another_system_skips_meanwhile_is_not_flown(script: Script) -> None:
    """Waypoints 300 m apart, of which the vehicle is near none that is skipped."""
    world = World()
    vehicle = world.add_vehicle(script=slow(script))
    legs = (waypoint(number, 300.0 * (number - 1)) for number in range(2, 2 + LEGS))
    world.edge.plan(mission(takeoff(1), *legs, go_home(2 + LEGS)))
    world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
    world.run_until(lambda: world.edge.statuses(1201)[1] == Status.RUNNING)
    vehicle.place = HOME[0] + 300.0 * DEGREES_PER_M, HOME[1]
    world.run(3.0)
    world.air.is_uplink_up = False
    world.edge.event(ABORT)
    world.run(1.0)
    vehicle.begin_at(len(vehicle.items) - 1)
    world.run_until(lambda: not vehicle.armed)
    world.run_until_over(1201)
    assert CUT in world.edge.statuses(1201)


def test_a_mission_that_another_system_may_have_put_there_ends_in_doubt() -> None:
    """ArduPilot names no mission: its number of items changes, and it cannot be read back."""
    world, vehicle = flying(ARDUPILOT)
    world.air.is_uplink_up = False
    world.edge.event(ABORT)
    world.run(1.0)
    vehicle.store_foreign_mission([*vehicle.items, *vehicle.items[-3:]], acknowledged_to=255)
    world.run_until_over(1201)
    assert world.edge.status(1201) == CUT
    assert MAY_BE_FLOWN in str(world.edge.reports(1201)[-1])
