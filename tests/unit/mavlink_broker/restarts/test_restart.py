"""A broker that has just started, in the middle of what an earlier one began; simulated time."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.codec import Decoder
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    flying_world,
    follow,
    go_home,
    hotpoint,
    land,
    mission,
    panorama,
    takeoff,
    waypoint,
)
from tests.support.vehicle_script import ARDUPILOT, PX4, Script


def kinds_sent(world: World) -> set[str]:
    """Kinds of message that the broker has sent."""
    decoder = Decoder()
    return {m.get_type() for _, frame in world.air.sent for m in decoder.decode(frame)}


def test_a_mission_is_not_refused_for_what_the_vehicle_has_not_sent_yet() -> None:
    """A panorama on the ground: of this project's own vehicle, and of no other."""
    world = World()
    world.edge.plan(mission(panorama(1), takeoff(2), go_home(3)))
    world.run(1.0)
    assert world.edge.status(1201) is None
    world.add_vehicle(script=OWN)
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)


def test_what_its_vehicle_cannot_fly_is_refused_once_it_is_known() -> None:
    world = World()
    world.edge.plan(mission(panorama(1), takeoff(2), go_home(3)))
    world.run(1.0)
    vehicle = world.add_vehicle()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FAILED, Status.ABORTED, Status.ABORTED]
    assert vehicle.uploads == 0


def test_what_ended_meanwhile_is_reported_with_position_and_battery() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), hotpoint(start_point=4), waypoint(3), go_home(4)))
    world.run_until(lambda: vehicle.circle is not None)
    world.run(1.0)
    world.kill_broker()
    world.run_until(lambda: vehicle.circle is None)
    world.restart_broker()
    world.run_until_over(1201)
    assert len(world.edge.bodies("/pose/")) == len(world.edge.bodies("/battery/")) == 4


@pytest.mark.thorough
def test_a_time_that_lasts_is_counted_by_the_vehicles_clock_from_the_first_second() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), follow(), go_home(3)))
    world.run_until(lambda: vehicle.targets > 0)
    world.run(1.0)
    world.restart_broker()
    world.run_until_over(1201, within_s=100.0)
    assert world.edge.status(1201) == Status.FINISHED


@pytest.mark.first_case
@pytest.mark.parametrize("away_s", [0.5, 4.0, 20.0])
@pytest.mark.parametrize("stands_shown_after_s", [0.0, 1.5])
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_start_that_was_lost_with_its_broker_is_ordered_again(
    script: Script, stands_shown_after_s: float, away_s: float, tmp_path: Path
) -> None:
    """Armed, and not started: the vehicle disarms by itself, which ends no mission."""
    world = World(journal=tmp_path)
    script = dataclasses.replace(script, disarms_unstarted_s=10.0)
    vehicle = world.add_vehicle(script=dataclasses.replace(script, ignores_start=True))
    world.edge.plan(first_flight())
    world.run_until(lambda: mavlink.MAV_CMD_MISSION_START in vehicle.commands)
    world.kill_broker()
    vehicle.script = dataclasses.replace(script, sends_landed_state=False)
    world.run(away_s)
    world.restart_broker()
    world.run(stands_shown_after_s)
    vehicle.script = script
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED
    assert world.edge.bodies("/alarm/") == []
    messages = [report.get("message") for report in world.edge.reports(1201)]
    assert messages == [None] * len(messages)


@pytest.mark.first_case
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_pilot_who_has_armed_meanwhile_keeps_the_vehicle(script: Script, tmp_path: Path) -> None:
    """The start was lost with the broker, and the vehicle has disarmed by itself since."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=dataclasses.replace(script, ignores_start=True))
    world.edge.plan(first_flight())
    world.run_until(lambda: mavlink.MAV_CMD_MISSION_START in vehicle.commands)
    starts = vehicle.commands.count(mavlink.MAV_CMD_MISSION_START)
    world.kill_broker()
    vehicle.script = script
    world.run(30.0)
    world.restart_broker()
    world.run(60.0)
    assert vehicle.armed
    assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == starts
    assert world.edge.reports(1201)[-1]["message"] == "somebody else has armed it"
    vehicle.armed = False
    world.run(25.0)
    assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == starts
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED


def test_a_mission_that_was_over_before_anybody_saw_it_fly_is_not_flown_again() -> None:
    """Killed as soon as the vehicle was ordered to start, and back after its landing."""
    world = World()
    vehicle = world.add_vehicle()
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.kill_broker()
    world.run_until(lambda: vehicle.mission_state == mavlink.MISSION_STATE_COMPLETE)
    world.restart_broker()
    world.run_until_over(1201, within_s=30.0)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 3
    assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 1
    assert vehicle.uploads == 1


@pytest.mark.first_case
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_an_end_that_the_killed_broker_had_not_reported_is_found_again(script: Script) -> None:
    """The next mission does not replace the items by which the former one is judged."""
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.edge.plan(mission(takeoff(), waypoint(2, north_m=20.0), go_home(3), mission_id=1202))
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.edge.is_stalled = True
    world.run_until(lambda: not vehicle.armed, within_s=240.0)
    world.run(30.0)
    world.kill_broker()
    world.edge.is_stalled = False
    world.restart_broker()
    world.run_until_over(1202)
    assert world.edge.statuses(1201) == FINISHED
    assert world.edge.statuses(1202) == FINISHED


def test_the_same_segment_twice_is_flown_twice() -> None:
    """Killed between two sorties whose items are the same: the vehicle cannot distinguish them."""
    sortie = (takeoff(1), waypoint(2), land(3))
    world = World()
    vehicle = world.add_vehicle()
    world.edge.plan(mission(*sortie, takeoff(4), waypoint(5), land(6)))
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.run_until(lambda: world.edge.statuses(1201)[2] == Status.FINISHED)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 6
    assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 2


def test_a_vehicle_that_was_restarted_meanwhile_has_failed_its_mission() -> None:
    world = flying_world(dataclasses.replace(PX4, item_time_s=6.0))
    vehicle = world.only_vehicle
    world.kill_broker()
    world.run(20.0)
    vehicle.reboot(world.clock.monotonic())
    world.run(10.0)
    world.restart_broker()
    world.run_until_over(1201, within_s=30.0)
    assert world.edge.status(1201) == Status.FAILED
    assert "the vehicle was restarted" in world.edge.reports(1201)[-1]["message"]


@pytest.mark.thorough
def test_an_orbit_that_began_before_its_report_is_not_flown_again() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), hotpoint(radius=30.0, start_point=1), go_home(3)))
    world.run_until(lambda: vehicle.circle is not None)
    assert world.edge.statuses(1201)[1] == Status.NOT_STARTED
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 3
    assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) == 1


def test_a_link_that_is_lost_while_attaching_is_waited_out() -> None:
    world = flying_world(dataclasses.replace(PX4, item_time_s=100.0))
    world.restart_broker()
    world.run_until(lambda: 1 in world.app.sessions)
    session = world.app.sessions[1]
    world.air.sent.clear()
    world.run_until(lambda: "MISSION_REQUEST_LIST" in kinds_sent(world))
    world.only_vehicle.silent = True
    world.run(60.0)
    assert session.state is State.ATTACHING
    world.only_vehicle.silent = False
    world.run_until(lambda: session.state is State.RUNNING)


@pytest.mark.first_case
@pytest.mark.parametrize("unknown", [{1000}, {1000, 205}, {2000}, {1000, 2000}])
def test_a_mission_that_was_sent_as_other_items_is_recognised(unknown: set[int]) -> None:
    """The vehicle's refusals are lost with the broker that received them."""
    burst = {"photo_count": 2, "pitch_angle": -90, "time_interval": 2}
    pictures = {"command_id": 2, "command_type_id": 4, "parameters": burst}
    world = World()
    script = dataclasses.replace(PX4, item_time_s=6.0, unknown_items=frozenset(unknown))
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(), pictures, waypoint(3), go_home(4)))
    world.run_until(lambda: any(s.state is State.RUNNING for s in world.app.sessions.values()))
    world.run(2.0)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4
    assert vehicle.uploads == 1


def test_when_a_flight_began_is_known_over_restarts_until_it_has_landed(tmp_path: Path) -> None:
    """Its log and its frames are of the whole flight then."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), waypoint(2), land(3)))
    world.run_until(lambda: vehicle.airborne)
    began_s = world.app.sessions[1].vehicle.recovery.armed_s
    assert began_s is not None
    for _ in range(2):
        world.restart_broker()
        world.run(2.0)  # Its next heartbeat, and the journal
        assert world.app.sessions[1].vehicle.recovery.armed_s == began_s
    world.run_until_over(1201)
    world.run_until(lambda: not vehicle.armed)
    world.run(1.0)
    assert world.app.sessions[1].vehicle.recovery.armed_s is None
