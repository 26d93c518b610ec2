"""ArduCopter's habits in flight, as its sources have them: circles, speeds, old items."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.broker_events import PAUSE, RESUME
from tests.support.broker_world import (
    FINISHED,
    World,
    example_mission,
    go_home,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import flown
from tests.support.real_autopilots import COPTER_4_1, COPTER_4_6, PX4_1_17, ROVER
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import (
    COPTER_AUTO,
    COPTER_BRAKE,
    COPTER_LOITER,
    COPTER_RETURN,
    COPTER_STABILIZE,
    HOME,
    Script,
)

SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT
CIRCLE = mavlink.MAV_CMD_NAV_LOITER_TURNS


def hotpoint(**more: Any) -> dict[str, Any]:
    parameters = {
        "latitude": HOME[0],
        "longitude": HOME[1] + 3e-4,
        "orbit_altitude": 8.0,
        "radius": 10.0,
        "angular_velocity": 10.0,
        "is_clockwise": True,
        "orbit_type": 2,
    }
    return {"command_id": 2, "command_type_id": 7, "parameters": parameters | more}


def speeds_round_the_circle(vehicle: ScriptedVehicle) -> tuple[float, float]:
    """The last speed set before the circle, the first one behind it."""
    kinds = [item.command for item in vehicle.items]
    circle = kinds.index(CIRCLE)
    before = [item.param2 for item in vehicle.items[:circle] if item.command == SPEED]
    behind = [item.param2 for item in vehicle.items[circle:] if item.command == SPEED]
    return before[-1], behind[0]


def notes(world: World) -> list[str]:
    """The messages of the last report, per command."""
    (mission_id,) = {report["mission_id"] for report in world.edge.bodies("/mission_report/")}
    reports = world.edge.reports(mission_id)[-1]["command_report_array"]
    return [report.get("message", "") for report in reports]


class TestACircle:
    def test_is_as_slow_as_the_vehicle_may_fly(self) -> None:
        """AC_Circle.cpp: AUTO keeps the rate it was switched on with, and no more than that."""
        world = flown(COPTER_4_6, mission(takeoff(), hotpoint(), go_home()))
        assert world.edge.statuses(1201) == FINISHED
        before, behind = speeds_round_the_circle(world.only_vehicle)
        assert before == pytest.approx(math.radians(10.0) * 10.0)
        assert behind == 4.0

    def test_that_is_wide_is_slower_still_and_the_report_notes_it(self) -> None:
        """No more than half of WPNAV_ACCEL goes into the turn."""
        world = flown(
            COPTER_4_6, mission(takeoff(), hotpoint(radius=11, angular_velocity=20), go_home())
        )
        assert "limited to 19.3 deg/s" in notes(world)[1]

    @pytest.mark.first_case
    @pytest.mark.parametrize("is_clockwise", [True, False])
    def test_turns_as_versions_before_4_4_can(self, *, is_clockwise: bool) -> None:
        """They know a direction by CIRCLE_RATE alone, and no sign of a radius."""
        settings = {"CIRCLE_RATE": 20.0, "CIRCLE_OPTIONS": 1.0}
        script = dataclasses.replace(COPTER_4_1, settings={**COPTER_4_1.settings, **settings})
        world = flown(script, mission(takeoff(), hotpoint(is_clockwise=is_clockwise), go_home()))
        written = dict(world.only_vehicle.written[:2])
        assert math.copysign(1.0, written["CIRCLE_RATE"]) == (1.0 if is_clockwise else -1.0)

    def test_that_is_too_fast_for_it_is_flown_from_point_to_point(self) -> None:
        plan = mission(takeoff(), hotpoint(radius=8, angular_velocity=26), go_home())
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.edge.plan(plan)
        world.run_until(lambda: mavlink.MAV_CMD_DO_REPOSITION in vehicle.commands)
        world.run(2.0)
        reposition = vehicle.commands.index(mavlink.MAV_CMD_DO_REPOSITION)
        assert vehicle.commands[reposition + 1] == SPEED, "a reposition sets the vehicle's own"
        assert vehicle.parameters[reposition + 1][1][1] == 4.0


class TestANewSpeed:
    def test_holds_behind_a_circle_whose_items_know_the_old_one(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.edge.plan(mission(takeoff(), hotpoint(), waypoint(3), go_home(4)))
        world.run_until(lambda: vehicle.airborne)
        world.edge.event(3, maximum_speed=2.0)
        kinds = [item.command for item in vehicle.items]
        world.run_until(lambda: vehicle.current == kinds.index(CIRCLE))
        before_the_circle = vehicle.commands.count(SPEED)
        world.run_until(lambda: vehicle.current > kinds.index(CIRCLE) + 4)
        world.run(1.0)
        speeds = [values[1] for number, values in vehicle.parameters if number == SPEED]
        assert speeds == [2.0] * len(speeds)
        assert len(speeds) > before_the_circle > 0

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4_1_17, COPTER_4_6], ids=["px4", "copter"])
    @pytest.mark.parametrize(
        "state", [State.UPLOADING, State.VERIFYING, State.SELECTING, State.ARMING, State.STARTING]
    )
    def test_may_come_while_the_items_are_uploaded(self, script: Script, state: State) -> None:
        """The vehicle holds the items that were uploaded; the speed is ordered behind them."""
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(), waypoint(2), waypoint(3), go_home(4)))
        world.run_until(lambda: any(s.state is state for s in world.app.sessions.values()))
        event = world.edge.event(3, maximum_speed=2.0)
        world.run_until_over(1201)
        assert set(world.edge.statuses(1201)) == {3}
        assert {values[1] for number, values in vehicle.parameters if number == SPEED} == {2.0}
        assert world.edge.acknowledgements(event)[-1]["status"] == "done"

    @pytest.mark.parametrize("script", [PX4_1_17, COPTER_4_6], ids=["px4", "copter"])
    def test_bounds_the_vector_of_a_leg_that_climbs(self, script: Script) -> None:
        """Both limit the horizontal speed of it alone: 2 m/s up a slope of 45 degrees."""
        world = World()
        vehicle = world.add_vehicle(script=script)
        climb = waypoint(2, north_m=10.0, altitude=15.0)
        level = waypoint(3, north_m=30.0, altitude=15.0)
        world.edge.plan(mission(takeoff(altitude=5.0), climb, level, go_home(4)))
        world.run_until(lambda: vehicle.airborne)
        legs = [n for n, item in enumerate(vehicle.items) if item.command == WAYPOINT]
        world.run_until(lambda: vehicle.current == legs[-2])
        world.edge.event(3, maximum_speed=2.0)
        world.run_until(lambda: vehicle.current > legs[-2])
        world.run(1.0)
        speeds = [values[1] for number, values in vehicle.parameters if number == SPEED]
        assert speeds[0] == pytest.approx(2.0 * math.cos(math.radians(45.0)), rel=0.3)
        assert speeds[0] < speeds[-1] == 2.0


@pytest.mark.thorough
def test_a_vehicle_without_camera_items_flies_all_commands() -> None:
    plan = example_mission("eleven_commands")
    world = flown(COPTER_4_1, plan)
    report = world.edge.reports(plan["mission_id"])[-1]
    assert set(world.edge.statuses(plan["mission_id"])) == {3}, report
    assert "no camera" in notes(world)[0]
    assert "shutter" in notes(world)[3]


class TestABrokerThatWasAway:
    @pytest.mark.first_case
    @pytest.mark.parametrize("last", [land(3), go_home(3)], ids=["land", "return"])
    @pytest.mark.parametrize("script", [COPTER_4_1, COPTER_4_6], ids=["4.1", "4.6"])
    @pytest.mark.parametrize("killed_after_s", [0.0, 3.0])
    def test_finds_a_mission_that_is_over_and_begins_anew(
        self, script: Script, last: dict[str, Any], killed_after_s: float
    ) -> None:
        """Landed in AUTO it is at its first item again: it is not to be flown once more."""
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(), waypoint(), last))
        world.run_until(lambda: vehicle.airborne)
        world.run(killed_after_s)
        world.kill_broker()
        world.run_until(lambda: not vehicle.armed)
        world.run(5.0)
        world.restart_broker()
        world.run_until_over(1201)
        world.run(30.0)
        assert vehicle.uploads == 1
        assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 1
        assert world.edge.statuses(1201) == FINISHED

    def test_has_seen_it_fly_before_the_link_was_lost_until_the_landing(
        self, tmp_path: Path
    ) -> None:
        """It had not read the mission back yet; the broker before had not seen the take-off."""
        world = World(journal=tmp_path)
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.edge.plan(mission(takeoff(), waypoint(), land(3)))
        world.run_until(lambda: vehicle.airborne)
        world.run(0.2)
        world.restart_broker()
        world.run(1.5)
        vehicle.silent = True
        world.run_until(lambda: not vehicle.armed)
        world.run(5.0)
        vehicle.silent = False
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert not world.edge.bodies("/alarm/")

    def test_finds_a_vehicle_that_came_down_elsewhere(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.edge.plan(mission(takeoff(), waypoint(), land(3)))
        world.run_until(lambda: vehicle.airborne)
        world.kill_broker()
        world.run_until(lambda: not vehicle.armed)
        vehicle.place = (HOME[0] + 2e-3, HOME[1])
        world.run(2.0)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert vehicle.uploads == 1


def test_no_item_begins_before_the_mission_is_started() -> None:
    """GCS_Common.cpp: DO_SET_MISSION_CURRENT with a reset resumes the mission in any mode."""
    world = World()
    vehicle = world.add_vehicle(script=COPTER_4_6)
    for number in (1, 2):
        world.edge.plan(mission(takeoff(), waypoint(), go_home(), mission_id=number))
        world.run_until_over(number)
        assert world.edge.statuses(number) == FINISHED
    assert vehicle.begun_early == []


def test_a_failsafe_that_does_nothing_is_not_reported_as_one() -> None:
    """GCS_Mavlink.cpp: the state is CRITICAL from a low battery on, whatever its action is."""
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(COPTER_4_6, item_time_s=60.0))
    world.edge.plan(mission(takeoff(), waypoint(), go_home()))
    world.run_until(lambda: vehicle.airborne)
    vehicle.fail_safe(COPTER_AUTO)
    world.run(20.0)
    assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "mission"
    assert world.edge.status(1201) == Status.RUNNING
    vehicle.fail_safe(COPTER_RETURN)
    world.run(5.0)
    assert world.edge.bodies("/vehicles/1")[-1]["activity"] == "failsafe"


BEYOND_FENCE = mavlink.MAVLink_fence_status_message(1, 1, mavlink.FENCE_BREACH_BOUNDARY, 1000)


class TestItsFence:
    """fence.cpp: a breach changes the mode and shows no failsafe in the heartbeat."""

    def breached(self, mode: int, *, heartbeat_first: bool = False) -> World:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(COPTER_4_6, item_time_s=60.0))
        world.edge.plan(mission(takeoff(), waypoint(), go_home()))
        world.run_until(lambda: vehicle.airborne)
        world.run(3.0)
        if not heartbeat_first:
            vehicle.send(BEYOND_FENCE)
            world.run(0.2)
        vehicle.set_mode(mode)
        (session,) = world.app.sessions.values()
        world.run_until(lambda: session.vehicle.mode != "AUTO")
        world.run(0.2)
        vehicle.send(BEYOND_FENCE)
        world.run(15.0)
        return world

    @pytest.mark.parametrize("heartbeat_first", [False, True])
    @pytest.mark.parametrize("mode", [COPTER_RETURN, COPTER_BRAKE], ids=["return", "brake"])
    def test_ends_a_mission_as_a_failsafe(self, mode: int, *, heartbeat_first: bool) -> None:
        world = self.breached(mode, heartbeat_first=heartbeat_first)
        assert world.edge.status(1201) == Status.FAILED
        assert "own failsafe" in str(world.edge.reports(1201)[-1]["message"])

    def test_is_not_what_a_pilot_does_beyond_it(self) -> None:
        world = self.breached(COPTER_STABILIZE)
        assert "somebody else flies" in str(world.edge.reports(1201)[-1]["message"])


class TestMissionRestart:
    """AP_Mission.cpp, `start_or_resume`: with MIS_RESTART 1 AUTO begins at the first item."""

    RESTARTS = dataclasses.replace(COPTER_4_6, settings={"MIS_RESTART": 1.0})

    def paused(self, script: Script) -> World:
        """A world whose mission an event has paused behind its take-off."""
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(), waypoint(2), waypoint(3), go_home(4)))
        world.run_until(lambda: vehicle.airborne and vehicle.current >= 5)
        world.edge.event(PAUSE)
        world.run_until(lambda: vehicle.custom_mode == COPTER_BRAKE)
        world.run(10.0)
        return world

    @pytest.mark.first_case
    def test_does_not_begin_a_paused_mission_anew(self) -> None:
        world = self.paused(self.RESTARTS)
        vehicle = world.only_vehicle
        paused_at = vehicle.current
        world.edge.event(RESUME)
        world.run_until(lambda: vehicle.custom_mode == COPTER_AUTO)
        assert vehicle.restarted_at == []
        assert vehicle.current >= paused_at
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 4

    def test_does_not_begin_it_anew_for_a_pilot_either(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=self.RESTARTS)
        world.edge.plan(mission(takeoff(), waypoint(2), go_home()))
        world.run_until(lambda: vehicle.airborne and vehicle.current >= 5)
        vehicle.set_mode(COPTER_LOITER)
        world.run(10.0)
        vehicle.set_mode(COPTER_AUTO)
        world.run_until_over(1201)
        assert vehicle.restarted_at == []
        assert world.edge.statuses(1201) == FINISHED

    def test_is_as_its_owner_has_set_it_behind_the_flight(self) -> None:
        world = self.paused(self.RESTARTS)
        vehicle = world.only_vehicle
        assert vehicle.written == [("MIS_RESTART", 0.0)]
        world.edge.event(RESUME)
        world.run_until_over(1201)
        world.run(10.0)
        assert vehicle.written == [("MIS_RESTART", 0.0), ("MIS_RESTART", 1.0)]

    def test_is_left_where_it_is_0(self) -> None:
        world = self.paused(COPTER_4_6)
        world.edge.event(RESUME)
        world.run_until_over(1201)
        assert world.only_vehicle.written == []

    def test_that_cannot_be_set_is_in_the_report(self) -> None:
        world = self.paused(dataclasses.replace(COPTER_4_6, settings={}))
        assert "parameter MIS_RESTART: no answer" in notes(world)[0]


class TestARover:
    def test_has_finished_when_its_mission_is_complete(self) -> None:
        """It never lands, reports no landings, and stays armed where its mission ends."""
        world = World()
        vehicle = world.add_vehicle(script=ROVER)
        for number in (1, 2):
            world.edge.plan(mission(takeoff(), waypoint(), go_home(), mission_id=number))
            world.run_until_over(number)
            assert world.edge.statuses(number) == FINISHED
            world.run(3.0)
            assert not vehicle.armed
