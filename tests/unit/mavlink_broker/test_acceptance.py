"""What the edge server has ended before the acceptance arrived is not flown."""

import dataclasses

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.families import OWN_PRODUCT
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    go_home,
    mission,
    takeoff,
    waypoint,
)
from tests.support.vehicle_script import ARDUPILOT, PX4, Script


def asked_late(script: Script = PX4) -> tuple[World, int]:
    """A world in which a mission is accepted without an answer yet."""
    world = World()
    world.add_vehicle(script=script)
    world.run(10.0)
    world.edge.answers_acceptances = False
    return world, world.edge.plan(first_flight())


@pytest.mark.first_case
@pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def test_a_vehicle_gets_nothing_before_the_edge_server_has_confirmed(script: Script) -> None:
    world, _ = asked_late(script)
    world.run(60.0)
    assert world.only_vehicle.uploads == 0
    assert not world.only_vehicle.armed
    world.edge.answers_acceptances = True
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == FINISHED


def test_a_mission_that_was_cancelled_meanwhile_is_dropped_without_a_report() -> None:
    world, work = asked_late()
    world.run(20.0)
    world.edge.cancel(work)
    world.edge.answers_acceptances = True
    world.run(20.0)
    assert not world.only_vehicle.armed
    assert world.edge.reports(1201) == []
    assert world.app.sessions[1].state is State.IDLE


@pytest.mark.first_case
@pytest.mark.parametrize("is_waiting", [False, True], ids=["in preparation", "in the queue"])
def test_a_mission_whose_acceptance_has_failed_is_reported_as_failed(*, is_waiting: bool) -> None:
    """The edge server still has it in its queue: without a report it would wait for ever."""
    world = World()
    vehicle = world.add_vehicle()
    world.run(10.0)
    if is_waiting:
        world.edge.plan(first_flight())
        world.run(1.0)
    world.edge.answers_acceptances = False
    work = world.edge.plan(first_flight(mission_id=1202))
    world.run(20.0)
    reason = "the edge server did not confirm the acceptance: HTTP 500"
    world.edge.fail_acceptance(work, reason)
    world.edge.answers_acceptances = True
    world.run_until_over(1202)
    (report,) = world.edge.reports(1202)
    assert report["mission_status_id"] == Status.FAILED
    assert reason in report["message"]
    if is_waiting:
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
    else:
        assert not vehicle.armed
    assert world.app.sessions[1].state is State.IDLE


def test_the_next_mission_is_flown_all_the_same() -> None:
    world, work = asked_late()
    world.edge.plan(first_flight(mission_id=1202))
    world.run(5.0)
    world.edge.cancel(work)
    world.edge.answers_acceptances = True
    world.run_until_over(1202)
    assert world.edge.statuses(1202) == FINISHED
    assert world.edge.reports(1201) == []


def test_one_that_waits_behind_another_is_dropped_before_its_turn() -> None:
    world = World()
    world.add_vehicle()
    world.run(10.0)
    world.edge.plan(first_flight())
    world.run(1.0)
    world.edge.answers_acceptances = False
    work = world.edge.plan(first_flight(mission_id=1202))
    world.run(1.0)
    world.edge.cancel(work)
    world.edge.answers_acceptances = True
    world.run_until_over(1201)
    world.run(20.0)
    assert world.edge.statuses(1201) == FINISHED
    assert world.edge.reports(1202) == []


def test_a_vehicle_that_hovers_stays_where_it_is_until_the_edge_server_has_confirmed() -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4))
    world.edge.plan(mission(takeoff(1), waypoint(2)))
    world.run_until_over(1201)
    uploads = vehicle.uploads
    world.edge.answers_acceptances = False
    world.edge.plan(mission(waypoint(1), go_home(2), mission_id=1202))
    world.run(30.0)
    assert vehicle.uploads == uploads
    world.edge.answers_acceptances = True
    world.run_until_over(1202)
    assert world.edge.status(1202) == FINISHED[0]


def test_a_camera_films_nothing_until_the_edge_server_has_confirmed() -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, product=OWN_PRODUCT))
    world.run(10.0)
    world.edge.answers_acceptances = False
    film = {"command_id": 1, "command_type_id": 5, "parameters": {}}
    world.edge.plan(mission(film))
    world.run(20.0)
    assert mavlink.MAV_CMD_VIDEO_START_CAPTURE not in vehicle.commands
    world.edge.answers_acceptances = True
    world.run_until_over(1201)
    assert mavlink.MAV_CMD_VIDEO_START_CAPTURE in vehicle.commands
