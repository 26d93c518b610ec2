"""An event ends a mission and returns the vehicle home."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import KNOWN_FAMILIES, SCRIPTS
from tests.support.broker_events import ABORT, RETURN_HOME, SOFT_ABORT, answer_statuses
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.mission_scenes import in_mission, slow, state
from tests.support.vehicle_script import COPTER_RETURN, PX4, PX4_RETURN


class TestReturnHome:
    @KNOWN_FAMILIES
    def test_it_does_not_wait_for_the_running_command(self, family: str) -> None:
        world = in_mission(SCRIPTS[family])
        event = world.edge.event(RETURN_HOME)
        world.run(1.5)
        assert world.edge.status(1201) == Status.ABORTED
        returning = COPTER_RETURN if family == "ardupilot" else PX4_RETURN
        assert world.only_vehicle.custom_mode == returning
        world.run_until(lambda: not world.only_vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event) == ["accepted", "done"]

    @pytest.mark.first_case
    @KNOWN_FAMILIES
    @pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT, RETURN_HOME])
    def test_a_vehicle_that_hovers_behind_its_mission_obeys_too(
        self, family: str, kind: int
    ) -> None:
        world = World()
        vehicle = world.add_vehicle(script=slow(SCRIPTS[family]))
        world.edge.plan(mission(takeoff(1), waypoint(2)))
        world.run_until_over(1201)
        world.run(5.0)
        assert vehicle.airborne
        event = world.edge.event(kind)
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event) == ["accepted", "done"]

    def test_it_survives_a_restart_of_the_broker(self, tmp_path: Path) -> None:
        world = World(journal=tmp_path / "journal")
        vehicle = world.add_vehicle(script=slow(PX4))
        world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
        world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
        deaf = {mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_TEMPORARILY_REJECTED}
        before = vehicle.script
        vehicle.script = dataclasses.replace(before, results=deaf)
        event = world.edge.event(RETURN_HOME)
        world.run(0.5)
        world.restart_broker()
        vehicle.script = before
        world.run(20.0)
        assert vehicle.custom_mode == PX4_RETURN or not vehicle.armed
        world.run_until(lambda: not vehicle.armed)
        world.run(2.0)
        assert answer_statuses(world, event)[-1] == "done"
