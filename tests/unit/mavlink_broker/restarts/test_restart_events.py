"""A broker that is killed while an event is being carried out, and one that finds an event."""

import dataclasses
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.abort_executor import NOT_OBEYED, NOT_THERE, STANDS
from mavlink_broker.mission.pending_events import LANDED_UNSEEN, NOT_SEEN, TOO_OLD
from mavlink_broker.mission.states import State
from tests.support.broker_events import ABORT, POINT, SOFT_ABORT, SPEED, answer_statuses
from tests.support.broker_world import (
    World,
    first_flight,
    go_home,
    mission,
    restart,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import returning, world_at
from tests.support.orders import SET_MODE
from tests.support.vehicle_script import PX4, PX4_HOLD, PX4_LAND, PX4_POSITION, PX4_RETURN

FINISHED = Status.FINISHED
AWAY = pytest.mark.parametrize("away_s", [0.0, 3.0, 60.0])


def is_at_point(world: World) -> Callable[[], bool]:
    return lambda: (
        world.only_vehicle.place == pytest.approx((POINT["latitude"], POINT["longitude"]))
    )


@pytest.mark.first_case
@AWAY
def test_an_abort_with_a_point_still_lands_there(away_s: float) -> None:
    world = world_at(1)
    vehicle = world.only_vehicle
    vehicle.height_m = 40.0
    event = world.edge.event(ABORT, abort=POINT)
    world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
    world.tick()
    assert "done" not in answer_statuses(world, event)
    restart(world, away_s)
    world.run_until(lambda: "done" in answer_statuses(world, event))
    world.run_until(lambda: not vehicle.armed)
    assert is_at_point(world)()
    assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 1
    assert world.edge.status(1201) == Status.ABORTED


@pytest.mark.first_case
@pytest.mark.parametrize("known_after_s", [0.0, 1.0, 2.5])
def test_an_abort_that_meets_a_restart_waits_for_what_its_place_needs(known_after_s: float) -> None:
    """The home of the vehicle reaches the new broker a while after its first heartbeat."""
    world = world_at(1)
    vehicle = world.only_vehicle
    world.kill_broker()
    known = vehicle.script
    vehicle.script = dataclasses.replace(known, has_home=False)
    event = world.edge.event(ABORT, abort=POINT)
    world.restart_broker()
    world.run(known_after_s)
    vehicle.script = known
    world.run_until(lambda: not vehicle.armed)
    world.run(1.0)
    assert is_at_point(world)()
    assert world.edge.acknowledgements(event)[-1] == {"status": "done"}


def test_a_place_that_cannot_be_ordered_is_a_landing_and_the_answer_says_so() -> None:
    world = world_at(1)
    vehicle = world.only_vehicle
    world.kill_broker()
    vehicle.script = dataclasses.replace(vehicle.script, has_home=False)
    event = world.edge.event(ABORT, abort=POINT)
    world.restart_broker()
    world.run_until(lambda: not vehicle.armed)
    world.run(1.0)
    assert not is_at_point(world)()
    assert world.edge.acknowledgements(event)[-1] == {"status": "done", "message": NOT_OBEYED}


@pytest.mark.parametrize(
    ("place", "note"), [({"abort": POINT}, NOT_SEEN), ({}, LANDED_UNSEEN)], ids=["place", "here"]
)
def test_an_abort_whose_vehicle_has_landed_meanwhile_does_not_say_that_it_was_obeyed(
    place: dict[str, Any], note: str
) -> None:
    """The link was away from the abort on, and the broker was restarted."""
    world = world_at(1)
    vehicle = world.only_vehicle
    vehicle.silent = True
    event = world.edge.event(ABORT, **place)
    world.run(2.0)
    assert answer_statuses(world, event) == ["accepted"]
    world.kill_broker()
    vehicle.armed = vehicle.airborne = False
    vehicle.silent = False
    world.restart_broker()
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert world.edge.acknowledgements(event)[-1] == {"status": "done", "message": note}


def killed_in_an_abort(journal: Path | None = None) -> tuple[World, int]:
    """A vehicle flies on, out of reach, while the broker that has accepted an abort is killed."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=3000.0))
    world.edge.plan(mission(takeoff(1), waypoint(2), go_home(3)))
    world.run_until(lambda: vehicle.airborne)
    world.run(2.0)
    vehicle.silent = True
    event = world.edge.event(ABORT)
    world.edge.work[event]["expires_at"] = (world.clock.utc() + timedelta(seconds=10)).isoformat()
    world.run(3.0)
    assert answer_statuses(world, event) == ["accepted"]
    world.kill_broker()
    return world, event


@pytest.mark.parametrize(("away_s", "is_obeyed"), [(600.0, True), (620.0, False)])
def test_an_abort_of_long_ago_is_reported_as_not_carried_on(
    away_s: float, *, is_obeyed: bool
) -> None:
    """The vehicle may be on another flight by then."""
    world, event = killed_in_an_abort()
    vehicle = world.only_vehicle
    world.run(away_s)
    vehicle.silent = False
    world.restart_broker()
    world.run_until(lambda: answer_statuses(world, event)[-1] != "accepted")
    world.run(5.0)
    answer = world.edge.acknowledgements(event)[-1]
    assert answer == (
        {"status": "done"} if is_obeyed else {"status": "refused", "message": TOO_OLD}
    )
    assert (vehicle.custom_mode == PX4_LAND) == is_obeyed
    assert (world.edge.status(1201) == Status.ABORTED) == is_obeyed


def test_an_abort_that_the_journal_knows_is_carried_on_however_old_it_is(tmp_path: Path) -> None:
    world, event = killed_in_an_abort(tmp_path)
    world.run(3600.0)
    world.only_vehicle.silent = False
    world.restart_broker()
    world.run_until(lambda: answer_statuses(world, event)[-1] != "accepted")
    assert answer_statuses(world, event)[-1] == "done"
    assert world.only_vehicle.custom_mode == PX4_LAND


def test_an_abort_that_was_given_out_in_time_waits_for_its_vehicle() -> None:
    world, event = killed_in_an_abort()
    world.restart_broker()
    world.run(700.0)
    world.only_vehicle.silent = False
    world.run_until(lambda: answer_statuses(world, event)[-1] != "accepted")
    assert answer_statuses(world, event)[-1] == "done"
    assert world.only_vehicle.custom_mode == PX4_LAND


def test_an_abort_that_finds_its_vehicle_on_the_ground_says_so() -> None:
    """It has landed by itself while no broker ran, and the abort came then."""
    world = world_at(1)
    vehicle = world.only_vehicle
    world.kill_broker()
    event = world.edge.event(ABORT, abort=POINT)
    vehicle.armed = vehicle.airborne = False
    world.restart_broker()
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert world.edge.status(1201) == Status.ABORTED
    assert world.edge.acknowledgements(event)[-1] == {"status": "done", "message": STANDS}


def test_an_abort_whose_vehicle_lands_by_itself_does_not_say_that_it_was_there() -> None:
    world = world_at(1)
    vehicle = world.only_vehicle
    vehicle.silent = True
    event = world.edge.event(ABORT, abort=POINT)
    world.run(2.0)
    vehicle.armed = vehicle.airborne = False
    vehicle.silent = False
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert world.edge.acknowledgements(event)[-1] == {"status": "done", "message": NOT_THERE}


def test_a_landing_that_was_ordered_is_not_ordered_again() -> None:
    world = world_at(1)
    vehicle = world.only_vehicle
    world.edge.event(ABORT)
    world.run_until(lambda: vehicle.custom_mode == PX4_LAND)
    ordered = len([c for c in vehicle.parameters if c[0] == mavlink.MAV_CMD_DO_SET_MODE])
    restart(world)
    world.run_until(lambda: not vehicle.armed)
    mode_orders = len([c for c in vehicle.parameters if c[0] == mavlink.MAV_CMD_DO_SET_MODE])
    assert mode_orders == ordered


@pytest.mark.first_case
@AWAY
def test_a_soft_abort_still_waits_for_the_running_command(away_s: float) -> None:
    world = world_at(1)
    event = world.edge.event(SOFT_ABORT)
    world.run(0.5)
    assert answer_statuses(world, event) == ["accepted"]
    restart(world, away_s)
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert world.edge.status(1201) == Status.ABORTED
    assert world.edge.statuses(1201)[1] == Status.FINISHED
    assert world.only_vehicle.custom_mode == PX4_RETURN


def test_a_restart_does_not_begin_the_time_of_a_soft_abort_anew() -> None:
    """The running command lasts longer than a soft abort waits, 30 s after its expiry at most."""
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=300.0))
    world.edge.plan(mission(takeoff(1), waypoint(2), go_home(3)))
    world.run_until(lambda: vehicle.airborne)
    world.run(2.0)
    event = world.edge.event(SOFT_ABORT)
    expires = world.clock.utc() + timedelta(seconds=10.0)
    world.edge.work[event]["expires_at"] = expires.isoformat()
    posted_at = world.clock.now
    world.run(0.5)
    for _ in range(3):
        restart(world, 8.0)
        world.run(3.0)
    world.run_until(lambda: vehicle.custom_mode == PX4_RETURN)
    assert world.clock.now - posted_at < 42.0


@pytest.mark.thorough
def test_a_soft_abort_to_a_point_still_holds_there_and_the_next_mission_begins_there() -> None:
    world = world_at(1)
    vehicle = world.only_vehicle
    event = world.edge.event(SOFT_ABORT, abort=POINT)
    world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
    world.tick()
    world.edge.plan(first_flight(mission_id=1202))
    world.tick()
    restart(world)
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert is_at_point(world)()
    assert vehicle.armed
    world.run_until_over(1202)
    assert world.edge.status(1202) == Status.FINISHED


@pytest.mark.first_case
@AWAY
@pytest.mark.parametrize("command", [0, 2, 3])
def test_an_abort_that_came_while_no_broker_ran_is_carried_out(command: int, away_s: float) -> None:
    world = world_at(command)
    world.kill_broker()
    event = world.edge.event(ABORT)
    world.run(away_s)
    world.restart_broker()
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert world.edge.status(1201) == Status.ABORTED
    world.run_until(lambda: not world.only_vehicle.armed)


def test_a_speed_that_was_not_ordered_yet_is_ordered() -> None:
    world = world_at(1)
    world.kill_broker()
    event = world.edge.event(SPEED, maximum_speed=2.5)
    world.restart_broker()
    world.run_until(lambda: "done" in answer_statuses(world, event))
    speeds = [v for c, v in world.only_vehicle.parameters if c == mavlink.MAV_CMD_DO_CHANGE_SPEED]
    assert [values[1] for values in speeds] == [2.5]


@pytest.mark.parametrize("away_s", [0.0, 3.0])
@pytest.mark.parametrize("is_at_once", [True, False], ids=["at-once", "later"])
def test_an_abort_that_is_done_is_still_the_brokers_flight_for_a_newer_one(
    away_s: float, *, is_at_once: bool, tmp_path: Path
) -> None:
    """A return home that a restarted broker finds in flight; the operator wants it down here."""
    world, vehicle = returning(tmp_path)
    restart(world, away_s)
    if not is_at_once:
        world.run(4.0)
    event = world.edge.event(ABORT)
    world.run_until(lambda: vehicle.custom_mode == PX4_LAND, within_s=10.0)
    world.run(2.0)
    assert answer_statuses(world, event)[-1] == "done"


def test_no_order_goes_to_a_pilot_who_has_taken_over_meanwhile() -> None:
    world = world_at(1)
    event = world.edge.event(ABORT, abort=POINT)
    world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
    world.tick()
    world.kill_broker()
    world.only_vehicle.set_mode(PX4_POSITION)
    world.run(3.0)
    world.restart_broker()
    world.run_until(lambda: "refused" in answer_statuses(world, event))
    assert "somebody else" in world.edge.acknowledgements(event)[-1]["message"]
    assert world.only_vehicle.custom_mode == PX4_POSITION


def test_an_abort_before_a_mission_does_not_have_it_flown_again() -> None:
    """Its answer was lost, so the edge server hands it out again before the mission that flies."""
    world = World()
    world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=6.0))
    event = world.edge.event(ABORT)
    world.edge.plan(first_flight(mission_id=1201))
    world.run_until(lambda: world.edge.reports(1201) and world.edge.statuses(1201)[0] == FINISHED)
    world.kill_broker()
    world.edge.work[event]["state"] = "accepted"
    world.edge.closed.discard(event)
    world.restart_broker()
    world.run_until_over(1201)
    assert world.app.internal_errors.count == 0
    assert world.only_vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 1


@pytest.mark.thorough
def test_an_abort_that_was_carried_out_does_not_touch_what_came_after() -> None:
    world = world_at(1)
    world.edge.event(ABORT)
    world.run_until(lambda: world.only_vehicle.custom_mode == PX4_LAND)
    world.edge.plan(first_flight(mission_id=1202))
    world.tick()
    restart(world)
    world.run_until_over(1202)
    assert world.edge.status(1202) == Status.FINISHED


@pytest.mark.first_case
@pytest.mark.parametrize("is_forgotten", [False, True], ids=["handed out", "forgotten"])
@pytest.mark.parametrize("away_s", [5.0, 70.0, 700.0])
def test_an_abort_outlives_a_broker_while_its_vehicle_is_out_of_reach(
    away_s: float, is_forgotten: bool, tmp_path: Path
) -> None:
    """Also where the edge server, which keeps it for ten minutes, has closed it meanwhile."""
    world = world_at(1, journal=tmp_path)
    vehicle = world.only_vehicle
    vehicle.script = dataclasses.replace(vehicle.script, item_time_s=10_000.0)
    vehicle.silent = True
    world.run(0.1)
    event = world.edge.event(ABORT)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted"]
    world.kill_broker()
    if is_forgotten:
        world.edge.closed.add(event)
    world.restart_broker()
    world.run(away_s)
    vehicle.silent = False
    world.run_until(lambda: vehicle.custom_mode == PX4_LAND, within_s=20.0)
    world.run_until(lambda: not vehicle.armed)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    world.run_until(lambda: not list(tmp_path.iterdir()))


def test_an_abort_of_a_flight_before_is_not_carried_out_on_another(tmp_path: Path) -> None:
    world = world_at(1, journal=tmp_path)
    vehicle = world.only_vehicle
    vehicle.silent = True
    world.run(0.1)
    event = world.edge.event(ABORT)
    world.run(1.0)
    world.kill_broker()
    vehicle.reboot(world.clock.now)
    vehicle.armed = vehicle.airborne = True
    vehicle.custom_mode = PX4_HOLD
    vehicle.silent = False
    world.restart_broker()
    world.run(10.0)
    assert answer_statuses(world, event)[-1] == "refused"
    assert vehicle.custom_mode == PX4_HOLD


class TestTheNewestAbortDecides:
    """In whichever order a restarted broker comes to know them; the older one is answered so."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("with_journal", [False, True], ids=["memory", "journal"])
    @AWAY
    def test_over_a_soft_one_that_waited(
        self, away_s: float, with_journal: bool, tmp_path: Path
    ) -> None:
        world = world_at(3, journal=tmp_path if with_journal else None)
        vehicle = world.only_vehicle
        soft = world.edge.event(SOFT_ABORT)
        world.run(0.5)
        assert answer_statuses(world, soft) == ["accepted"]
        world.kill_broker()
        hard = world.edge.event(ABORT)
        since = len(vehicle.parameters)
        world.run(min(away_s, 15.0))
        world.restart_broker()
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert modes_since(world, since) == {PX4_LAND}
        assert answer_statuses(world, hard) == ["accepted", "done"]
        assert answer_statuses(world, soft) == ["accepted", "done"]
        assert world.edge.acknowledgements(soft)[-1]["message"] == "a later event replaced it"
        assert world.edge.status(1201) == Status.ABORTED

    @pytest.mark.first_case
    @pytest.mark.parametrize("was_accepted", [False, True], ids=["queued", "accepted"])
    @pytest.mark.parametrize("with_journal", [False, True], ids=["memory", "journal"])
    def test_over_one_that_has_sent_the_vehicle_somewhere(
        self, was_accepted: bool, with_journal: bool, tmp_path: Path
    ) -> None:
        world = world_at(1, journal=tmp_path if with_journal else None)
        vehicle = world.only_vehicle
        vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=False)
        soft = world.edge.event(SOFT_ABORT, abort=POINT)
        world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
        world.run(0.5)
        world.kill_broker()
        hard = world.edge.event(ABORT)
        if was_accepted:
            world.edge.work[hard]["state"] = "accepted"
        since = len(vehicle.parameters)
        world.restart_broker()
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert modes_since(world, since) == {PX4_LAND}
        assert answer_statuses(world, hard)[-1] == "done"
        assert answer_statuses(world, soft) == ["accepted", "done"]
        assert world.edge.acknowledgements(soft)[-1]["message"] == "a later event replaced it"

    def test_over_one_that_a_restarted_broker_sees_through(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=False)
        soft = world.edge.event(SOFT_ABORT, abort=POINT)
        world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
        world.tick()
        restart(world)
        world.run(3.0)
        assert answer_statuses(world, soft) == ["accepted"]
        hard = world.edge.event(ABORT)
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, hard) == ["accepted", "done"]
        assert answer_statuses(world, soft) == ["accepted", "done"]

    def test_a_newer_soft_one_over_an_abort(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=False)
        hard = world.edge.event(ABORT, abort=POINT)
        world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
        world.tick()
        world.kill_broker()
        soft = world.edge.event(SOFT_ABORT)
        world.restart_broker()
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert vehicle.custom_mode == PX4_RETURN
        assert answer_statuses(world, soft) == ["accepted", "done"]
        assert world.edge.acknowledgements(hard)[-1]["message"] == "a later event replaced it"


def modes_since(world: World, since: int) -> set[int]:
    """PX4's modes that the vehicle was ordered into, behind the first so many commands."""
    modes = (v for c, v in world.only_vehicle.parameters[since:] if c == SET_MODE)
    return {int(values[1]) << 16 | int(values[2]) << 24 for values in modes}


def test_a_restarted_broker_waits_for_the_home_before_it_drops_a_place() -> None:
    """What is ordered relative to home must not become a landing because home is not known yet."""
    world = world_at(1)
    vehicle = world.only_vehicle
    vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=False)
    event = world.edge.event(ABORT, abort=POINT)
    world.run_until(lambda: world.app.sessions[1].state is State.ABORTING)
    world.tick()
    restart(world)
    vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=True)
    world.run_until(lambda: "done" in answer_statuses(world, event))
    assert is_at_point(world)()
