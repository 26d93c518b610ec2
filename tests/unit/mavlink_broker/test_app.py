"""Whole missions by the whole broker, in simulated time."""

import dataclasses
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.app import AUTOPILOT
from mavlink_broker.config import Config
from mavlink_broker.dialect import Encoder, mavlink
from mavlink_broker.session_states import State
from tests.support.broker_world import (
    World,
    first_flight,
    go_home,
    land,
    mission,
    takeoff,
    waypoint,
)
from tests.support.scripted_vehicle import (
    ARDUPILOT,
    PX4,
    PX4_HOLD,
    PX4_MISSION,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

GENERIC = Script(autopilot=mavlink.MAV_AUTOPILOT_GENERIC)
FAMILIES = pytest.mark.parametrize("script", [PX4, ARDUPILOT, GENERIC])
FINISHED = [Status.FINISHED] * 3


def vehicle_updates(world: World, vehicle_id: int = 1) -> list[dict[str, Any]]:
    return world.edge.bodies(f"/vehicles/{vehicle_id}")


def flying_world(script: Script = PX4) -> World:
    world = World()
    world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    return world


class TestAWholeMission:
    @FAMILIES
    def test_is_flown_and_every_command_reported(self, script: Script) -> None:
        world = World()
        world.add_vehicle(script=script)
        work = world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        assert world.edge.statuses(1201) == FINISHED
        assert world.edge.acknowledgements(work) == [{"status": "accepted"}]
        assert len(world.edge.bodies("/pose/")) == 3
        assert len(world.edge.bodies("/battery/")) == 3

    @FAMILIES
    def test_survives_a_link_that_loses_a_fifth_each_way(self, script: Script) -> None:
        for seed in range(3):
            world = World(loss=0.2, seed=seed)
            vehicle = world.add_vehicle(script=script)
            world.run(5.0)
            world.edge.plan(first_flight())
            world.run_until_over(1201)
            assert world.edge.statuses(1201) == FINISHED
            assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) >= 1

    def test_reports_running_first_and_only_one_terminal_status(self) -> None:
        world = flying_world()
        world.run_until_over(1201)
        world.run(60.0)
        statuses = [r["mission_status_id"] for r in world.edge.reports(1201)]
        assert statuses[0] == Status.RUNNING
        assert statuses.count(Status.FINISHED) == 1
        assert statuses == sorted(statuses)

    def test_posts_pose_and_battery_before_the_report_of_a_finished_command(self) -> None:
        world = flying_world()
        world.run_until_over(1201)
        told = [p.path for p in world.edge.posts if p.path in RESULT_PATHS]
        one = ["/pose/", "/battery/", "/mission_report/"]
        assert told == ["/mission_report/", *one, *one, *one]

    def test_needs_no_item_reached_messages(self) -> None:
        world = flying_world(dataclasses.replace(PX4, tells_reached=False))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_is_reported_every_thirty_seconds_although_nothing_changes(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=100.0))
        world.run(95.0)
        assert len(world.edge.reports(1201)) == 4

    @FAMILIES
    def test_ending_in_the_air_finishes_on_arrival_and_the_next_begins_there(
        self, script: Script
    ) -> None:
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(mission(takeoff(), waypoint(), go_home(landing=False)))
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.airborne
        world.edge.plan(first_flight(mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.statuses(1202) == FINISHED
        assert not vehicle.airborne

    def test_a_refusal_in_the_air_leaves_the_vehicle_to_the_next_mission(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(mission(takeoff(), waypoint(), go_home(landing=False)))
        world.run_until_over(1201)
        vehicle.script = dataclasses.replace(PX4, refused_item=2)
        world.edge.plan(first_flight(mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.status(1202) == Status.FAILED
        assert vehicle.airborne
        vehicle.script = PX4
        world.edge.plan(first_flight(mission_id=1203))
        world.run_until_over(1203)
        assert world.edge.statuses(1203) == FINISHED

    def test_landing_at_a_point_finishes_on_the_ground(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.edge.plan(mission(takeoff(), waypoint(), land()))
        world.run_until(lambda: vehicle.airborne)
        world.run_until(lambda: not vehicle.armed)
        world.run_until_over(1201, within_s=5.0)
        assert world.edge.statuses(1201) == FINISHED


RESULT_PATHS = frozenset({"/pose/", "/battery/", "/mission_report/"})


class TestARefusal:
    def test_of_a_command_that_is_not_flown_comes_before_anything_is_sent(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(5.0)
        video = {"command_id": 7, "command_type_id": 5, "parameters": {}}
        work = world.edge.plan(mission(takeoff(), video, go_home()))
        world.run(5.0)
        assert world.edge.statuses(1201) == [Status.ABORTED, Status.FAILED, Status.ABORTED]
        message = world.edge.reports(1201)[0]["command_report_array"][1]["message"]
        assert message == "VIDEO_START_CAPTURE cannot be flown yet"
        assert world.edge.acknowledgements(work)[0]["status"] == "refused"
        assert vehicle.uploads == 0

    def test_of_an_item_fails_its_command_with_the_vehicles_words(self) -> None:
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


class TestWaiting:
    def test_for_a_vehicle_to_be_ready_to_arm(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=20.0))
        world.edge.plan(first_flight())
        world.run(15.0)
        assert vehicle.uploads == 0
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED

    def test_in_vain_fails_with_the_vehicles_last_words(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=1e6))
        world.edge.plan(first_flight())
        world.run(30.0)
        vehicle.say("Preflight Fail: no GPS")
        world.run_until_over(1201, within_s=40.0)
        assert world.edge.reports(1201)[-1]["message"] == (
            "not ready after 60 s: it is not ready to arm (Preflight Fail: no GPS)"
        )

    def test_for_a_vehicle_that_is_never_heard_ends_too(self) -> None:
        world = World()
        world.edge.plan(first_flight(vehicle_id=9))
        world.run_until_over(1201, within_s=70.0)
        assert world.edge.status(1201) == Status.FAILED
        assert "not heard" in world.edge.reports(1201)[-1]["message"]

    def test_missions_of_one_vehicle_fly_one_after_the_other(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        first, second = first_flight(1), first_flight(2)
        world.edge.plan(first)
        world.edge.plan(second)
        world.run_until_over(1)
        assert world.edge.status(2) is None
        world.run_until_over(2)
        assert vehicle.uploads == 2
        assert world.edge.statuses(2) == FINISHED

    def test_past_its_expiry_aborts_a_mission(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=50.0))
        world.edge.plan(first_flight(), expires_at="2026-11-21T08:00:30Z")
        world.run_until_over(1201, within_s=40.0)
        assert world.edge.status(1201) == Status.ABORTED
        assert world.edge.statuses(1201) == [Status.ABORTED] * 3
        world.run(60.0)
        assert vehicle.uploads == 0


class TestInFlight:
    def test_a_pause_keeps_the_mission_running(self) -> None:
        world = flying_world()
        vehicle = next(iter(world.air.vehicles.values()))
        vehicle.set_mode(PX4_HOLD)
        world.run(60.0)
        assert world.edge.status(1201) == Status.RUNNING
        vehicle.set_mode(PX4_MISSION)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    @pytest.mark.parametrize(("mode", "name"), [(PX4_POSITION, "POSCTL"), (PX4_RETURN, "AUTO.RTL")])
    def test_another_hand_fails_the_mission(self, mode: int, name: str) -> None:
        world = flying_world()
        vehicle = next(iter(world.air.vehicles.values()))
        vehicle.say("Failsafe")
        vehicle.set_mode(mode)
        world.run_until_over(1201, within_s=10.0)
        assert world.edge.status(1201) == Status.FAILED
        assert name in world.edge.reports(1201)[-1]["message"]
        assert "Failsafe" in world.edge.reports(1201)[-1]["message"]

    def test_disarming_early_fails_the_running_command_and_aborts_the_rest(self) -> None:
        world = flying_world()
        vehicle = next(iter(world.air.vehicles.values()))
        world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
        vehicle.armed = vehicle.airborne = False
        world.run_until_over(1201, within_s=10.0)
        assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]

    def test_a_lost_link_is_waited_out(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=10.0))
        vehicle = next(iter(world.air.vehicles.values()))
        vehicle.silent = True
        world.run(25.0)
        assert vehicle_updates(world)[-1]["link_state"] == "lost"
        assert world.edge.status(1201) == Status.RUNNING
        vehicle.silent = False
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_a_link_lost_until_after_the_landing_still_ends_finished(self) -> None:
        world = flying_world()
        vehicle = next(iter(world.air.vehicles.values()))
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
        vehicle = next(iter(world.air.vehicles.values()))
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

    def test_a_restarted_vehicle_is_asked_for_its_streams_again(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(20.0)
        asked = vehicle.commands.count(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
        vehicle.reboot(world.clock.now)
        world.run(5.0)
        assert vehicle.commands.count(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL) >= 2 * asked

    def test_another_mission_put_onto_the_vehicle_is_noticed(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=30.0))
        vehicle = next(iter(world.air.vehicles.values()))
        vehicle.items = vehicle.items[:2]
        world.run_until_over(1201, within_s=10.0)
        assert "another mission" in world.edge.reports(1201)[-1]["message"]


class TestARestartedBroker:
    @FAMILIES
    def test_goes_on_where_the_vehicle_is(self, script: Script) -> None:
        world = flying_world(dataclasses.replace(script, item_time_s=6.0))
        vehicle = next(iter(world.air.vehicles.values()))
        world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
        results = len(world.edge.bodies("/pose/"))
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1
        assert vehicle.commands.count(mavlink.MAV_CMD_MISSION_START) == 1
        assert len(world.edge.bodies("/pose/")) == results + 2

    def test_knows_its_mission_although_home_has_moved_a_little(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(PX4, item_time_s=6.0))
        world.edge.plan(mission(takeoff(), waypoint(), go_home(landing=False)))
        world.run_until(lambda: vehicle.airborne)
        vehicle.home = (vehicle.home[0] + 2e-5, vehicle.home[1] - 2e-5, vehicle.home[2])
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED
        assert vehicle.uploads == 1

    def test_learns_of_a_landing_that_it_missed(self) -> None:
        world = flying_world()
        vehicle = next(iter(world.air.vehicles.values()))
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

    def test_does_not_take_another_mission_for_its_own(self) -> None:
        world = flying_world(dataclasses.replace(PX4, item_time_s=30.0))
        vehicle = next(iter(world.air.vehicles.values()))
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

    def test_work_given_twice_is_flown_once(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        work = world.edge.plan(first_flight())
        world.run(2.0)
        world.edge.hand_out_again()
        world.run_until_over(1201)
        world.run(30.0)
        assert vehicle.uploads == 1
        assert len(world.edge.acknowledgements(work)) == 1


class TestSeveralVehicles:
    def test_fly_at_once_each_its_own_mission(self) -> None:
        world = World()
        vehicles = [world.add_vehicle(system) for system in (1, 2, 3)]
        for system in (1, 2, 3):
            world.edge.plan(first_flight(mission_id=1200 + system, vehicle_id=system))
        world.run_until(lambda: all(vehicle.airborne for vehicle in vehicles), within_s=10.0)
        for system in (1, 2, 3):
            world.run_until_over(1200 + system)
            assert world.edge.statuses(1200 + system) == FINISHED
        assert [vehicle.uploads for vehicle in vehicles] == [1, 1, 1]

    def test_a_silent_one_does_not_hold_up_another(self) -> None:
        world = World()
        silent = world.add_vehicle(1)
        world.add_vehicle(2, ARDUPILOT)
        world.run(3.0)
        silent.silent = True
        world.edge.plan(first_flight(mission_id=1, vehicle_id=1))
        world.edge.plan(first_flight(mission_id=2, vehicle_id=2))
        world.run_until_over(2, within_s=40.0)
        assert world.edge.statuses(2) == FINISHED

    def test_may_carry_other_numbers_than_their_system_ids(self) -> None:
        world = World(config=Config(vehicle_of_system={1: 70}))
        vehicle = world.add_vehicle(1)
        world.edge.plan(first_flight(vehicle_id=70))
        world.run_until_over(1201)
        assert vehicle.uploads == 1
        assert {b["vehicle_id"] for b in world.edge.bodies("/state_vector/")} == {70}


class TestTelling:
    def test_a_vehicle_is_introduced_at_first_sight_with_what_is_known(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        assert world.edge.posts[0].path == "/vehicles/1"
        update = vehicle_updates(world)[-1]
        assert update["link_state"] == "connected"
        assert update["autopilot"] == "px4"
        assert update["mode"] == "AUTO.LOITER"
        assert update["armed"] is False
        assert update["mission_id"] is None

    def test_a_change_of_mode_is_told_at_once(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(3.0)
        vehicle.set_mode(PX4_POSITION)
        world.run(0.1)
        assert vehicle_updates(world)[-1]["mode"] == "POSCTL"

    def test_a_state_vector_comes_every_second_while_the_vehicle_is_heard(self) -> None:
        world = World()
        vehicle = world.add_vehicle()
        world.run(1.0)
        before = len(world.edge.bodies("/state_vector/"))
        world.run(10.0)
        assert 9 <= len(world.edge.bodies("/state_vector/")) - before <= 10
        vehicle.silent = True
        world.run(3.0)
        before = len(world.edge.bodies("/state_vector/"))
        world.run(10.0)
        assert len(world.edge.bodies("/state_vector/")) == before

    def test_a_wish_for_the_latest_state_is_answered_at_once_by_every_vehicle(self) -> None:
        world = World()
        world.add_vehicle(1)
        world.add_vehicle(2)
        world.run(5.1)
        before = len(world.edge.bodies("/state_vector/"))
        work = world.edge.ask_state()
        world.tick()
        new = world.edge.bodies("/state_vector/")[before:]
        assert {body["vehicle_id"] for body in new} == {1, 2}
        assert world.edge.acknowledgements(work) == [{"status": "done"}]

    def test_a_wish_for_a_vehicle_that_is_not_there_is_refused(self) -> None:
        world = World()
        work = world.edge.ask_state(5)
        world.tick()
        assert world.edge.acknowledgements(work)[0]["status"] == "refused"

    def test_battery_size_is_read_from_the_vehicle_else_from_the_configuration(self) -> None:
        sizes = []
        for capacity in (4200.0, None):
            world = World()
            world.add_vehicle(script=dataclasses.replace(PX4, battery_capacity_mah=capacity))
            world.run(20.0)
            sizes.append(world.edge.bodies("/state_vector/")[-1]["battery_capacity"])
        assert sizes == [4.2, 5.2]


class TestStrangers:
    @pytest.mark.parametrize(
        "kind",
        [mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_CAMERA, mavlink.MAV_TYPE_ONBOARD_CONTROLLER],
    )
    def test_that_do_not_fly_are_no_vehicles(self, kind: int) -> None:
        world = World()
        world.add_vehicle(script=dataclasses.replace(PX4, vehicle_type=kind))
        world.run(3.0)
        assert world.app.sessions == {}

    def test_other_components_do_not_speak_for_the_vehicle(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        camera = Encoder(1, 100)
        far = mavlink.MAVLink_global_position_int_message(0, 100, 100, 0, 0, 0, 0, 0, 0)
        world.air.to_broker(("192.0.2.1", 14581), camera.encode(far))
        world.run(0.05)
        position = world.app.sessions[1].vehicle.snapshot.position
        assert position is not None
        assert position.latitude_deg == pytest.approx(40.4434)

    def test_hostile_bytes_change_nothing(self) -> None:
        world = flying_world()
        address = ("192.0.2.1", 14581)
        for data in (b"", b"\xfd", b"\xfd\xff" + b"\0" * 300, bytes(range(256)) * 3):
            world.air.to_broker(address, data)
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == FINISHED

    def test_impossible_values_are_not_believed(self) -> None:
        world = World()
        world.add_vehicle()
        world.run(3.0)
        encoder = Encoder(1, AUTOPILOT)
        for latitude in (2**31 - 1, -(2**31), 910_000_000):
            message = mavlink.MAVLink_global_position_int_message(
                9000, latitude, 0, 0, 0, 0, 0, 0, 0
            )
            world.air.to_broker(("192.0.2.1", 14581), encoder.encode(message))
        nan = float("nan")
        attitude = mavlink.MAVLink_attitude_message(9000, nan, nan, nan, 0, 0, 0)
        world.air.to_broker(("192.0.2.1", 14581), encoder.encode(attitude))
        world.run(3.0)
        for body in world.edge.bodies("/state_vector/"):
            assert body["latitude"] == pytest.approx(40.4434)
            assert body["yaw"] == pytest.approx(270.0)

    def test_work_that_cannot_be_read_is_refused_and_the_rest_goes_on(self) -> None:
        world = World()
        world.add_vehicle()
        broken = first_flight()
        broken["command_array"][0]["parameters"]["latitude"] = 91
        bad = world.edge.plan(broken)
        world.edge.plan(first_flight(mission_id=2))
        world.run_until_over(2)
        assert world.edge.acknowledgements(bad)[0]["status"] == "refused"
        assert world.edge.statuses(2) == FINISHED
