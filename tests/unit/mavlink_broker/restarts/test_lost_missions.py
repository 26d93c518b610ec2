"""Events for a vehicle that flies on for a mission which the edge server has lost.

The database of the edge server is gone, the broker was killed, and its journal is kept.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.lost_mission import ABORT_ENDS_IT
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
from tests.support.broker_world import GENERIC, World, first_flight
from tests.support.mission_scenes import world_at
from tests.support.orders import orders
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_LAND,
    COPTER_RETURN,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_MISSION,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

WAYPOINT, HOTPOINT, FOLLOW = 1, 2, 3
SCRIPTS = pytest.mark.parametrize(
    "script",
    [pytest.param(PX4, id="px4"), pytest.param(ARDUPILOT, id="ardupilot"), OWN_IF_THOROUGH],
)


def lost_world(
    journal: Path,
    script: Script = PX4,
    command: int = WAYPOINT,
    before: Callable[[World], object] | None = None,
) -> World:
    """A world whose vehicle flies a mission that only the journal of a killed broker knows."""
    world = world_at(command, script, journal)
    if before is not None:
        before(world)
    world.kill_broker()
    world.run(2.0)
    world.edge.closed |= set(world.edge.work)
    return world


def restart(world: World) -> None:
    world.restart_broker()
    world.run(4.0)
    assert world.only_vehicle.armed
    assert not world.app.sessions[1].missions.is_flying


def warning(world: World) -> str | None:
    return world.app.sessions[1].vehicle.warning


def pause(world: World) -> None:
    event = world.edge.event(PAUSE)
    world.run_until(lambda: "done" in answer_statuses(world, event))


@SCRIPTS
@pytest.mark.parametrize("kind", [RETURN_HOME, ABORT, SOFT_ABORT])
def test_an_event_ends_the_flight(script: Script, kind: int, tmp_path: Path) -> None:
    world = lost_world(tmp_path, script)
    restart(world)
    assert warning(world) == ABORT_ENDS_IT
    event = world.edge.event(kind)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=20.0)
    world.run(2.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    expected = {COPTER_LAND, PX4_LAND} if kind == ABORT else {COPTER_RETURN, PX4_RETURN}
    assert world.only_vehicle.custom_mode in expected
    assert warning(world) is None


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_an_event_at_any_time_behind_the_restart_is_done(after_s: float, tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    world.restart_broker()
    world.run(after_s)
    event = world.edge.event(RETURN_HOME)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=20.0)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]


def test_an_abort_ends_the_flight_of_a_vehicle_whose_modes_are_not_known(tmp_path: Path) -> None:
    world = lost_world(tmp_path, GENERIC)
    restart(world)
    event = world.edge.event(ABORT)
    world.run_until(lambda: "done" in answer_statuses(world, event), within_s=20.0)
    assert mavlink.MAV_CMD_NAV_LAND in [command for command, _ in world.only_vehicle.parameters]


@pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
def test_an_abort_with_a_point_goes_there(kind: int, tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    restart(world)
    event = world.edge.event(kind, abort=POINT)
    world.run_until(lambda: "done" in answer_statuses(world, event), within_s=60.0)
    vehicle = world.only_vehicle
    assert vehicle.place == pytest.approx((POINT["latitude"], POINT["longitude"]))
    assert vehicle.custom_mode == (PX4_LAND if kind == ABORT else PX4_HOLD)


@SCRIPTS
@pytest.mark.parametrize("command", [HOTPOINT, FOLLOW], ids=["hotpoint", "follow"])
def test_an_abort_ends_a_live_command(script: Script, command: int, tmp_path: Path) -> None:
    world = lost_world(tmp_path, script, command)
    restart(world)
    event = world.edge.event(ABORT)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=20.0)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]


@SCRIPTS
def test_an_abort_ends_a_paused_mission(script: Script, tmp_path: Path) -> None:
    world = lost_world(tmp_path, script, before=pause)
    restart(world)
    event = world.edge.event(ABORT)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=20.0)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert world.app.sessions[1].vehicle.recovery.paused is None


@pytest.mark.parametrize(
    ("kind", "more"), [(PAUSE, {}), (RESUME, {}), (SPEED, {"maximum_speed": 2.5})]
)
def test_what_needs_a_mission_is_refused_with_what_is_possible(
    kind: int, more: dict[str, Any], tmp_path: Path
) -> None:
    world = lost_world(tmp_path)
    restart(world)
    event = world.edge.event(kind, **more)
    world.run(1.0)
    assert answers(world, event) == [("refused", f"no active mission: {ABORT_ENDS_IT}")]


def test_the_broker_may_be_killed_again_before_the_vehicle_obeys(tmp_path: Path) -> None:
    world = lost_world(tmp_path, command=FOLLOW)
    restart(world)
    world.air.is_uplink_up = False
    event = world.edge.event(RETURN_HOME)
    world.run(2.0)
    assert answer_statuses(world, event) == ["accepted"]
    world.restart_broker()
    world.air.is_uplink_up = True
    world.run_until(lambda: not world.only_vehicle.armed, within_s=30.0)
    world.run(1.0)
    assert answer_statuses(world, event) == ["accepted", "done"]
    assert world.only_vehicle.custom_mode == PX4_RETURN


def test_a_newer_abort_replaces_one_that_ends_it(tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    restart(world)
    first = world.edge.event(SOFT_ABORT, abort=POINT)
    world.run(1.0)
    second = world.edge.event(ABORT)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=30.0)
    world.run(1.0)
    assert answers(world, first)[-1] == ("done", "a later event replaced it")
    assert answer_statuses(world, second) == ["accepted", "done"]
    assert world.only_vehicle.custom_mode == PX4_LAND


def test_missions_that_wait_end_with_it(tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    restart(world)
    world.edge.plan(first_flight(mission_id=1202))
    world.run(1.0)
    event = world.edge.event(RETURN_HOME)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=20.0)
    world.run(1.0)
    assert world.edge.status(1202) == Status.ABORTED
    assert answer_statuses(world, event) == ["accepted", "done"]


def test_the_next_mission_flies_behind_it_without_a_wait(tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    restart(world)
    world.edge.event(RETURN_HOME)
    world.run_until(lambda: not world.only_vehicle.armed, within_s=20.0)
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until(lambda: world.only_vehicle.armed, within_s=20.0)
    world.run_until_over(1202)
    assert world.edge.status(1202) == Status.FINISHED


def test_a_mission_that_is_handed_out_late_goes_on(tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    restart(world)
    world.edge.closed.clear()
    world.edge.hand_out_again()
    world.run(3.0)
    assert warning(world) is None
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


class TestOfSomebodyElse:
    def refuses(self, world: World) -> None:
        since = len(world.only_vehicle.frames)
        assert warning(world) is None
        event = world.edge.event(ABORT)
        world.run(3.0)
        assert answer_statuses(world, event) == ["refused"]
        assert not orders(world.only_vehicle, since)
        assert world.only_vehicle.armed

    @pytest.mark.parametrize("mode", [PX4_POSITION, PX4_HOLD])
    def test_who_has_taken_the_vehicle_meanwhile_keeps_it(self, mode: int, tmp_path: Path) -> None:
        world = lost_world(tmp_path)
        world.only_vehicle.custom_mode = mode
        restart(world)
        self.refuses(world)

    def test_so_does_who_takes_it_later_and_flies_its_mission_on(self, tmp_path: Path) -> None:
        world = lost_world(tmp_path)
        restart(world)
        world.only_vehicle.custom_mode = PX4_POSITION
        world.run(3.0)
        self.refuses(world)
        world.only_vehicle.custom_mode = PX4_MISSION
        world.run(3.0)
        self.refuses(world)
        restart(world)  # The journal knows whose it is
        self.refuses(world)

    def test_a_mission_of_another_system_is_its_own(self, tmp_path: Path) -> None:
        world = World(journal=tmp_path)
        vehicle = world.add_vehicle()
        world.run(3.0)
        vehicle.armed = vehicle.airborne = True
        vehicle.custom_mode = PX4_MISSION
        world.run(3.0)
        restart(world)
        self.refuses(world)

    def test_so_is_one_that_another_system_uploads_instead(self, tmp_path: Path) -> None:
        """MISSION_CURRENT names it, by the checksum of its items."""
        world = lost_world(tmp_path)
        restart(world)
        missions = world.only_vehicle.missions
        missions.items = [*missions.items, missions.items[-1]]
        world.run(3.0)
        self.refuses(world)

    def test_so_is_that_of_a_vehicle_that_was_restarted(self, tmp_path: Path) -> None:
        world = lost_world(tmp_path)
        world.only_vehicle.booted_at = world.clock.now
        restart(world)
        self.refuses(world)

    def test_so_is_one_behind_the_end_of_the_mission(self, tmp_path: Path) -> None:
        world = lost_world(tmp_path)
        restart(world)
        event = world.edge.event(SOFT_ABORT, abort=POINT)
        world.run_until(lambda: "done" in answer_statuses(world, event), within_s=60.0)
        world.kill_broker()
        world.only_vehicle.custom_mode = PX4_MISSION
        world.only_vehicle.place = (POINT["latitude"] + 0.01, POINT["longitude"])
        world.run(3.0)
        restart(world)
        self.refuses(world)


def test_a_vehicle_on_the_ground_flies_nothing(tmp_path: Path) -> None:
    world = lost_world(tmp_path)
    vehicle = world.only_vehicle
    vehicle.armed = vehicle.airborne = False
    world.restart_broker()
    world.run(4.0)
    assert warning(world) is None
    event = world.edge.event(ABORT)
    world.run(1.0)
    assert answers(world, event) == [("refused", "no active mission")]
    assert mavlink.MAV_CMD_NAV_LAND not in [command for command, _ in vehicle.parameters[-3:]]
