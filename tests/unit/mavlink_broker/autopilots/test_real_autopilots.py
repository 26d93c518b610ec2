"""Missions on vehicles that have the habits of PX4 and ArduPilot, in simulated time."""

import dataclasses
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.codec import Decoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import (
    FINISHED,
    World,
    example_mission,
    first_flight,
    go_home,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.mission_scenes import flown
from tests.support.real_autopilots import (
    COPTER_3_6,
    COPTER_4_6,
    PX4_1_14,
    PX4_1_16,
    PX4_1_17,
    PX4_BARE,
    PX4_BARE_1_14,
)
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import (
    COPTER_AUTO,
    COPTER_GUIDED,
    HOME,
    PX4_HOLD,
    PX4_MISSION,
    PX4_POSITION,
    Script,
)

ALL = {
    "px4 1.14": PX4_1_14,
    "px4 1.16": PX4_1_16,
    "px4 1.17": PX4_1_17,
    "copter 3.6": COPTER_3_6,
    "copter": COPTER_4_6,
}
AUTOPILOTS = pytest.mark.parametrize("script", list(ALL.values()), ids=list(ALL))
PX4S = pytest.mark.parametrize(
    "script", [PX4_1_14, PX4_1_16, PX4_1_17], ids=["1.14", "1.16", "1.17"]
)
BARE = pytest.mark.parametrize("script", [PX4_BARE_1_14, PX4_BARE], ids=["answers", "is silent"])
COPTERS = pytest.mark.parametrize("script", [COPTER_3_6, COPTER_4_6], ids=["3.6", "4.6"])


def command(command_id: int, kind: int, **parameters: Any) -> dict[str, Any]:
    return {"command_id": command_id, "command_type_id": kind, "parameters": parameters}


def follow(command_id: int = 2) -> dict[str, Any]:
    return command(command_id, 8, latitude=HOME[0], longitude=HOME[1], altitude=10.0)


def picture(command_id: int) -> dict[str, Any]:
    return command(command_id, 4, pitch_angle=-90.0)


def panorama(command_id: int) -> dict[str, Any]:
    return command(command_id, 10, panorama_mode=0)


def track(command_id: int = 2) -> dict[str, Any]:
    return command(command_id, 9, corners=[[0.2, 0.2], [0.8, 0.8]], track_mode=3)


def circle(command_id: int) -> dict[str, Any]:
    place = {"latitude": HOME[0], "longitude": HOME[1], "orbit_altitude": 8.0}
    circle_parameters = {"radius": 50.0, "angular_velocity": 2.0, "start_point": 4, "orbit_type": 0}
    return command(command_id, 7, **place, **circle_parameters)


def started(script: Script, plan: Any) -> tuple[World, ScriptedVehicle]:
    """A world in which a mission has come to its second command."""
    world = World()
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(plan)
    world.run_until(lambda: world.edge.reports(1201))
    world.run_until(lambda: world.edge.statuses(1201)[1] == Status.RUNNING)
    world.run(3.0)
    return world, vehicle


def reason(world: World) -> str:
    return str(world.edge.reports(1201)[-1]["message"])


class TestEveryAutopilot:
    @pytest.mark.first_case
    @AUTOPILOTS
    @pytest.mark.parametrize("name", ["first_flight", "eleven_commands"])
    def test_flies_the_example_plans(self, script: Script, name: str) -> None:
        plan = example_mission(name)
        world = flown(script, plan)
        report = world.edge.reports(plan["mission_id"])[-1]
        assert report["mission_status_id"] == Status.FINISHED, report
        assert not world.only_vehicle.armed

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_flies_over_a_link_that_loses_a_fifth_in_each_direction(self, script: Script) -> None:
        assert flown(script, loss=0.2).edge.statuses(1201) == FINISHED

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_stores_fractions_radians_and_no_pitch_and_is_verified(self, script: Script) -> None:
        """What an autopilot rounds, converts or drops in storage is no difference."""
        plan = mission(
            takeoff(yaw_angle=-90.0, minimum_pitch=7.5),
            waypoint(hold_time=2.5, desired_yaw_angle=359.9),
            go_home(),
        )
        assert flown(script, plan).edge.statuses(1201) == FINISHED

    @AUTOPILOTS
    def test_sends_the_capacity_of_its_battery(self, script: Script) -> None:
        world = World()
        world.add_vehicle(script=script)
        world.run(15.0)
        assert world.edge.bodies("/state_vector/")[-1]["battery_capacity"] == 4.2

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_flies_one_mission_after_another(self, script: Script) -> None:
        """The second begins at its first item, whatever the vehicle remembers of the first."""
        world = World()
        vehicle = world.add_vehicle(script=script)
        for number in (1, 2):
            world.edge.plan(first_flight(mission_id=number))
            world.run_until_over(number)
            assert world.edge.statuses(number) == FINISHED
        assert vehicle.uploads == 2

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_may_work_on_a_command_for_some_time(self, script: Script) -> None:
        slow = frozenset({mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_MISSION_START})
        world = flown(dataclasses.replace(script, in_progress=slow))
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.first_case
    @AUTOPILOTS
    def test_sends_everything_again_after_a_restart(self, script: Script) -> None:
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.run(20.0)
        vehicle.reboot(world.clock.now)
        world.run(8.0)
        ages = {
            name: world.app.sessions[1].vehicle.age_s(name, world.clock.now)
            for name in ("GLOBAL_POSITION_INT", "ATTITUDE", "BATTERY_STATUS", "MISSION_CURRENT")
        }
        assert all(age is not None and age < 2.0 for age in ages.values()), ages


class TestPx4:
    @pytest.mark.first_case
    @PX4S
    def test_is_taken_to_a_mode_that_it_arms_in(self, script: Script) -> None:
        """Without a remote control it is not ready to arm in a mode that is flown by one."""
        world = World()
        vehicle = world.add_vehicle(script=script)
        vehicle.set_mode(PX4_POSITION)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @PX4S
    def test_that_accepts_a_mission_and_finds_it_infeasible_is_not_flown(
        self, script: Script
    ) -> None:
        world = flown(dataclasses.replace(script, is_infeasible=True))
        assert world.edge.status(1201) == Status.FAILED
        assert "Mission rejected: takeoff altitude too low!" in reason(world)
        assert not world.only_vehicle.airborne

    def test_that_was_armed_and_does_not_start_is_disarmed(self) -> None:
        """No propeller turns on a vehicle whose mission has failed on the ground."""
        world = flown(dataclasses.replace(PX4_1_14, is_infeasible=True))
        world.run(2.0)
        vehicle = world.only_vehicle
        arming = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        orders = [values[0] for command, values in vehicle.parameters if command == arming]
        assert orders[0] == 1.0
        assert orders[-1] == 0.0
        assert not vehicle.armed

    def test_that_reports_an_infeasible_mission_is_not_armed(self) -> None:
        world = flown(dataclasses.replace(PX4_1_17, is_infeasible=True))
        assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in world.only_vehicle.commands

    @pytest.mark.first_case
    @PX4S
    def test_that_flies_only_attended_by_a_ground_station_has_one(self, script: Script) -> None:
        """PX4's simulated quadrotor has NAV_DLL_ACT = 2 and does not arm without one."""
        world = flown(dataclasses.replace(script, link_loss_action=2))
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.thorough
    def test_that_flies_only_attended_flies_on_when_the_broker_is_restarted(self) -> None:
        world = World()
        vehicle = world.add_vehicle(
            script=dataclasses.replace(PX4_1_17, link_loss_action=2, item_time_s=8.0)
        )
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_without_the_parameter_of_link_loss_has_a_companion(self) -> None:
        """Its mission survives a broker that dies, whatever it does without a station."""
        world = flown(dataclasses.replace(PX4_1_17, link_loss_action=None))
        sent = Decoder().decode(b"".join(frame for _, frame in world.air.sent))
        kinds = {m.type for m in sent if m.get_type() == "HEARTBEAT"}
        assert kinds == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}

    def test_that_reports_a_missing_ground_station_gets_one(self) -> None:
        world = World()
        quiet = dataclasses.replace(PX4_1_17, link_loss_action=None, needs_station_for_texts=False)
        vehicle = world.add_vehicle(script=quiet)
        world.run(3.0)
        vehicle.send_status_text("Preflight Fail: No connection to the ground control station\t", 4)
        before = len(world.air.sent)
        world.run(3.0)
        sent = Decoder().decode(b"".join(frame for _, frame in world.air.sent[before:]))
        assert mavlink.MAV_TYPE_GCS in {m.type for m in sent if m.get_type() == "HEARTBEAT"}

    @pytest.mark.first_case
    @PX4S
    def test_whose_checks_still_run_is_armed_when_they_are_done(self, script: Script) -> None:
        slow = dataclasses.replace(script, ready_to_arm_after_s=12.0)
        assert flown(slow).edge.statuses(1201) == FINISHED

    @pytest.mark.thorough
    def test_that_begins_to_count_anew_at_the_end_has_finished(self) -> None:
        script = dataclasses.replace(PX4_1_17, current_goes_to_0_at_the_end=True)
        assert flown(script).edge.statuses(1201) == FINISHED

    @pytest.mark.first_case
    @PX4S
    def test_lands_by_leaving_the_mission_and_disarms_later(self, script: Script) -> None:
        world = flown(dataclasses.replace(script, disarms_after_s=6.0))
        assert world.edge.statuses(1201) == FINISHED
        assert not world.only_vehicle.armed

    @pytest.mark.thorough
    @BARE
    def test_without_payload_flies_all_and_the_report_names_what_it_left_out(
        self, script: Script
    ) -> None:
        """Its simulation has no camera: for one the autopilot answers FAILED, later nothing."""
        plan = example_mission("eleven_commands")
        world = flown(script, plan)
        report = world.edge.reports(plan["mission_id"])[-1]
        assert report["mission_status_id"] == Status.FINISHED, report
        messages = {one["command_id"]: one.get("message") for one in report["command_report_array"]}
        assert messages[8] == messages[9] == "left out: the vehicle has no camera"

    @pytest.mark.thorough
    @BARE
    def test_that_carries_nothing_flies_on_behind_a_live_command(self, script: Script) -> None:
        """A gimbal that is not fitted gives no answer."""
        world = flown(script, mission(takeoff(), follow(), picture(3), panorama(4), go_home(5)))
        assert world.edge.status(1201) == Status.FINISHED
        messages = [
            one.get("message") for one in world.edge.reports(1201)[-1]["command_report_array"]
        ]
        assert all("the vehicle has no camera" in str(text) for text in messages[2:4])

    def test_whose_camera_is_there_and_refuses_fails(self) -> None:
        refusal = {mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE: mavlink.MAV_RESULT_DENIED}
        point = {mavlink.MAV_CMD_CAMERA_TRACK_POINT: mavlink.MAV_RESULT_DENIED}
        world = World()
        script = dataclasses.replace(PX4_1_17, results={**PX4_1_17.results, **refusal, **point})
        world.add_camera(world.add_vehicle(script=script))
        world.edge.plan(mission(takeoff(), track(), go_home(3)))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]

    @pytest.mark.first_case
    @pytest.mark.parametrize("second", [waypoint(2, 30.0, hold_time=60.0), circle(2)])
    def test_that_its_own_failsafe_holds_has_failed(self, second: dict[str, Any]) -> None:
        """A breach of its fence makes it hold for ever: it was not paused."""
        script = dataclasses.replace(PX4_1_17, item_time_s=20.0)
        world, vehicle = started(script, mission(takeoff(), second, go_home(3)))
        vehicle.send_status_text("Geofence exceeded, position outside of fence", 2)
        vehicle.fail_safe(PX4_HOLD)
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]
        assert "failsafe holds it (Geofence exceeded" in reason(world)

    @pytest.mark.thorough
    def test_that_holds_before_its_failsafe_acts_may_go_on(self) -> None:
        """It waits for 5 s, and flies on if its ground station is back meanwhile."""
        world, vehicle = started(dataclasses.replace(PX4_1_17, item_time_s=10.0), first_flight())
        vehicle.fail_safe(PX4_HOLD)
        world.run(7.0)
        vehicle.set_mode(PX4_MISSION)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_that_a_pilot_stops_on_its_circle_has_not_finished_it(self) -> None:
        """Its circle has no end of its own: a hold makes it stay there."""
        world, vehicle = started(PX4_1_17, mission(takeoff(), circle(2), go_home(3)))
        vehicle.set_mode(PX4_HOLD)
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]
        assert "the vehicle left its circle: mode AUTO.LOITER" in reason(world)

    @pytest.mark.first_case
    @PX4S
    def test_is_not_turned_to_north_by_a_hold(self, script: Script) -> None:
        world = flown(script, mission(takeoff(), waypoint()))
        hold = world.only_vehicle.items[-1]
        assert hold.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM
        assert hold.param4 != hold.param4, "NaN: the heading that it has"


class TestArduPilot:
    @pytest.mark.first_case
    @COPTERS
    def test_is_armed_in_guided_and_begins_from_there(self, script: Script) -> None:
        world = World()
        vehicle = world.add_vehicle(script=script)
        vehicle.set_mode(COPTER_AUTO)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        modes = [
            values[1]
            for command, values in vehicle.parameters
            if command == mavlink.MAV_CMD_DO_SET_MODE
        ]
        assert modes[0] == COPTER_GUIDED

    @pytest.mark.first_case
    @COPTERS
    def test_is_waited_for_until_it_can_navigate(self, script: Script) -> None:
        """In STABILIZE it reports ready to arm, and has a home, before it has a position."""
        world = flown(dataclasses.replace(script, navigates_after_s=35.0))
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.first_case
    @COPTERS
    def test_that_finds_fault_for_a_while_is_armed_afterwards(self, script: Script) -> None:
        """In GUIDED it checks what it does not in STABILIZE, such as GPS against estimate."""
        world = World()
        picky = dataclasses.replace(script, arms_in=frozenset())
        vehicle = world.add_vehicle(script=picky)
        world.edge.plan(first_flight())
        world.run_until(lambda: mavlink.MAV_CMD_COMPONENT_ARM_DISARM in vehicle.commands)
        world.run(8.0)
        vehicle.script = script
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.first_case
    @COPTERS
    def test_is_never_armed_in_a_manual_mode(self, script: Script) -> None:
        guided = {mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_FAILED}
        world = flown(dataclasses.replace(script, results=guided))
        assert world.edge.status(1201) == Status.FAILED
        assert world.only_vehicle.arm_orders == 0

    @pytest.mark.first_case
    @COPTERS
    def test_whose_checks_are_switched_off_is_flown(self, script: Script) -> None:
        """ARMING_CHECK = 0: the check is there, not enabled, and never well."""
        world = flown(dataclasses.replace(script, checks_are_off=True))
        assert world.edge.statuses(1201) == FINISHED

    def test_is_taken_out_of_auto_before_it_gets_a_mission(self) -> None:
        """Disarmed in AUTO it goes through a new mission at once, as far as the take-off."""
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        vehicle.set_mode(COPTER_AUTO)
        world.edge.plan(first_flight())
        world.run_until(lambda: len(vehicle.items) > 1)
        assert vehicle.custom_mode == COPTER_GUIDED

    @pytest.mark.first_case
    @COPTERS
    def test_whose_checks_fail_reports_which(self, script: Script) -> None:
        refused = dataclasses.replace(
            script, arms_in=frozenset(), arming_complaint="PreArm: Compass not calibrated"
        )
        world = flown(refused)
        assert world.edge.status(1201) == Status.FAILED
        assert "PreArm: Compass not calibrated" in reason(world)
        assert world.only_vehicle.uploads == 1

    def test_that_sends_few_streams_gets_requests(self) -> None:
        for script in (COPTER_4_6, COPTER_3_6):
            world = World()
            world.add_vehicle(script=script)
            world.run(30.0)
            snapshot = world.app.sessions[1].vehicle.snapshot
            assert snapshot.position is not None
            assert snapshot.battery_fraction == pytest.approx(0.8)
            assert world.edge.bodies("/state_vector/")

    @pytest.mark.first_case
    @COPTERS
    def test_begins_its_mission_anew_behind_the_landing_and_has_finished(
        self, script: Script
    ) -> None:
        """Disarmed it loses its progress and stays in AUTO; no ground station has set it back."""
        for seed in range(4):
            world = World(loss=0.2, seed=seed)
            vehicle = world.add_vehicle(script=script)
            world.edge.plan(mission(takeoff(), waypoint(), land()))
            world.run_until_over(1201)
            assert world.edge.statuses(1201) == FINISHED
            assert vehicle.current == 1
            assert "set the vehicle back" not in str(world.edge.reports(1201)[-1].get("message"))

    def test_holds_a_mixture_after_a_broken_transfer_and_gets_a_whole_one(self) -> None:
        """Its store is not atomic: what was broken off lies over the mission before."""
        world = World()
        vehicle = world.add_vehicle(script=COPTER_4_6)
        world.edge.plan(
            mission(takeoff(), *(waypoint(i, 5.0 * i) for i in range(2, 9)), go_home(9))
        )
        world.run_until(lambda: len(vehicle.items) > 4)
        vehicle.silent = True
        world.run(9.0)
        vehicle.silent = False
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        assert [item.seq for item in vehicle.items] == list(range(14))
        assert [i.command for i in vehicle.items].count(mavlink.MAV_CMD_NAV_TAKEOFF) == 1

    @pytest.mark.first_case
    @COPTERS
    def test_is_no_plane(self, script: Script) -> None:
        """The numbers of a plane's modes mean other things: none is ever sent."""
        plane = dataclasses.replace(script, vehicle_type=mavlink.MAV_TYPE_FIXED_WING)
        world = World()
        vehicle = world.add_vehicle(script=plane)
        world.edge.plan(first_flight())
        world.run(30.0)
        assert world.app.sessions[1].vehicle.family.name == "ardupilot-other"
        assert mavlink.MAV_CMD_DO_SET_MODE not in vehicle.commands
        assert mavlink.MAV_CMD_MISSION_START in vehicle.commands


class TestAPausedMission:
    @pytest.mark.thorough
    def test_goes_on_in_the_mission_mode_of_px4(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4_1_17)
        world.edge.plan(first_flight())
        world.run_until(lambda: vehicle.airborne)
        world.run(3.0)
        vehicle.set_mode(PX4_HOLD)
        world.run(30.0)
        vehicle.set_mode(PX4_MISSION)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
