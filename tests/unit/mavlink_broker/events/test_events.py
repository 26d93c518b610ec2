"""Events: every row of the table in every state of a mission, in simulated time."""

import dataclasses
from collections.abc import Callable
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.abort_executor import NOT_OBEYED
from mavlink_broker.mission.mission_executor import MissionExecutor
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_events import ABORT, POINT, SOFT_ABORT, SPEED, answer_statuses, answers
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.mission_reports import running
from tests.support.mission_scenes import LONG_MISSION, world_at
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_LAND,
    COPTER_RETURN,
    HOME,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_RETURN,
)

MOMENTS = {
    "taking off": 0,
    "waypoint": 1,
    "hotpoint": 2,
    "follow": 3,
    "landing": 4,
}


def is_idle(world: World) -> Callable[[], bool]:
    return lambda: world.app.sessions[1].state is State.IDLE


@pytest.mark.parametrize("command", MOMENTS.values(), ids=MOMENTS)
class TestInFlight:
    @pytest.mark.first_case
    def test_an_abort_ends_everything_now_and_lands_here(self, command: int) -> None:
        world = world_at(command)
        vehicle = world.only_vehicle
        event = world.edge.event(ABORT)
        world.run(0.5)
        expected = [Status.FINISHED] * command + [Status.ABORTED] * (5 - command)
        assert world.edge.statuses(1201) == expected
        assert world.edge.status(1201) == Status.ABORTED
        assert vehicle.custom_mode == PX4_LAND
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event) == ["accepted", "done"]

    @pytest.mark.first_case
    def test_an_abort_with_a_point_goes_there_and_lands(self, command: int) -> None:
        world = world_at(command)
        vehicle = world.only_vehicle
        world.edge.event(ABORT, abort=POINT)
        world.run_until(lambda: not vehicle.armed)
        assert world.edge.status(1201) == Status.ABORTED
        went = [v for c, v in vehicle.parameters if c == mavlink.MAV_CMD_DO_REPOSITION]
        assert went[-1][4:] == pytest.approx(
            (round(POINT["latitude"] * 1e7), round(POINT["longitude"] * 1e7), HOME[2] + 7.0)
        )
        assert vehicle.custom_mode == PX4_LAND

    @pytest.mark.first_case
    def test_a_soft_abort_waits_for_the_running_command_and_returns(self, command: int) -> None:
        world = world_at(command)
        vehicle = world.only_vehicle
        event = world.edge.event(SOFT_ABORT)
        world.run_until(lambda: (world.edge.status(1201) or 0) >= 3, within_s=40.0)
        ended = world.edge.statuses(1201)[command]
        assert ended == (Status.ABORTED if command == 3 else Status.FINISHED)
        if command < 4:
            assert world.edge.statuses(1201)[command + 1] == Status.ABORTED
            world.run(1.0)
            assert vehicle.custom_mode == PX4_RETURN
        world.run_until(lambda: not vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event) == ["accepted", "done"]

    @pytest.mark.first_case
    def test_a_soft_abort_with_a_point_holds_there(self, command: int) -> None:
        world = world_at(command)
        vehicle = world.only_vehicle
        world.edge.event(SOFT_ABORT, abort=POINT)
        world.run_until(is_idle(world), within_s=60.0)
        if command == 4:  # It lands: that is how the running command ends
            assert world.edge.status(1201) == Status.FINISHED
            return
        assert vehicle.armed
        assert vehicle.custom_mode == PX4_HOLD
        assert vehicle.place == pytest.approx((POINT["latitude"], POINT["longitude"]))

    @pytest.mark.first_case
    def test_a_new_speed_is_ordered_at_once_and_kept(self, command: int) -> None:
        world = world_at(command)
        vehicle = world.only_vehicle
        event = world.edge.event(SPEED, maximum_speed=2.5)
        world.run(0.5)
        speeds = [v for c, v in vehicle.parameters if c == mavlink.MAV_CMD_DO_CHANGE_SPEED]
        assert speeds == [(1.0, 2.5, -1.0, 0.0, 0.0, 0.0, 0.0)]
        assert answer_statuses(world, event) == ["accepted", "done"]
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        item_speeds = [
            i.param2 for i in vehicle.items if i.command == mavlink.MAV_CMD_DO_CHANGE_SPEED
        ]
        assert item_speeds == [2.5 if command < 4 else 4.0]


@pytest.mark.thorough
def test_a_speed_that_a_circle_does_not_take_holds_from_the_next_command_on() -> None:
    refusing = {mavlink.MAV_CMD_DO_CHANGE_SPEED: mavlink.MAV_RESULT_DENIED}
    world = world_at(2, dataclasses.replace(OWN, results=refusing))
    event = world.edge.event(SPEED, maximum_speed=2.5)
    world.run(2.0)
    answer = world.edge.acknowledgements(event)[-1]
    assert answer["status"] == "done"
    assert answer["message"].startswith("from the next command on: ")
    world.run_until_over(1201)
    vehicle = world.only_vehicle
    item_speeds = [i.param2 for i in vehicle.items if i.command == mavlink.MAV_CMD_DO_CHANGE_SPEED]
    assert item_speeds == [2.5]


class TestAnIdleVehicle:
    @pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
    def test_has_nothing_to_abort(self, kind: int) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        event = world.edge.event(kind)
        world.run(1.0)
        assert world.edge.acknowledgements(event) == [
            {"status": "refused", "message": "no active mission"}
        ]

    def test_that_is_not_known_is_refused(self) -> None:
        world = World()
        event = world.edge.event(ABORT, vehicle_id=9)
        world.run(9.0)
        (answer,) = world.edge.acknowledgements(event)
        assert answer == {"status": "refused", "message": "vehicle 9 is not known"}


class TestBeforeTakeOff:
    @pytest.mark.first_case
    @pytest.mark.parametrize("kind", [ABORT, SOFT_ABORT])
    def test_a_mission_that_waits_is_over_at_once(self, kind: int) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=30.0))
        world.edge.plan(mission(*LONG_MISSION))
        world.run(3.0)
        event = world.edge.event(kind)
        world.run(60.0)
        assert world.edge.statuses(1201) == [Status.ABORTED] * 5
        assert answer_statuses(world, event)[-1] == "done"
        assert not vehicle.airborne

    def test_an_upload_is_cancelled(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, busy_for_s=20.0))
        world.run(2.0)
        world.edge.plan(mission(*LONG_MISSION))
        world.run(1.0)
        assert world.app.sessions[1].state is State.UPLOADING
        world.edge.event(ABORT)
        world.run(40.0)
        assert world.edge.status(1201) == Status.ABORTED
        assert vehicle.uploads == 0

    def test_the_queue_is_emptied(self) -> None:
        world = world_at(1)
        world.edge.plan(mission(takeoff(), go_home(2), mission_id=1202))
        world.run(1.0)
        world.edge.event(ABORT)
        world.run_until(is_idle(world), within_s=60.0)
        world.run(30.0)
        assert world.edge.status(1202) == Status.ABORTED
        assert not world.only_vehicle.armed


class TestAnAbort:
    def test_is_ordered_until_the_vehicle_has_obeyed(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        modes = (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_LAND)
        refusing = dict.fromkeys(modes, mavlink.MAV_RESULT_FAILED)
        vehicle.script = dataclasses.replace(vehicle.script, results=refusing)
        event = world.edge.event(ABORT)
        world.run(10.0)
        assert answer_statuses(world, event) == ["accepted"]
        vehicle.script = dataclasses.replace(vehicle.script, results={})
        world.run(3.0)
        assert vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, event) == ["accepted", "done"]

    def test_lands_here_when_the_vehicle_will_not_go_to_the_point(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        denied = {mavlink.MAV_CMD_DO_REPOSITION: mavlink.MAV_RESULT_DENIED}
        vehicle.script = dataclasses.replace(vehicle.script, results=denied)
        event = world.edge.event(ABORT, abort=POINT)
        world.run(4.0)
        assert vehicle.custom_mode == PX4_LAND
        answer = world.edge.acknowledgements(event)[-1]
        assert answer == {"status": "done", "message": NOT_OBEYED}

    def test_comes_through_a_lost_link(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        vehicle.silent = True
        world.edge.event(ABORT)
        world.run(15.0)
        vehicle.silent = False
        world.run(15.0)
        assert not vehicle.armed
        assert world.edge.status(1201) == Status.ABORTED

    @pytest.mark.parametrize("away_s", [9.0, 12.0, 14.9, 15.0])
    def test_goes_to_its_point_when_a_lost_link_is_back(self, away_s: float) -> None:
        """An order that was lost with the link is not one that the vehicle does not obey."""
        world = world_at(1)
        vehicle = world.only_vehicle
        vehicle.silent = True
        world.edge.event(ABORT, abort=POINT)
        world.run(away_s)
        vehicle.silent = False
        world.run_until(lambda: vehicle.custom_mode == PX4_LAND)
        assert vehicle.place == pytest.approx((POINT["latitude"], POINT["longitude"]))

    def test_is_ordered_again_to_one_that_accepts_and_circles_on(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        world = world_at(2)
        vehicle = world.only_vehicle
        monkeypatch.setattr(vehicle, "set_mode", lambda _mode: None)
        event = world.edge.event(ABORT)
        world.run(5.0)
        assert answer_statuses(world, event) == ["accepted"]
        monkeypatch.undo()
        world.run(4.0)
        assert vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, event) == ["accepted", "done"]

    def test_overrules_a_soft_one(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        soft = world.edge.event(SOFT_ABORT)
        world.run_until(lambda: vehicle.custom_mode == PX4_RETURN)
        hard = world.edge.event(ABORT)
        world.run(1.0)
        assert vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, soft)[-1] == answer_statuses(world, hard)[-1] == "done"

    @pytest.mark.thorough
    def test_ends_a_soft_one_that_still_waits(self) -> None:
        world = world_at(1)
        soft = world.edge.event(SOFT_ABORT)
        world.run(0.5)
        assert answer_statuses(world, soft) == ["accepted"]
        hard = world.edge.event(ABORT)
        world.run(1.0)
        assert world.only_vehicle.custom_mode == PX4_LAND
        assert answer_statuses(world, soft) == answer_statuses(world, hard) == ["accepted", "done"]

    def test_is_followed_by_the_next_mission_after_the_landing(self) -> None:
        world = world_at(1)
        world.edge.event(ABORT)
        world.run_until(lambda: not world.only_vehicle.armed)
        world.edge.plan(mission(takeoff(), go_home(2), mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.status(1202) == Status.FINISHED

    def test_ends_with_the_pose_where_the_vehicle_has_come_down(self) -> None:
        world = world_at(1)
        before = len(world.edge.bodies("/pose/"))
        world.edge.event(ABORT)
        world.run_until(lambda: not world.only_vehicle.armed)
        world.run(30.0)
        poses = world.edge.bodies("/pose/")[before:]
        assert len(poses) == 1
        assert poses[0]["altitude"] == pytest.approx(0.0, abs=0.5)

    def test_before_the_start_ends_without_a_pose(self) -> None:
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=100.0))
        world.edge.plan(mission(*LONG_MISSION))
        world.run(10.0)
        world.edge.event(ABORT)
        world.run(30.0)
        assert world.edge.bodies("/pose/") == []

    @pytest.mark.first_case
    @pytest.mark.parametrize(("kind", "mode"), [(ABORT, COPTER_LAND), (SOFT_ABORT, COPTER_RETURN)])
    def test_is_understood_by_ardupilot(self, kind: int, mode: int) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(ARDUPILOT, item_time_s=6.0))
        world.edge.plan(mission(takeoff(), waypoint(), go_home(3)))
        world.run_until(lambda: running(world) == 1)
        world.edge.event(kind)
        world.run_until(lambda: vehicle.custom_mode == mode, within_s=30.0)
        world.run_until(lambda: not vehicle.armed)


@pytest.mark.thorough
def test_a_second_soft_abort_changes_the_place_and_not_the_deadline() -> None:
    world = world_at(3)
    first = world.edge.event(SOFT_ABORT)
    world.run(20.0)
    second = world.edge.event(SOFT_ABORT, abort=POINT)
    world.run(1.0)
    assert answer_statuses(world, first) == ["accepted", "done"]
    world.run(10.0)
    assert world.edge.status(1201) == Status.ABORTED
    world.run_until(is_idle(world))
    assert answer_statuses(world, second) == ["accepted", "done"]
    assert world.only_vehicle.place == pytest.approx((POINT["latitude"], POINT["longitude"]))


@pytest.mark.thorough
def test_a_restarted_broker_knows_a_mission_whose_speed_an_event_has_changed() -> None:
    world = world_at(1)
    world.edge.event(SPEED, maximum_speed=2.5)
    world.run(1.0)
    uploads = world.only_vehicle.uploads
    world.restart_broker()
    world.run(3.0)
    assert world.only_vehicle.uploads == uploads
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


def test_an_event_is_carried_out_once_however_often_it_is_handed_out() -> None:
    world = world_at(1)
    world.edge.event(SPEED, maximum_speed=2.5)
    world.run(1.0)
    world.edge.hand_out_again()
    world.run(1.0)
    orders: list[Any] = [c for c in world.only_vehicle.commands if c == 178]
    assert len(orders) == 1


class TestEveryEventHasOneFinalAnswer:
    """Also where the mission ends before it could be carried out."""

    def test_a_speed_that_is_being_ordered_when_an_alarm_ends_the_mission(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        waits = {mavlink.MAV_CMD_DO_CHANGE_SPEED: mavlink.MAV_RESULT_IN_PROGRESS}
        vehicle.script = dataclasses.replace(vehicle.script, results=waits)
        event = world.edge.event(SPEED, maximum_speed=2.5)
        world.run(0.5)
        assert answer_statuses(world, event) == ["accepted"]
        vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
        world.run_until_over(1201)
        world.run(1.0)
        assert answers(world, event) == [("accepted", None), ("refused", "the mission has ended")]

    def test_a_speed_that_comes_when_the_mission_is_over(self) -> None:
        world = world_at(1)
        vehicle = world.only_vehicle
        vehicle.script = dataclasses.replace(vehicle.script, goes_to_places=False)
        world.edge.event(ABORT, abort=POINT)
        world.run(1.0)
        event = world.edge.event(SPEED, maximum_speed=2.5)
        world.run(1.0)
        assert answers(world, event) == [("accepted", None), ("refused", "the mission has ended")]
        assert mavlink.MAV_CMD_DO_CHANGE_SPEED not in vehicle.commands

    @pytest.mark.first_case
    @pytest.mark.parametrize("kind", [SPEED, SOFT_ABORT])
    def test_one_that_waits_when_the_mission_is_dropped(
        self, kind: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """By an internal error, and by another one while that is dealt with."""
        world = world_at(1)
        vehicle = world.only_vehicle
        waits = {mavlink.MAV_CMD_DO_CHANGE_SPEED: mavlink.MAV_RESULT_IN_PROGRESS}
        vehicle.script = dataclasses.replace(vehicle.script, results=waits)
        more: dict[str, Any] = {"maximum_speed": 2.5} if kind == SPEED else {}
        event = world.edge.event(kind, **more)
        world.run(0.5)
        assert answer_statuses(world, event) == ["accepted"]

        def fail(*_: Any, **__: Any) -> None:
            raise RuntimeError("unexpected")

        monkeypatch.setattr(MissionExecutor, "tick", fail)
        monkeypatch.setattr(MissionExecutor, "fail_after_error", fail)
        world.tick()
        monkeypatch.undo()
        world.run(1.0)
        assert world.edge.status(1201) == Status.FAILED
        assert len(answer_statuses(world, event)) == 2
        assert answer_statuses(world, event)[-1] in {"done", "refused"}
        assert "internal error" in str(answers(world, event)[-1][1])

    @pytest.mark.first_case
    @pytest.mark.parametrize("is_restarted", [False, True], ids=["at once", "after a wait"])
    def test_one_whose_carrying_out_meets_an_error(
        self, monkeypatch: pytest.MonkeyPatch, *, is_restarted: bool
    ) -> None:
        """The mission that it had ended by then answers it too, and counts no more."""
        world = world_at(1)
        reason = "unexpected"

        def fail(*_: Any, **__: Any) -> None:
            raise RuntimeError(reason)

        monkeypatch.setattr(MissionExecutor, "_abort_when_due", fail)
        if is_restarted:
            world.restart_broker()
        event = world.edge.event(SOFT_ABORT)
        world.run(5.0)
        monkeypatch.undo()
        world.run(5.0)
        assert world.edge.status(1201) == Status.FAILED
        finals = [status for status in answer_statuses(world, event) if status != "accepted"]
        assert len(finals) == 1
        assert "internal error" in str(answers(world, event)[-1][1])
