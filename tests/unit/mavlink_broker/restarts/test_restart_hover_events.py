"""Events for a vehicle that a broker, which was just restarted, has not received yet."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.pending_events import MAX_WAITING, TOO_MANY
from mavlink_broker.vehicle.telemetry import Snapshot
from tests.support.autopilot_families import OWN_IF_THOROUGH
from tests.support.broker_events import (
    ABORT,
    PAUSE,
    POINT,
    RESUME,
    RETURN_HOME,
    SOFT_ABORT,
    SPEED,
    answer_statuses,
    answers,
)
from tests.support.broker_world import World, first_flight
from tests.support.mission_scenes import world_at
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_LAND,
    COPTER_RETURN,
    PX4,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

BETWEEN_HEARTBEATS_S = 0.3
SCRIPTS = pytest.mark.parametrize(
    "script",
    [pytest.param(PX4, id="px4"), pytest.param(ARDUPILOT, id="ardupilot"), OWN_IF_THOROUGH],
)


def hovering_world(journal: Path, script: Script = PX4) -> World:
    """A world whose vehicle hovers where a soft abort has sent it, and whose broker was killed."""
    world = world_at(1, script, journal)
    event = world.edge.event(SOFT_ABORT, abort=POINT)
    world.run_until(lambda: "done" in answer_statuses(world, event))
    world.run(3.0)
    assert world.only_vehicle.armed
    world.kill_broker()
    world.run(2.0)
    return world


def restart_unreceived(world: World) -> None:
    """Restart the broker, which receives nothing of the vehicle until its link is back."""
    world.only_vehicle.silent = True
    world.restart_broker()
    world.run(1.0)
    assert not world.app.sessions


def orders(world: World, since: int) -> list[int]:
    """Modes and other commands of flight that the vehicle was ordered, behind so many commands."""
    flown = {mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}
    return [c for c, _ in world.only_vehicle.parameters[since:] if c in flown]


def is_down(world: World) -> Callable[[], bool]:
    return lambda: not world.only_vehicle.armed


@SCRIPTS
@pytest.mark.parametrize("kind", [RETURN_HOME, ABORT, SOFT_ABORT])
def test_an_event_before_the_first_heartbeat_moves_the_vehicle_that_hovers(
    script: Script, kind: int, tmp_path: Path
) -> None:
    world = hovering_world(tmp_path, script)
    vehicle = world.only_vehicle
    restart_unreceived(world)
    event = world.edge.event(kind)
    world.run(1.0)
    assert not answer_statuses(world, event)
    vehicle.silent = False
    world.run_until(lambda: bool(answer_statuses(world, event)))
    world.run_until(is_down(world))
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    expected = {COPTER_LAND, PX4_LAND} if kind == ABORT else {COPTER_RETURN, PX4_RETURN}
    assert vehicle.custom_mode in expected


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.5, 1.0, 1.5, 2.0, 3.0])
@SCRIPTS
def test_an_event_at_any_time_behind_the_restart_is_done(
    script: Script, after_s: float, tmp_path: Path
) -> None:
    world = hovering_world(tmp_path, script)
    world.restart_broker()
    world.run(after_s)
    event = world.edge.event(RETURN_HOME)
    world.run_until(is_down(world))
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]


def test_it_is_ordered_once_though_the_broker_is_killed_while_it_waits(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    since = len(world.only_vehicle.parameters)
    restart_unreceived(world)
    event = world.edge.event(RETURN_HOME)
    world.run(1.0)
    world.restart_broker()
    world.run(1.0)
    world.only_vehicle.silent = False
    world.run_until(lambda: "done" in answer_statuses(world, event))
    world.edge.hand_out_again()
    world.run_until(is_down(world))
    world.run(2.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert len(orders(world, since)) == 1


def test_a_vehicle_that_does_not_come_is_not_known(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    since = len(world.only_vehicle.parameters)
    restart_unreceived(world)
    event = world.edge.event(RETURN_HOME)
    world.run(7.0)
    assert not answer_statuses(world, event)
    world.run(2.0)
    assert answers(world, event) == [("refused", "vehicle 1 is not known")]
    world.only_vehicle.silent = False
    world.run(10.0)
    assert len(answers(world, event)) == 1
    assert not orders(world, since)
    assert world.only_vehicle.armed


def test_a_vehicle_without_a_position_is_refused_by_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = hovering_world(tmp_path)
    monkeypatch.setattr(Snapshot, "position", property(lambda _: None, lambda *_: None))
    world.restart_broker()
    event = world.edge.event(RETURN_HOME)
    world.run(9.0)
    assert answers(world, event) == [("refused", "the position of vehicle 1 is not known")]


def test_a_broker_that_has_run_for_long_refuses_an_unknown_vehicle_at_once() -> None:
    world = World()
    world.run(31.0)
    event = world.edge.event(RETURN_HOME)
    world.tick()
    assert answers(world, event) == [("refused", "vehicle 1 is not known")]


def test_no_system_has_such_a_number() -> None:
    world = World()
    event = world.edge.event(RETURN_HOME, vehicle_id=256)
    world.tick()
    assert answers(world, event) == [("refused", "vehicle 256 is not known")]
    assert not world.app.sessions


@pytest.mark.parametrize(
    ("kind", "more"), [(PAUSE, {}), (RESUME, {}), (SPEED, {"maximum_speed": 2.5})]
)
def test_what_needs_a_mission_is_refused_when_the_vehicle_is_received(
    kind: int, more: dict[str, Any], tmp_path: Path
) -> None:
    world = hovering_world(tmp_path)
    restart_unreceived(world)
    event = world.edge.event(kind, **more)
    world.run(1.0)
    assert not answer_statuses(world, event)
    world.only_vehicle.silent = False
    world.run(3.0)
    assert answers(world, event) == [("refused", "no active mission")]
    assert world.only_vehicle.armed


@pytest.mark.parametrize(
    "kinds", [(RETURN_HOME, ABORT), (ABORT, RETURN_HOME), (SOFT_ABORT, RETURN_HOME)]
)
def test_of_two_that_wait_the_newest_decides(kinds: tuple[int, int], tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    vehicle = world.only_vehicle
    restart_unreceived(world)
    first, second = (world.edge.event(kind) for kind in kinds)
    world.run(1.0)
    vehicle.silent = False
    world.run_until(is_down(world))
    world.run(1.0)
    assert answers(world, first) == [("done", "a later event replaced it")]
    assert answer_statuses(world, second) == ["accepted", "done"]
    assert vehicle.custom_mode == (PX4_LAND if kinds[1] == ABORT else PX4_RETURN)


def test_of_two_that_are_refused_the_older_is_refused_for_the_same_reason(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    vehicle = world.only_vehicle
    restart_unreceived(world)
    first, second = (world.edge.event(kind) for kind in (RETURN_HOME, ABORT))
    world.run(1.0)
    vehicle.custom_mode = PX4_POSITION
    vehicle.silent = False
    world.run(4.0)
    who = "where another system or its pilot has to move it"
    refused = [("refused", f"no active mission: the vehicle is in POSCTL, {who}")]
    assert answers(world, first) == answers(world, second) == refused


@SCRIPTS
@pytest.mark.parametrize("kind", [RETURN_HOME, ABORT, SOFT_ABORT])
def test_an_event_that_ends_a_mission_that_waits_moves_the_vehicle_too(
    script: Script, kind: int, tmp_path: Path
) -> None:
    """The mission ends at once, the event when the vehicle that hovers has obeyed."""
    world = hovering_world(tmp_path, script)
    vehicle = world.only_vehicle
    restart_unreceived(world)
    world.edge.plan(first_flight(mission_id=1202))
    event = world.edge.event(kind)
    world.run(1.0)
    assert world.edge.status(1202) == Status.ABORTED
    assert not answer_statuses(world, event)
    vehicle.silent = False
    world.run_until(is_down(world))
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    expected = {COPTER_LAND, PX4_LAND} if kind == ABORT else {COPTER_RETURN, PX4_RETURN}
    assert vehicle.custom_mode in expected
    assert [r["mission_status_id"] for r in world.edge.reports(1202)] == [Status.ABORTED]


def test_one_whose_vehicle_does_not_come_has_ended_the_mission_alone(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    restart_unreceived(world)
    world.edge.plan(first_flight(mission_id=1202))
    event = world.edge.event(RETURN_HOME)
    world.run(9.0)
    note = "vehicle 1 is not known: only the missions that waited were ended"
    assert answers(world, event) == [("done", note)]


def test_one_whose_vehicle_stands_is_done_when_that_is_received(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    vehicle = world.only_vehicle
    vehicle.armed = vehicle.airborne = False
    restart_unreceived(world)
    since = len(vehicle.parameters)
    world.edge.plan(first_flight(mission_id=1202))
    events = [world.edge.event(kind) for kind in (ABORT, RETURN_HOME)]
    world.run(1.0)
    vehicle.silent = False
    world.run(4.0)
    assert [answer_statuses(world, event)[-1] for event in events] == ["done", "done"]
    assert not orders(world, since)


def test_a_mission_ordered_behind_it_does_not_end_its_wait(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    restart_unreceived(world)
    event = world.edge.event(RETURN_HOME)
    world.run(0.5)
    world.edge.plan(first_flight(mission_id=1202))
    world.run(0.5)
    assert not answer_statuses(world, event)
    world.only_vehicle.silent = False
    world.run_until(is_down(world))
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert world.only_vehicle.custom_mode == PX4_RETURN
    assert world.edge.status(1202) == Status.ABORTED


def test_a_pilot_who_has_taken_the_vehicle_meanwhile_keeps_it(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    vehicle = world.only_vehicle
    restart_unreceived(world)
    event = world.edge.event(RETURN_HOME)
    since = len(vehicle.parameters)
    vehicle.custom_mode = PX4_POSITION
    vehicle.silent = False
    world.run(4.0)
    assert answer_statuses(world, event) == ["refused"]
    assert not orders(world, since)


def test_of_too_many_the_newest_are_kept(tmp_path: Path) -> None:
    world = hovering_world(tmp_path)
    restart_unreceived(world)
    events = [world.edge.event(PAUSE) for _ in range(MAX_WAITING)]
    last = world.edge.event(RETURN_HOME)
    world.run(0.5)
    assert answers(world, events[0]) == [("refused", TOO_MANY)]
    assert not any(answer_statuses(world, event) for event in (*events[1:], last))
    world.only_vehicle.silent = False
    world.run_until(is_down(world))
    world.run(1.0)
    assert answer_statuses(world, last) == ["accepted", "done"]
