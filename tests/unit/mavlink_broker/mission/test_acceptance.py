"""What the edge server has ended before the acceptance arrived is not flown.

Nor is what an abort has ended before the acceptance was answered, also by a restarted broker.
"""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.families import OWN_PRODUCT
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.broker_events import ABORT, SOFT_ABORT, answer_statuses
from tests.support.broker_world import (
    FINISHED,
    World,
    first_flight,
    go_home,
    mission,
    restart,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import in_mission, world_at
from tests.support.orders import SET_MODE
from tests.support.vehicle_script import ARDUPILOT, PX4, PX4_LAND, Script


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


@pytest.mark.first_case
@pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
@pytest.mark.parametrize("is_ended_there", [True, False])
def test_a_mission_that_was_not_accepted_has_one_terminal_report(
    kind: int, *, is_ended_there: bool
) -> None:
    """An abort empties the edge server's queue too: it reports the end of what it has ended."""
    world = in_mission(PX4)
    queued = world.edge.plan(first_flight(mission_id=1202))
    world.run(1.0)
    world.edge.event(kind)
    if is_ended_there:
        world.edge.cancel(queued)
    world.run(60.0)
    ends = [r for r in world.edge.reports(1202) if r["mission_status_id"] >= Status.FINISHED]
    assert len(ends) == (0 if is_ended_there else 1)
    assert world.edge.status(1201) == Status.ABORTED


def test_a_mission_whose_acceptance_is_not_answered_yet_has_one_too() -> None:
    world = World()
    world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=30.0))
    world.run(3.0)
    world.edge.answers_acceptances = False
    queued = world.edge.plan(first_flight())
    world.run(1.0)
    event = world.edge.event(SOFT_ABORT)
    world.edge.cancel(queued)
    world.run(1.0)
    world.edge.answers_acceptances = True
    world.run(10.0)
    assert world.edge.reports(1201) == []
    assert answer_statuses(world, event)[-1] == "done"


class TestAnAbortBeforeTheAcceptanceIsAnswered:
    """Until then a restarted broker may be handed the mission: the abort is not done before."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
    @pytest.mark.parametrize("is_forgotten", [False, True], ids=["handed out", "forgotten"])
    def test_of_a_mission_that_is_being_prepared(
        self, kind: int, is_forgotten: bool, tmp_path: Path
    ) -> None:
        world = World(journal=tmp_path)
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=10.0))
        world.run(3.0)
        world.edge.answers_acceptances = False
        world.edge.plan(first_flight())
        world.run(1.0)
        event = world.edge.event(kind)
        world.run(2.0)
        assert answer_statuses(world, event) == ["accepted"]
        world.kill_broker()
        if is_forgotten:
            world.edge.closed.add(event)
        world.restart_broker()
        world.edge.answers_acceptances = True
        world.run(20.0)
        assert vehicle.arm_orders == 0
        assert world.edge.status(1201) == Status.ABORTED
        assert answer_statuses(world, event) == ["accepted", "done"]
        assert not list(tmp_path.iterdir())

    def test_of_one_that_waited_behind_another(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        world.edge.answers_acceptances = False
        world.edge.plan(first_flight(mission_id=1202))
        world.run(0.5)
        event = world.edge.event(ABORT)
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event) == ["accepted"]
        restart(world)
        world.edge.answers_acceptances = True
        world.run(15.0)
        assert vehicle.arm_orders == 1
        assert world.edge.status(1202) == Status.ABORTED
        assert answer_statuses(world, event)[-1] == "done"

    def test_and_no_mission_begins_before_it_is_done(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=10.0))
        world.run(3.0)
        world.edge.answers_acceptances = False
        world.edge.plan(first_flight())
        world.run(1.0)
        event = world.edge.event(ABORT)
        world.run(1.0)
        world.edge.plan(first_flight(mission_id=1202))
        restart(world)
        world.edge.answers_acceptances = True
        world.run_until_over(1202)
        assert world.edge.status(1201) == Status.ABORTED
        assert world.edge.status(1202) == Status.FINISHED
        assert answer_statuses(world, event)[-1] == "done"
        assert vehicle.arm_orders == 1

    def test_a_withdrawal_does_not_end_the_orders_of_the_abort(self) -> None:
        """The edge server ends an unaccepted mission itself; the vehicle still has to land."""
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(mission(takeoff(1), waypoint(2)))
        world.run_until_over(1201)
        world.run(1.0)
        world.edge.answers_acceptances = False
        queued = world.edge.plan(first_flight(mission_id=1202))
        world.run(0.5)
        refuses = dict.fromkeys((SET_MODE, mavlink.MAV_CMD_NAV_LAND), mavlink.MAV_RESULT_FAILED)
        vehicle.script = dataclasses.replace(vehicle.script, results=refuses)
        event = world.edge.event(ABORT)
        world.edge.cancel(queued)
        world.run(1.0)
        world.edge.answers_acceptances = True
        world.run(2.0)
        vehicle.script = dataclasses.replace(vehicle.script, results={})
        world.run(4.0)
        assert vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, event) == ["accepted", "done"]
