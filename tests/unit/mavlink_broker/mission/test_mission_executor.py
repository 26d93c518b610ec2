"""Refusals, mishaps in flight, and a broker that was restarted, in simulated time."""

import dataclasses

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.broker_world import (
    FAMILIES,
    FINISHED,
    World,
    first_flight,
    flying_world,
    go_home,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.vehicle_script import (
    PX4,
    PX4_HOLD,
    PX4_MISSION,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)


class TestARefusal:
    def test_of_a_command_that_is_not_flown_comes_before_anything_is_sent(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(5.0)
        work = world.edge.plan(mission(land(1), waypoint(), go_home()))
        world.run(5.0)
        assert world.edge.statuses(1201) == [Status.ABORTED, Status.FAILED, Status.ABORTED]
        message = world.edge.reports(1201)[0]["command_report_array"][1]["message"]
        assert message == "command_type_id: it follows a landing: a take-off has to come first"
        assert world.edge.acknowledgements(work)[0]["status"] == "refused"
        assert vehicle.uploads == 0

    def test_of_an_item_fails_its_command_with_the_vehicles_status_text(self) -> None:
        world = World()
        world.add_vehicle(
            script=dataclasses.replace(PX4, refused_item=3, complaint="waypoint too far")
        )
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.ABORTED, Status.FAILED, Status.ABORTED]
        reason = world.edge.reports(1201)[-1]["message"]
        assert "MAV_MISSION_INVALID_PARAM3" in reason
        assert "waypoint too far" in reason

    def test_to_arm_fails_the_mission_with_the_reason(self) -> None:
        denied = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_DENIED}
        world = World()
        script = dataclasses.replace(PX4, results=denied, complaint="Arming denied: no propellers")
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        reason = world.edge.reports(1201)[-1]["message"]
        assert "MAV_RESULT_DENIED" in reason
        assert "Arming denied: no propellers" in reason
        assert mavlink.MAV_CMD_MISSION_START not in vehicle.commands

    def test_of_mission_start_falls_back_to_the_mission_mode(self) -> None:
        unknown = {mavlink.MAV_CMD_MISSION_START: mavlink.MAV_RESULT_UNSUPPORTED}
        world = flying_world(dataclasses.replace(PX4, results=unknown))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_of_set_current_falls_back_to_the_older_message(self) -> None:
        unknown = {mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: mavlink.MAV_RESULT_UNSUPPORTED}
        world = flying_world(dataclasses.replace(PX4, results=unknown))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_a_start_that_is_accepted_and_ignored_fails(self) -> None:
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4, ignores_start=True))
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.reports(1201)[-1]["message"] == (
            "start accepted, but mode is AUTO.LOITER"
        )

    def test_a_start_that_is_obeyed_after_it_has_failed_is_not_flown(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ignores_start=True))
        world.air.delay(vehicle, 0.2)
        world.run(3.0)
        world.edge.plan(first_flight())
        world.run_until(lambda: world.app.sessions[1].state is State.FAILING)
        vehicle.airborne = True  # The order to disarm arrives too late, and is refused
        vehicle.set_mode(PX4_MISSION)
        world.run_until(lambda: not vehicle.in_mission, within_s=5.0)
        world.run_until(lambda: not vehicle.armed, within_s=60.0)
        assert world.edge.status(1201) == Status.FAILED

    def test_a_store_that_differs_is_never_flown(self) -> None:
        world = World()
        vehicle = world.add_vehicle(
            script=dataclasses.replace(PX4, gives_ids=False, corrupts_item=2)
        )
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert (
            "item 2 on the vehicle differs in altitude" in (world.edge.reports(1201)[-1]["message"])
        )
        assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in vehicle.commands


class TestInFlight:
    @pytest.mark.thorough
    def test_a_pause_keeps_the_mission_running(self) -> None:
        world = flying_world()
        vehicle = world.only_vehicle
        vehicle.set_mode(PX4_HOLD)
        world.run(60.0)
        assert world.edge.status(1201) == Status.RUNNING
        vehicle.set_mode(PX4_MISSION)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.parametrize(("mode", "name"), [(PX4_POSITION, "POSCTL"), (PX4_RETURN, "AUTO.RTL")])
    def test_a_takeover_fails_the_mission(self, mode: int, name: str) -> None:
        world = flying_world()
        vehicle = world.only_vehicle
        vehicle.send_status_text("Failsafe")
        vehicle.set_mode(mode)
        world.run_until_over(1201, within_s=10.0)
        assert world.edge.status(1201) == Status.FAILED
        assert name in world.edge.reports(1201)[-1]["message"]
        assert "Failsafe" in world.edge.reports(1201)[-1]["message"]

    def test_disarming_early_fails_the_running_command_and_aborts_the_rest(self) -> None:
        world = flying_world()
        vehicle = world.only_vehicle
        world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
        vehicle.armed = vehicle.airborne = False
        world.run_until_over(1201, within_s=10.0)
        assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]

    def test_a_lost_link_is_waited_out(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=10.0))
        vehicle = world.only_vehicle
        vehicle.silent = True
        world.run(25.0)
        assert world.edge.bodies("/vehicles/1")[-1]["link_state"] == "lost"
        assert world.edge.status(1201) == Status.RUNNING
        vehicle.silent = False
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_a_link_lost_until_after_the_landing_still_ends_finished(self) -> None:
        world = flying_world()
        vehicle = world.only_vehicle
        world.run(1.0)
        vehicle.silent = True
        world.run(30.0)
        assert not vehicle.armed
        vehicle.silent = False
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.statuses(1201) == FINISHED

    def test_a_restarted_vehicle_fails_its_mission(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=10.0))
        world.run(5.0)
        vehicle = world.only_vehicle
        vehicle.reboot(world.clock.now)
        world.run_until_over(1201, within_s=10.0)
        assert "restarted" in world.edge.reports(1201)[-1]["message"]

    def test_a_restart_while_being_armed_begins_again(self) -> None:
        refused = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: mavlink.MAV_RESULT_IN_PROGRESS}
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, results=refused))
        world.run(5.0)
        world.edge.plan(first_flight())
        world.run_until(lambda: world.app.sessions[1].state is State.ARMING)
        vehicle.script = PX4
        vehicle.reboot(world.clock.now)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 2

    def test_the_streams_of_a_restarted_vehicle_are_requested_again(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(5.0)
        asked = vehicle.commands.count(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
        vehicle.reboot(world.clock.now)
        world.run(5.0)
        assert vehicle.commands.count(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL) >= 2 * asked

    def test_another_mission_put_onto_the_vehicle_is_noticed(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=30.0))
        vehicle = world.only_vehicle
        vehicle.items = vehicle.items[:2]
        world.run_until_over(1201, within_s=10.0)
        assert "another mission" in world.edge.reports(1201)[-1]["message"]


class TestARestartedBroker:
    @pytest.mark.first_case
    @FAMILIES
    def test_goes_on_where_the_vehicle_is(self, script: Script) -> None:
        world = flying_world(dataclasses.replace(script, item_time_s=6.0))
        vehicle = world.only_vehicle
        world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
        results = len(world.edge.bodies("/pose/"))
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1
        assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 1
        assert len(world.edge.bodies("/pose/")) == results + 2

    def test_recognises_its_mission_although_home_has_moved_a_little(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=6.0))
        world.edge.plan(mission(takeoff(), waypoint(), go_home(landing=False)))
        world.run_until(lambda: vehicle.airborne)
        vehicle.home = (vehicle.home[0] + 2e-5, vehicle.home[1] - 2e-5, vehicle.home[2])
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1

    def test_finds_a_landing_that_it_missed(self) -> None:
        world = flying_world()
        vehicle = world.only_vehicle
        vehicle.silent = True
        world.run(30.0)
        assert not vehicle.armed
        vehicle.silent = False
        world.restart_broker()
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.statuses(1201) == FINISHED

    def test_begins_again_what_was_accepted_and_never_started(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=10.0))
        work = world.edge.plan(first_flight())
        world.run(3.0)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1
        assert len(world.edge.acknowledgements(work)) == 1

    @pytest.mark.thorough
    def test_flies_what_waited_behind_the_mission_in_flight(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=4.0))
        world.edge.plan(mission(takeoff(), go_home(landing=False), mission_id=1))
        world.edge.plan(first_flight(mission_id=2))
        world.run_until(lambda: vehicle.airborne)
        world.restart_broker()
        world.run_until_over(2)
        assert world.edge.status(1) == Status.FINISHED
        assert world.edge.statuses(2) == FINISHED
        assert vehicle.uploads == 2

    @pytest.mark.thorough
    def test_waits_for_a_pilot_to_land_before_a_mission_that_never_started(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.armed = vehicle.airborne = True
        vehicle.set_mode(PX4_POSITION)
        world.run(5.0)
        world.edge.plan(first_flight())
        world.run(5.0)
        world.restart_broker()
        world.run(120.0)
        assert world.edge.status(1201) is None
        vehicle.armed = vehicle.airborne = False
        vehicle.set_mode(PX4_HOLD)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_does_not_take_another_mission_for_its_own(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=30.0))
        vehicle = world.only_vehicle
        vehicle.items[3].z += 10.0
        world.restart_broker()
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.status(1201) == Status.FAILED
        assert (
            "item 3 on the vehicle differs in altitude" in (world.edge.reports(1201)[-1]["message"])
        )

    def test_keeps_statuses_that_the_edge_server_has(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=6.0))
        world.run_until(lambda: world.edge.statuses(1201)[1] == Status.FINISHED)
        world.restart_broker()
        before = len(world.edge.reports(1201))
        world.run_until_over(1201)
        for report in world.edge.reports(1201)[before:]:
            assert report["command_report_array"][0]["command_status_id"] == Status.FINISHED

    def test_work_that_is_handed_out_twice_is_flown_once(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        work = world.edge.plan(first_flight())
        world.run(2.0)
        world.edge.hand_out_again()
        world.run_until_over(1201)
        world.run(30.0)
        assert vehicle.uploads == 1
        assert len(world.edge.acknowledgements(work)) == 1


class TestASlowLink:
    """A vehicle disarms by itself when it is not started soon after it was armed."""

    def test_a_vehicle_that_shows_itself_armed_is_started_though_its_answer_is_lost(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.lost_answers.add(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.commands.count(mavlink.MAV_CMD_COMPONENT_ARM_DISARM) <= 2

    def test_a_vehicle_that_shows_itself_in_the_mission_flies_it_though_its_answer_is_lost(
        self,
    ) -> None:
        world = World()
        vehicle = world.add_vehicle()
        vehicle.lost_answers.add(mavlink.MAV_CMD_MISSION_START)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) <= 2
