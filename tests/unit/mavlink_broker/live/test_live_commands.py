"""Commands that are flown live, between segments of mission items, in simulated time."""

import dataclasses
import math
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mission.states import State
from tests.support.autopilot_families import OWN
from tests.support.broker_world import (
    World,
    follow,
    go_home,
    hotpoint,
    mission,
    panorama,
    takeoff,
    track,
    waypoint,
)
from tests.support.mission_reports import command_messages
from tests.support.vehicle_script import (
    ARDUPILOT,
    HOME,
    PX4,
    PX4_FOLLOW,
    PX4_MISSION,
    PX4_ORBIT,
    PX4_RETURN,
    Script,
)

FINISHED = Status.FINISHED


def video(command_id: int, kind: int = 5) -> dict[str, Any]:
    return {"command_id": command_id, "command_type_id": kind, "parameters": {}}


def flown(*commands: dict[str, Any], script: Script = OWN) -> World:
    """A world in which a mission has been flown to its end."""
    world = World()
    world.add_vehicle(script=script)
    world.edge.plan(mission(*commands))
    world.run_until_over(1201)
    return world


def status_of(world: World, command: int) -> Status | None:
    """As last reported; None before anything was."""
    if not world.edge.reports(1201):
        return None
    return Status(world.edge.statuses(1201)[command])


class TestAHotpoint:
    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [PX4, OWN], ids=["PX4", "own"])
    def test_is_flown_between_two_segments(self, script: Script) -> None:
        world = flown(takeoff(), hotpoint(), waypoint(3), go_home(4), script=script)
        assert world.edge.statuses(1201) == [FINISHED] * 4
        vehicle = world.only_vehicle
        orbit = [v for c, v in vehicle.parameters if c == mavlink.MAV_CMD_DO_ORBIT]
        assert len(orbit) == 1
        radius_m, speed_m_s, heading, angle = orbit[0][:4]
        assert (radius_m, heading) == (10.0, 3.0)
        assert speed_m_s == pytest.approx(math.radians(20.0) * 10.0)
        assert orbit[0][6] == HOME[2] + 8.0
        assert math.isnan(angle) if script is PX4 else angle == pytest.approx(2 * math.pi)
        assert vehicle.uploads == 2
        assert not vehicle.armed

    def test_begins_at_its_start_point(self) -> None:
        world = flown(takeoff(), hotpoint(), go_home(3))
        went = [v for c, v in world.only_vehicle.parameters if c == mavlink.MAV_CMD_DO_REPOSITION]
        assert went[0][4] / 1e7 == pytest.approx(HOME[0] - 10.0 / 111_000.0, abs=1e-6)
        assert went[0][5] / 1e7 == pytest.approx(HOME[1], abs=1e-6)
        assert went[0][6] == HOME[2] + 8.0
        assert went[0][0] == 4.0, "the mission's speed"

    @pytest.mark.thorough
    def test_is_no_faster_than_the_mission(self) -> None:
        flown_m_s = flown(takeoff(), hotpoint(radius=20.0, angular_velocity=30.0), go_home(3))
        orbit = [v for c, v in flown_m_s.only_vehicle.parameters if c == mavlink.MAV_CMD_DO_ORBIT]
        assert orbit[0][1] == pytest.approx(4.0)
        assert "by maximum_speed" in str(command_messages(flown_m_s)[1])

    def test_at_the_nearest_point_goes_nowhere_before(self) -> None:
        world = flown(takeoff(), hotpoint(start_point=4), go_home(3))
        assert mavlink.MAV_CMD_DO_REPOSITION not in world.only_vehicle.commands

    def test_takes_one_turn_where_the_vehicle_does_not_count(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4)
        world.edge.plan(mission(takeoff(), hotpoint(start_point=4), go_home(3)))
        world.run_until(lambda: vehicle.circle is not None)
        circle = vehicle.circle
        assert circle is not None
        world.run_until(lambda: vehicle.custom_mode != PX4_ORBIT)
        assert circle.flown_rad == pytest.approx(2 * math.pi, abs=0.3)

    def test_that_is_too_fast_is_flown_slower_and_the_report_notes_it(self) -> None:
        world = flown(takeoff(), hotpoint(radius=5.0, angular_velocity=60.0), go_home(3))
        assert "angular_velocity was limited to" in str(command_messages(world)[1])

    @pytest.mark.first_case
    @pytest.mark.parametrize("orbit_type", [1, 3])
    def test_with_a_heading_that_a_vehicle_lacks_is_flown_from_point_to_point(
        self, orbit_type: int
    ) -> None:
        world = flown(takeoff(), hotpoint(orbit_type=orbit_type), go_home(3), script=PX4)
        assert "orbit_type: flown from point to point" in str(command_messages(world)[1])
        assert mavlink.MAV_CMD_DO_ORBIT not in world.only_vehicle.commands
        world = flown(takeoff(), hotpoint(orbit_type=orbit_type), go_home(3), script=OWN)
        assert command_messages(world)[1] is None

    def test_that_is_refused_fails_with_the_vehicles_answer(self) -> None:
        denied = {mavlink.MAV_CMD_DO_ORBIT: mavlink.MAV_RESULT_DENIED}
        script = dataclasses.replace(OWN, results=denied)
        world = flown(takeoff(), hotpoint(), go_home(3), script=script)
        assert world.edge.statuses(1201) == [FINISHED, Status.FAILED, Status.ABORTED]
        assert "MAV_RESULT_DENIED" in str(command_messages(world)[1])

    def test_that_somebody_else_ends_fails(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=PX4)
        world.edge.plan(mission(takeoff(), hotpoint(radius=100.0, start_point=4), go_home(3)))
        world.run_until(lambda: vehicle.custom_mode == PX4_ORBIT)
        vehicle.set_mode(PX4_RETURN)
        world.run_until_over(1201, within_s=20.0)
        assert world.edge.statuses(1201) == [FINISHED, Status.FAILED, Status.ABORTED]
        assert "AUTO.RTL" in str(command_messages(world)[1])

    def test_as_the_first_command_on_the_ground_fails_before_anything_is_sent(self) -> None:
        world = flown(hotpoint(1), go_home(2))
        assert world.edge.statuses(1201)[0] == Status.FAILED
        assert "a take-off has to come first" in str(command_messages(world)[0])
        assert mavlink.MAV_CMD_DO_ORBIT not in world.only_vehicle.commands


class TestARestartedBroker:
    @pytest.mark.thorough
    def test_follows_an_orbit_on_without_beginning_it_again(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=OWN)
        world.edge.plan(mission(takeoff(), hotpoint(radius=30.0, start_point=4), go_home(3)))
        world.run_until(lambda: status_of(world, 1) == Status.RUNNING)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [FINISHED] * 3
        assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) == 1

    def test_finds_an_orbit_over_that_ended_without_it(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=OWN)
        world.edge.plan(mission(takeoff(), hotpoint(start_point=4), go_home(3)))
        world.run_until(lambda: status_of(world, 1) == Status.RUNNING)
        vehicle.silent = True
        world.run_until(lambda: vehicle.circle is None)
        world.restart_broker()
        vehicle.silent = False
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [FINISHED] * 3
        assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) == 1

    @pytest.mark.thorough
    def test_follows_the_second_segment_on(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=dataclasses.replace(OWN, item_time_s=8.0))
        world.edge.plan(mission(takeoff(), hotpoint(start_point=4), waypoint(3), go_home(4)))
        world.run_until(lambda: status_of(world, 2) == Status.RUNNING)
        uploads = vehicle.uploads
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [FINISHED] * 4
        assert vehicle.uploads == uploads == 2

    def test_goes_on_behind_a_live_command(self) -> None:
        world = World()
        vehicle = world.add_vehicle(script=OWN)
        world.edge.plan(mission(takeoff(), hotpoint(start_point=4), waypoint(3), go_home(4)))
        world.run_until(lambda: status_of(world, 1) == FINISHED)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [FINISHED] * 4
        assert vehicle.commands.count(mavlink.MAV_CMD_DO_ORBIT) == 1


class TestFollowing:
    @pytest.mark.thorough
    def test_sends_the_target_for_a_minute_and_holds(self) -> None:
        world = World(tick_s=0.05)  # Finer than the targets
        vehicle = world.add_vehicle(script=OWN)
        world.edge.plan(mission(takeoff(), follow(), go_home(3)))
        world.run_until(lambda: vehicle.custom_mode == PX4_FOLLOW)
        began = world.clock.monotonic()
        world.run_until(lambda: vehicle.custom_mode != PX4_FOLLOW)
        assert world.clock.monotonic() - began == pytest.approx(60.0, abs=2.0)
        assert 4 * 60 <= vehicle.targets <= 5 * 60 + 10
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [FINISHED] * 3

    @pytest.mark.thorough
    def test_a_vehicle_that_follows_no_target_waits_there_and_the_report_notes_it(
        self,
    ) -> None:
        unknown = {
            mavlink.MAV_CMD_DO_FOLLOW: mavlink.MAV_RESULT_UNSUPPORTED,
            mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_DENIED,
        }
        script = dataclasses.replace(PX4, results=unknown)
        world = flown(takeoff(), follow(), go_home(3), script=script)
        assert world.edge.statuses(1201) == [FINISHED] * 3
        assert "the vehicle follows nothing" in str(command_messages(world)[1])
        assert mavlink.MAV_CMD_DO_REPOSITION in world.only_vehicle.commands


class TestTheCamera:
    @pytest.mark.thorough
    def test_tracks_a_rectangle_and_stops(self) -> None:
        world = flown(takeoff(), track(), go_home(3))
        assert world.edge.statuses(1201) == [FINISHED] * 3
        commands = world.only_vehicle.commands
        begun = commands.index(mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE)
        assert commands.index(mavlink.MAV_CMD_CAMERA_STOP_TRACKING) > begun

    @pytest.mark.thorough
    def test_without_rectangles_tracks_a_point(self) -> None:
        unknown = {mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE: mavlink.MAV_RESULT_UNSUPPORTED}
        script = dataclasses.replace(OWN, results=unknown)
        world = flown(takeoff(), track(), go_home(3), script=script)
        point = "the camera tracks a point instead of a rectangle"
        assert str(command_messages(world)[1]).startswith(point)

    def test_takes_a_panorama_where_it_can(self) -> None:
        world = flown(takeoff(), panorama(), go_home(3))
        assert world.edge.statuses(1201) == [FINISHED] * 3
        create = mavlink.MAV_CMD_PANORAMA_CREATE
        assert [v[0] for c, v in world.only_vehicle.parameters if c == create] == [180.0]

    @pytest.mark.first_case
    @pytest.mark.parametrize(("mode", "pictures"), [(0, 8), (1, 5)])
    def test_is_turned_by_the_vehicle_where_it_cannot(self, mode: int, pictures: int) -> None:
        world = flown(takeoff(), panorama(mode=mode), go_home(3), script=PX4)
        assert world.edge.statuses(1201) == [FINISHED] * 3
        vehicle = world.only_vehicle
        assert mavlink.MAV_CMD_PANORAMA_CREATE not in vehicle.commands
        taken = [item for item in vehicle.items if item.command == 2000]
        assert len(taken) == pictures
        assert len({item.param4 for item in taken}) == pictures

    def test_records_behind_a_hotpoint_and_on_the_ground(self) -> None:
        world = flown(takeoff(), hotpoint(), video(3), go_home(4), video(5, kind=6))
        assert world.edge.statuses(1201) == [FINISHED] * 5
        commands = world.only_vehicle.commands
        assert mavlink.MAV_CMD_VIDEO_START_CAPTURE in commands
        assert mavlink.MAV_CMD_VIDEO_STOP_CAPTURE in commands


class TestAMissionOfTheCameraAlone:
    """It moves nothing: the vehicle does it where it is."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("script", [OWN, PX4, ARDUPILOT], ids=["own", "PX4", "copter"])
    def test_is_done_on_the_ground(self, script: Script) -> None:
        world = flown(video(1), video(2, kind=6), script=script)
        assert world.edge.statuses(1201) == [FINISHED] * 2
        assert world.only_vehicle.uploads == 0
        assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in world.only_vehicle.commands
        world.edge.plan(mission(takeoff(), go_home(2), mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.status(1202) == FINISHED

    def test_is_done_in_the_air_where_a_mission_has_left_the_vehicle(self) -> None:
        world = flown(takeoff())
        world.edge.plan(mission(video(1), panorama(2), mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.status(1202) == FINISHED
        assert world.only_vehicle.airborne
        world.edge.plan(mission(waypoint(1), go_home(2), mission_id=1203))
        world.run_until_over(1203)
        assert world.edge.status(1203) == FINISHED

    def test_cannot_turn_a_vehicle_that_stands(self) -> None:
        world = flown(panorama(1), script=PX4)
        assert "a take-off has to come first" in str(command_messages(world)[0])


class TestAnItemThatIsUnknown:
    def test_is_sent_as_another_item(self) -> None:
        script = dataclasses.replace(PX4, unknown_items=frozenset({1000, 205}))
        image = {"command_id": 2, "command_type_id": 4, "parameters": {"pitch_angle": -90}}
        world = flown(takeoff(), image, go_home(3), script=script)
        assert world.edge.statuses(1201) == [FINISHED] * 3
        assert "the vehicle has no gimbal" in str(command_messages(world)[1])
        assert world.only_vehicle.uploads == 1

    def test_is_left_out_from_the_start_the_next_time(self) -> None:
        script = dataclasses.replace(PX4, unknown_items=frozenset({1000}))
        image = {"command_id": 2, "command_type_id": 4, "parameters": {"pitch_angle": -90}}
        world = flown(takeoff(), image, go_home(3), script=script)
        refusals = world.only_vehicle.missions.refusals
        world.edge.plan(mission(takeoff(), image, go_home(3), mission_id=1202))
        world.run_until_over(1202)
        assert world.edge.status(1202) == FINISHED
        assert world.only_vehicle.missions.refusals == refusals == 1


def test_a_hover_is_where_a_mission_may_begin_live() -> None:
    world = flown(takeoff(), waypoint())
    world.edge.plan(mission(hotpoint(1), go_home(2), mission_id=1202))
    world.run_until_over(1202)
    assert world.edge.statuses(1202) == [FINISHED] * 2


def test_a_state_vector_goes_on_while_a_command_is_flown_live() -> None:
    world = World()
    vehicle = world.add_vehicle(script=OWN)
    world.edge.plan(mission(takeoff(), hotpoint(radius=50.0, start_point=4), go_home(3)))
    world.run_until(lambda: vehicle.custom_mode == PX4_ORBIT)
    before = len(world.edge.bodies("/state_vector/"))
    world.run(10.0)
    assert len(world.edge.bodies("/state_vector/")) - before >= 9
    assert world.app.sessions[1].state is State.FLYING_LIVE
    assert vehicle.custom_mode != PX4_MISSION
