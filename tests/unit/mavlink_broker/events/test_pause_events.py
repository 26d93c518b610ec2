"""An event pauses a mission, and another one resumes it."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.flight_orders import (
    FLIES_NO_COMMAND,
    NOT_PAUSED,
    PAUSED,
    PAUSED_INSTEAD,
)
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import FLYING_MODES, KNOWN_FAMILIES, PAUSED_MODES, SCRIPTS
from tests.support.broker_events import ABORT, PAUSE, RESUME, SOFT_ABORT, answer, answer_statuses
from tests.support.broker_world import World, go_home, hotpoint, mission, takeoff, waypoint
from tests.support.mission_scenes import in_mission, paused, paused_live, slow, state
from tests.support.orders import orders
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_BRAKE,
    COPTER_LOITER,
    COPTER_RETURN,
    PX4,
    PX4_HOLD,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

EVERY = pytest.mark.parametrize("family", SCRIPTS)


class TestItems:
    @pytest.mark.first_case
    @EVERY
    def test_a_paused_mission_stays_and_goes_on_when_it_is_resumed(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        vehicle = world.only_vehicle
        assert vehicle.custom_mode == PAUSED_MODES[family]
        since = len(vehicle.frames)
        world.run(100.0)
        assert orders(vehicle, since) == []
        assert vehicle.custom_mode == PAUSED_MODES[family]
        assert world.edge.status(1201) == Status.RUNNING
        resume = world.edge.event(RESUME)
        world.run(3.0)
        assert answer_statuses(world, resume) == ["accepted", "done"]
        assert vehicle.custom_mode == FLYING_MODES[family]
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 3

    @KNOWN_FAMILIES
    def test_a_failsafe_that_does_nothing_does_not_end_a_pause(self, family: str) -> None:
        """ArduPilot shows one from a low battery on, whatever its action (`Copter.h`)."""
        world = paused(SCRIPTS[family])
        vehicle = world.only_vehicle
        vehicle.fail_safe(vehicle.custom_mode)
        world.run(60.0)
        assert world.edge.status(1201) == Status.RUNNING
        resume = world.edge.event(RESUME)
        world.run(3.0)
        assert answer_statuses(world, resume) == ["accepted", "done"]
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 3

    @KNOWN_FAMILIES
    def test_a_pause_that_arrives_behind_its_resume_can_be_resumed(self, family: str) -> None:
        world = World()
        vehicle = world.add_vehicle(script=slow(SCRIPTS[family]))
        world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
        world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
        world.run(7.0)
        world.edge.event(PAUSE)
        resume = world.edge.event(RESUME)
        world.run(3.0)
        assert answer_statuses(world, resume) == ["accepted", "done"]
        vehicle.steer(PAUSED_MODES[family])
        world.run(20.0)
        assert world.edge.status(1201) == Status.RUNNING
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "paused"
        resume = world.edge.event(RESUME)
        world.run(3.0)
        assert answer_statuses(world, resume) == ["accepted", "done"]
        assert vehicle.custom_mode == FLYING_MODES[family]

    @KNOWN_FAMILIES
    def test_a_resume_that_arrives_behind_the_next_pause_does_not_fly_on(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        vehicle = world.only_vehicle
        world.edge.event(RESUME)
        pause = world.edge.event(PAUSE)
        world.run(3.0)
        assert answer_statuses(world, pause) == ["accepted", "done"]
        vehicle.steer(FLYING_MODES[family])
        world.run(3.0)
        assert vehicle.custom_mode == PAUSED_MODES[family]
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "paused"

    @KNOWN_FAMILIES
    def test_the_report_says_that_an_event_has_paused_it(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        world.run(20.0)
        messages = [c.get("message") for c in world.edge.reports(1201)[-1]["command_report_array"]]
        assert PAUSED in messages
        assert not any("somebody else" in (message or "") for message in messages)

    @KNOWN_FAMILIES
    def test_the_vehicle_is_shown_as_paused_until_it_flies_on(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "paused"
        world.edge.event(RESUME)
        world.run(3.0)
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "mission"
        world.only_vehicle.steer(COPTER_LOITER if family == "ardupilot" else PX4_POSITION)
        world.run(1.5)
        shown = "hold" if family == "ardupilot" else "manual"
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == shown

    @KNOWN_FAMILIES
    def test_a_pause_that_does_not_arrive_is_not_shown_and_says_what_is_not_known(
        self, family: str
    ) -> None:
        world = World()
        vehicle = world.add_vehicle(script=slow(SCRIPTS[family]))
        world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
        world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
        world.run(7.0)
        world.air.is_uplink_up = False
        event = world.edge.event(PAUSE)
        world.run(4.0)
        assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "mission"
        world.run(12.0)
        status, message = answer(world, event)
        assert status == "refused"
        assert message is not None
        assert message.endswith("attempts, the vehicle may have obeyed")

    @KNOWN_FAMILIES
    @pytest.mark.parametrize("kind", [PAUSE, RESUME])
    def test_what_the_vehicle_is_seen_to_obey_is_done_though_its_answers_are_lost(
        self, family: str, kind: int
    ) -> None:
        """As over a link whose round trip is longer than any answer is waited for."""
        if kind == RESUME:
            world = paused(SCRIPTS[family])
        else:
            world = World()
            world.add_vehicle(script=slow(SCRIPTS[family]))
            world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
            world.run_until(lambda: world.only_vehicle.airborne and state(world) is State.RUNNING)
            world.run(7.0)
        world.only_vehicle.lost_answers |= {
            mavlink.MAV_CMD_DO_SET_MODE,
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
            mavlink.MAV_CMD_MISSION_START,
        }
        event = world.edge.event(kind)
        world.run(60.0)
        assert answer_statuses(world, event) == ["accepted", "done"]
        modes = PAUSED_MODES if kind == PAUSE else FLYING_MODES
        assert world.only_vehicle.custom_mode == modes[family]

    @KNOWN_FAMILIES
    def test_an_abort_ends_a_paused_mission_at_once(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        event = world.edge.event(ABORT)
        world.run_until(lambda: not world.only_vehicle.armed)
        world.run(1.0)
        assert answer_statuses(world, event) == ["accepted", "done"]
        assert world.edge.status(1201) == Status.ABORTED

    @KNOWN_FAMILIES
    def test_a_soft_abort_of_a_paused_mission_waits_for_nothing(self, family: str) -> None:
        world = paused(SCRIPTS[family])
        world.edge.event(SOFT_ABORT)
        world.run(2.0)
        assert world.edge.status(1201) == Status.ABORTED
        returning = COPTER_RETURN if family == "ardupilot" else PX4_RETURN
        assert world.only_vehicle.custom_mode == returning

    @pytest.mark.first_case
    @KNOWN_FAMILIES
    def test_a_pause_replaces_a_soft_abort_that_waits(self, family: str) -> None:
        world = in_mission(SCRIPTS[family])
        soft = world.edge.event(SOFT_ABORT)
        world.run(1.0)
        world.edge.event(PAUSE)
        world.run(60.0)
        assert world.only_vehicle.custom_mode == PAUSED_MODES[family]
        assert answer(world, soft) == ("refused", PAUSED_INSTEAD)
        world.edge.event(RESUME)
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED

    def test_pausing_twice_is_done_twice(self) -> None:
        world = paused(PX4)
        again = world.edge.event(PAUSE)
        world.run(1.0)
        assert answer(world, again) == ("done", None)

    def test_a_pause_behind_a_resume_that_is_on_its_way_is_obeyed(self) -> None:
        world = paused(PX4)
        world.edge.event(RESUME)
        pause = world.edge.event(PAUSE)
        world.run(5.0)
        assert answer(world, pause) == ("done", None)
        assert world.only_vehicle.custom_mode == PX4_HOLD
        world.run(30.0)
        assert world.only_vehicle.custom_mode == PX4_HOLD

    def test_a_vehicle_that_refuses_to_hold_flies_on_and_says_so(self) -> None:
        denied = mavlink.MAV_RESULT_DENIED
        results = {
            mavlink.MAV_CMD_DO_SET_MODE: denied,
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE: denied,
        }
        world = in_mission(PX4)
        world.only_vehicle.script = dataclasses.replace(
            world.only_vehicle.script, results=results, item_time_s=1.0
        )
        pause = world.edge.event(PAUSE)
        world.run(5.0)
        status, message = answer(world, pause)
        assert status == "refused"
        assert "MAV_RESULT_DENIED" in (message or "")
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED

    def test_nothing_is_resumed_that_no_event_has_paused(self) -> None:
        world = in_mission(PX4)
        resume = world.edge.event(RESUME)
        world.run(2.0)
        assert answer(world, resume) == ("refused", NOT_PAUSED)

    @KNOWN_FAMILIES
    def test_a_mission_that_a_ground_station_resumes_is_not_paused_any_more(
        self, family: str
    ) -> None:
        world = paused(SCRIPTS[family])
        world.only_vehicle.set_mode(FLYING_MODES[family])
        world.run(2.0)
        resume = world.edge.event(RESUME)
        world.run(2.0)
        assert answer(world, resume) == ("refused", NOT_PAUSED)
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED


class TestWhoeverElseFlies:
    @pytest.mark.first_case
    @pytest.mark.parametrize(
        ("family", "mode"),
        [("px4", PX4_POSITION), ("own", PX4_POSITION), ("ardupilot", COPTER_LOITER)],
    )
    @pytest.mark.parametrize("begin", [paused, paused_live])
    def test_a_pilot_who_takes_a_paused_vehicle_keeps_it(
        self, begin: object, family: str, mode: int
    ) -> None:
        assert callable(begin)
        world = begin(SCRIPTS[family])
        vehicle = world.only_vehicle
        vehicle.steer(mode)
        world.run(1.5)
        since = len(vehicle.frames)
        resume = world.edge.event(RESUME)
        world.run(30.0)
        assert orders(vehicle, since) == []
        assert vehicle.custom_mode == mode
        assert answer(world, resume)[0] == "refused"

    @KNOWN_FAMILIES
    @pytest.mark.parametrize("is_seen", [True, False], ids=["flown", "disarmed"])
    def test_one_who_lands_it_behind_its_last_item_ends_the_mission(
        self, family: str, tmp_path: Path, *, is_seen: bool
    ) -> None:
        """Paused between its items and a command that is flown live."""
        world = World(journal=tmp_path)
        vehicle = world.add_vehicle(script=dataclasses.replace(SCRIPTS[family], landing_s=600.0))
        world.edge.plan(mission(takeoff(1), hotpoint(2), go_home(3)))
        world.run_until(lambda: vehicle.airborne)
        world.run(2.0)
        world.kill_broker()
        world.run(3.0)
        world.restart_broker()
        pause = world.edge.event(PAUSE)
        world.run_until(lambda: answer_statuses(world, pause)[-1:] == ["done"])
        world.run(3.0)
        assert world.edge.status(1201) == Status.RUNNING
        if is_seen:
            vehicle.steer(PX4_POSITION if family != "ardupilot" else 0)
            world.run(4.0)
        vehicle.armed = vehicle.airborne = vehicle.is_manual = False
        vehicle.heartbeat()
        world.run(8.0)
        assert world.edge.status(1201) == Status.FAILED

    @pytest.mark.first_case
    @KNOWN_FAMILIES
    def test_whoever_sets_the_mission_mode_during_a_paused_live_command_has_the_vehicle(
        self, family: str
    ) -> None:
        world = paused_live(SCRIPTS[family])
        vehicle = world.only_vehicle
        vehicle.set_mode(FLYING_MODES[family])
        since = len(vehicle.frames)
        world.run(20.0)
        assert orders(vehicle, since) == []
        assert world.edge.status(1201) == Status.FAILED

    def test_a_pause_by_a_ground_station_is_not_ended_by_an_event(self) -> None:
        world = paused(PX4)
        vehicle = world.only_vehicle
        reposition = mavlink.MAV_CMD_DO_REPOSITION
        vehicle.send(mavlink.MAVLink_command_ack_message(reposition, 0, 0, 0, 255, 190))
        world.run(1.0)
        since = len(vehicle.frames)
        resume = world.edge.event(RESUME)
        world.run(3.0)
        status, message = answer(world, resume)
        assert (status, orders(vehicle, since)) == ("refused", [])
        assert "system 255" in (message or "")

    @pytest.mark.parametrize(
        ("script", "home", "hold"),
        [(PX4, PX4_RETURN, PX4_HOLD), (ARDUPILOT, COPTER_RETURN, COPTER_BRAKE)],
        ids=["px4", "ardupilot"],
    )
    def test_a_pause_that_a_pilot_has_overtaken_cannot_be_resumed(
        self, script: Script, home: int, hold: int
    ) -> None:
        """The order to hold arrives behind his order to return, and ends the return."""
        world = World()
        vehicle = world.add_vehicle(script=slow(script))
        world.edge.plan(mission(takeoff(1), waypoint(2, hold_time=60.0), go_home(3)))
        world.run_until(lambda: vehicle.airborne and state(world) is State.RUNNING)
        world.run(7.0)
        before = vehicle.script
        refusal = {mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_TEMPORARILY_REJECTED}
        vehicle.script = dataclasses.replace(before, results=refusal)
        since, pause = len(vehicle.frames), world.edge.event(PAUSE)
        world.run(0.3)
        assert orders(vehicle, since)
        vehicle.steer(home)
        world.run(0.3)
        vehicle.script = before
        vehicle.steer(hold)
        world.run(0.3)
        assert answer_statuses(world, pause)[-1] == "refused"
        resume = world.edge.event(RESUME)
        world.run(3.0)
        assert answer_statuses(world, resume) == ["accepted", "refused"]
        assert vehicle.custom_mode == hold

    def test_no_event_pauses_a_vehicle_that_its_pilot_flies(self) -> None:
        world = in_mission(PX4)
        world.only_vehicle.steer(PX4_POSITION)
        world.run(1.5)
        since = len(world.only_vehicle.frames)
        pause = world.edge.event(PAUSE)
        world.run(3.0)
        assert answer(world, pause)[0] == "refused"
        assert orders(world.only_vehicle, since) == []


class TestBeforeTakeoff:
    def test_a_mission_on_the_ground_is_not_paused(self) -> None:
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=30.0))
        world.edge.plan(mission(takeoff(1), go_home(2)))
        world.run_until(lambda: state(world) is State.WAITING)
        pause = world.edge.event(PAUSE)
        world.run(1.0)
        assert answer(world, pause) == ("refused", FLIES_NO_COMMAND)

    def test_between_two_missions_items_it_waits_until_they_fly(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=slow(PX4))
        world.edge.plan(mission(takeoff(1), waypoint(2)))
        world.run_until_over(1201)
        vehicle.missions.busy_until = world.clock.now + 4.0
        world.edge.plan(mission(waypoint(1, 20.0), go_home(2), mission_id=1202))
        world.run_until(lambda: state(world) is State.UPLOADING)
        pause = world.edge.event(PAUSE)
        world.run_until(lambda: state(world) is State.RUNNING)
        world.run(3.0)
        assert answer(world, pause) == ("done", None)
        assert vehicle.custom_mode == PX4_HOLD
        world.edge.event(RESUME)
        world.run_until_over(1202)
        assert world.edge.status(1202) == Status.FINISHED
