"""A mission that an event has paused, and a broker that is restarted meanwhile."""

from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import (
    FLYING_MODES,
    KNOWN_FAMILIES,
    LANDING_MODES,
    OWN,
    PAUSED_MODES,
    SCRIPTS,
)
from tests.support.broker_events import ABORT, PAUSE, RESUME, RETURN_HOME, answer, answer_statuses
from tests.support.broker_world import World, go_home, hotpoint, mission, takeoff
from tests.support.mission_scenes import paused, paused_live, state
from tests.support.orders import orders
from tests.support.vehicle_script import ARDUPILOT, COPTER_AUTO, COPTER_LAND, PX4, Script


class TestRestarts:
    @pytest.mark.first_case
    @KNOWN_FAMILIES
    @pytest.mark.parametrize("begin", [paused, paused_live])
    def test_a_restarted_broker_leaves_it_paused_and_resumes_it(
        self, begin: object, family: str, tmp_path: Path
    ) -> None:
        assert callable(begin)
        world = begin(SCRIPTS[family], tmp_path / "journal")
        vehicle = world.only_vehicle
        world.restart_broker()
        world.run(30.0)
        assert vehicle.custom_mode == PAUSED_MODES[family]
        assert world.edge.status(1201) == Status.RUNNING
        resume = world.edge.event(RESUME)
        world.run_until_over(1201)
        assert answer_statuses(world, resume)[-1] == "done"
        assert world.edge.statuses(1201) == [Status.FINISHED] * 3

    @pytest.mark.parametrize("after_s", [0.1, 0.3, 0.6, 1.0, 2.0, 4.0])
    @pytest.mark.parametrize("script", [OWN, PX4], ids=["own", "px4"])
    def test_a_circle_that_was_paused_is_flown_though_the_broker_is_killed_behind_the_resume(
        self, script: Script, after_s: float, tmp_path: Path
    ) -> None:
        world = World(journal=tmp_path / "journal")
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(1), hotpoint(2), go_home(3)))
        world.run_until(lambda: state(world) is State.FLYING_LIVE)
        world.run_until(lambda: world.edge.statuses(1201)[1] == Status.RUNNING)
        world.run(3.0)
        world.edge.event(PAUSE)
        world.run(3.0)
        ordered = vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT)
        world.edge.event(RESUME)
        world.run(after_s)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 3
        assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) > ordered

    @KNOWN_FAMILIES
    def test_it_is_resumed_though_its_pause_is_in_no_journal(self, family: str) -> None:
        """The disk was read-only when it was paused: the last report shows the pause."""
        world = paused(SCRIPTS[family])
        world.restart_broker()
        world.run(30.0)
        assert world.only_vehicle.custom_mode == PAUSED_MODES[family]
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "paused"
        resume = world.edge.event(RESUME)
        world.run_until_over(1201)
        assert answer_statuses(world, resume)[-1] == "done"
        assert world.edge.statuses(1201) == [Status.FINISHED] * 3

    @KNOWN_FAMILIES
    def test_an_abort_lands_it_though_its_pause_is_in_no_journal(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        world.restart_broker()
        world.run(5.0)
        event = world.edge.event(ABORT)
        world.run_until(lambda: not world.only_vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event)[-1] == "done"

    @KNOWN_FAMILIES
    def test_a_pause_that_has_ended_is_none_for_a_restarted_broker(self, family: str) -> None:
        """What pauses it then is somebody else's order, which no event ends."""
        world = paused(SCRIPTS[family])
        world.edge.event(RESUME)
        world.run(3.0)
        world.kill_broker()
        world.only_vehicle.set_mode(PAUSED_MODES[family])
        world.restart_broker()
        world.run(10.0)
        resume = world.edge.event(RESUME)
        world.run(3.0)
        assert answer_statuses(world, resume)[-1] == "refused"
        assert world.only_vehicle.custom_mode == PAUSED_MODES[family]

    @pytest.mark.first_case
    @KNOWN_FAMILIES
    @pytest.mark.parametrize("kind", [ABORT, RETURN_HOME])
    def test_a_paused_vehicle_obeys_a_restarted_broker(
        self, family: str, kind: int, tmp_path: Path
    ) -> None:
        """The event arrives before the broker has read that an event has paused it."""
        world = paused(SCRIPTS[family], tmp_path / "journal")
        world.restart_broker()
        event = world.edge.event(kind)
        world.run_until(lambda: not world.only_vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event)[-1] == "done"

    def test_a_vehicle_that_lands_while_it_is_paused_ends_the_mission(self) -> None:
        world = paused_live(PX4)
        world.only_vehicle.armed = False
        world.only_vehicle.airborne = False
        world.run(8.0)
        assert world.edge.status(1201) == Status.FAILED

    @pytest.mark.first_case
    @KNOWN_FAMILIES
    @pytest.mark.parametrize("is_restarted", [True, False])
    def test_one_that_has_landed_while_it_was_paused_is_not_resumed_and_has_not_flown(
        self, family: str, tmp_path: Path, *, is_restarted: bool
    ) -> None:
        """Its own failsafe has landed it; the takeover is not proven yet."""
        world = paused(SCRIPTS[family], tmp_path / "journal")
        vehicle = world.only_vehicle
        if is_restarted:
            world.restart_broker()
            world.run(10.0)
        vehicle.steer(LANDING_MODES[family])
        vehicle.armed = vehicle.airborne = False
        world.run(2.0)
        since = len(vehicle.frames)
        resume = world.edge.event(RESUME)
        world.run(1.0)
        status, reason = answer(world, resume)
        assert status == "refused"
        assert "somebody else flies the vehicle" in (reason or "")
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert orders(vehicle, since) == []

    @KNOWN_FAMILIES
    def test_one_that_has_flown_on_and_landed_while_no_broker_ran_is_not_paused_again(
        self, family: str, tmp_path: Path
    ) -> None:
        """Somebody else has resumed it; the journal still says that an event has paused it."""
        world = paused(SCRIPTS[family], tmp_path / "journal")
        vehicle = world.only_vehicle
        world.kill_broker()
        vehicle.set_mode(FLYING_MODES[family])
        world.run_until(lambda: not vehicle.armed, within_s=300.0)
        vehicle.set_mode(PAUSED_MODES[family])
        pause = world.edge.event(PAUSE)
        world.restart_broker()
        world.run_until(lambda: answer_statuses(world, pause)[-1:] in (["done"], ["refused"]))
        assert answer(world, pause)[0] == "refused"

    @pytest.mark.parametrize("is_restarted", [True, False])
    def test_one_that_landed_and_is_switched_to_its_mission_mode_has_not_flown(
        self, tmp_path: Path, *, is_restarted: bool
    ) -> None:
        """ArduPilot is in this mode after a landing at the end of its mission too."""
        world = paused(ARDUPILOT, tmp_path / "journal")
        vehicle = world.only_vehicle
        if is_restarted:
            world.restart_broker()
            world.run(10.0)
        vehicle.steer(COPTER_LAND)
        vehicle.armed = vehicle.airborne = False
        world.run(2.0)
        vehicle.steer(COPTER_AUTO)
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
