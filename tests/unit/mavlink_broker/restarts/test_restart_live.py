"""A broker that is killed goes on with a live command where it was; simulated time."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
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
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.vehicle_script import PX4, PX4_FOLLOW, PX4_HOLD, Script

AWAY_S = 5.0
ORBIT, REPOSITION = mavlink.MAV_CMD_DO_ORBIT, mavlink.MAV_CMD_DO_REPOSITION
PICTURE, CREATE = mavlink.MAV_CMD_IMAGE_START_CAPTURE, mavlink.MAV_CMD_PANORAMA_CREATE
BACKWARDS: dict[str, Any] = {"orbit_type": 1, "radius": 20.0, "angular_velocity": 12.0}


def begun(folder: Path, *commands: dict[str, Any], script: Script) -> World:
    """A world with a new mission of a take-off, these commands, and a return."""
    world = World(journal=folder, disk_lag_s=DISK_LAG_S)
    world.add_vehicle(script=script)
    world.edge.plan(mission(takeoff(), *commands, go_home(9)))
    return world


def is_running(world: World, command: int = 1) -> bool:
    """Whether a command has been reported to run."""
    return bool(world.edge.reports(1201)) and world.edge.statuses(1201)[command] == Status.RUNNING


def die(world: World, away_s: float = AWAY_S) -> None:
    """Let the broker die, and come back after a while."""
    world.kill_broker()
    world.run(away_s)
    world.restart_broker()


def time_until_over(world: World, command: int = 1) -> float:
    """Wait until a command has ended; gives how long that took."""
    began_s = world.clock.now
    world.run_until(lambda: world.edge.statuses(1201)[command] == Status.FINISHED)
    return world.clock.now - began_s


class TestTime:
    @pytest.mark.first_case
    @pytest.mark.parametrize("kind", [follow, track], ids=["follow", "track"])
    def test_it_goes_on_by_the_vehicles_clock(self, tmp_path: Path, kind: Any) -> None:
        world = begun(tmp_path, kind(), script=OWN)
        world.run_until(lambda: is_running(world))
        world.run(30.0)
        die(world)
        assert time_until_over(world) == pytest.approx(60.0 - 30.0 - AWAY_S, abs=4.0)

    def test_what_ended_while_no_broker_ran_is_over_at_once(self, tmp_path: Path) -> None:
        world = begun(tmp_path, follow(), script=PX4)
        world.run_until(lambda: is_running(world))
        die(world, away_s=80.0)
        assert time_until_over(world) < 8.0


class TestCircles:
    @pytest.mark.first_case
    @pytest.mark.parametrize("share", [0.1, 0.8])
    def test_an_endless_one_ends_where_it_began(self, tmp_path: Path, share: float) -> None:
        """PX4 goes round and round: what it flew while no broker ran counts."""
        slow = hotpoint(angular_velocity=9.0, radius=15.0)
        world = begun(tmp_path, slow, script=PX4)
        vehicle = world.only_vehicle
        world.run_until(lambda: vehicle.circle is not None)
        turn_s = 360.0 / 9.0
        world.run(share * turn_s)
        die(world)
        time_until_over(world)
        assert vehicle.commands.count(ORBIT) == 1
        assert vehicle.circle is not None
        assert vehicle.circle.flown_rad / (2.0 * math.pi) == pytest.approx(1.0, abs=0.06)

    @pytest.mark.parametrize("flown_s", [-10.0, -3.0, 2.0, 8.0])
    def test_the_way_to_an_endless_one_does_not_count(self, tmp_path: Path, flown_s: float) -> None:
        """The broker dies so long behind the beginning of the turn; the way there was as long."""
        way_s = turn_s = 360.0 / 12.0
        script = dataclasses.replace(PX4, circle_after_s=way_s)
        world = begun(tmp_path, hotpoint(angular_velocity=12.0, radius=15.0), script=script)
        vehicle = world.only_vehicle
        world.run_until(lambda: vehicle.circle is not None)
        world.run(way_s + flown_s)
        die(world)
        time_until_over(world)
        circle = vehicle.circle
        assert circle is not None
        most_rad = 2.0 * math.pi * (1.0 + AWAY_S / turn_s)
        assert 0.94 * 2.0 * math.pi < circle.flown_rad < most_rad

    def test_one_that_ended_while_no_broker_ran_is_not_flown_twice(self, tmp_path: Path) -> None:
        world = begun(tmp_path, hotpoint(angular_velocity=12.0, radius=15.0), script=PX4)
        world.run_until(lambda: is_running(world))
        die(world, away_s=35.0)
        assert time_until_over(world) < 8.0

    @pytest.mark.thorough
    def test_one_from_point_to_point_goes_on_at_its_point(self, tmp_path: Path) -> None:
        undisturbed = begun(tmp_path / "one", hotpoint(**BACKWARDS), script=PX4)
        undisturbed.run_until_over(1201)
        world = begun(tmp_path / "other", hotpoint(**BACKWARDS), script=PX4)
        world.run_until(lambda: is_running(world))
        world.run(20.0)
        die(world)
        world.run_until_over(1201)
        points = world.only_vehicle.commands.count(REPOSITION)
        assert points <= undisturbed.only_vehicle.commands.count(REPOSITION) + 2


class TestPictures:
    @pytest.mark.thorough
    def test_each_of_a_turned_panorama_is_ordered_once(self, tmp_path: Path) -> None:
        """But for the one that was being taken, which has the same number again."""
        world = begun(tmp_path, follow(), panorama(3), script=PX4)
        world.run_until(lambda: is_running(world, 2))
        world.run(6.0)
        die(world)
        world.run_until_over(1201)
        sent = world.only_vehicle.parameters
        numbers = [values[3] for command, values in sent if command == PICTURE]
        assert len(set(numbers)) == 5
        assert len(numbers) <= 6

    def test_a_camera_that_shows_its_order_gets_no_second_one(self, tmp_path: Path) -> None:
        """The broker dies before the answer comes, and the camera is at it."""
        world = begun(tmp_path, panorama(), script=OWN)
        vehicle = world.only_vehicle
        camera = world.add_camera(vehicle)
        vehicle.lost_answers = {CREATE}
        world.run_until(lambda: CREATE in vehicle.commands)
        world.kill_broker()
        for _ in range(3):
            world.run(0.7)
            camera.shoot()
        world.restart_broker()
        world.run(3.0)
        camera.shoot()
        world.run_until_over(1201)
        assert world.edge.statuses(1201)[1] == Status.FINISHED
        assert vehicle.commands.count(CREATE) == 1

    def test_a_camera_without_the_order_gets_it_once(self, tmp_path: Path) -> None:
        world = begun(tmp_path, panorama(), script=OWN)
        vehicle = world.only_vehicle
        camera = world.add_camera(vehicle)
        camera.shoot()
        world.run_until(lambda: has_noted(tmp_path))
        world.kill_broker()
        assert CREATE not in vehicle.commands
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201)[1] == Status.FINISHED
        assert vehicle.commands.count(CREATE) == 1

    @pytest.mark.parametrize(
        "result", [mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS]
    )
    def test_an_answer_to_a_ground_station_shows_no_order_of_the_broker(
        self, tmp_path: Path, result: int
    ) -> None:
        """The station has ordered the same, and the vehicle answers it before all."""
        world = begun(tmp_path, panorama(), script=OWN)
        vehicle = world.only_vehicle
        world.add_camera(vehicle)
        world.run_until(lambda: has_noted(tmp_path))
        world.kill_broker()
        assert CREATE not in vehicle.commands
        world.restart_broker()
        theirs = mavlink.MAVLink_command_ack_message(CREATE, result, target_system=255)
        for _ in range(100):
            world.send_from(vehicle, theirs)
            world.run(0.2)
        assert vehicle.commands.count(CREATE) == 1


def has_noted(folder: Path) -> bool:
    """Whether the journal holds a live command that is about to be ordered."""
    return any("live" in page.read_text() for page in folder.glob("*.json"))


@pytest.mark.thorough
def test_the_same_plan_once_more_is_flown_from_its_beginning(tmp_path: Path) -> None:
    """Without an edge server a mission has the same number and name whenever it is flown."""
    world = begun(tmp_path, follow(), script=OWN)
    world.run_until(lambda: is_running(world))
    world.run(30.0)
    world.only_vehicle.armed = world.only_vehicle.airborne = False
    world.only_vehicle.set_mode(PX4_HOLD)
    again = World(journal=tmp_path, disk_lag_s=DISK_LAG_S)
    again.clock.now = world.clock.now
    again.air.vehicles = world.air.vehicles
    again.edge.plan(mission(takeoff(), follow(), go_home(9)))
    again.run_until(lambda: is_running(again))
    again.run(35.0)
    assert is_running(again)


class TestAStalledEdgeServer:
    """Reports wait in memory and are lost with the broker. The journal holds the segment."""

    @pytest.mark.first_case
    @pytest.mark.parametrize("after_s", [0.0, 0.15, 3.0])
    def test_a_circle_that_has_ended_is_not_resumed(self, tmp_path: Path, after_s: float) -> None:
        slow = dataclasses.replace(OWN, item_time_s=6.0)
        world = begun(tmp_path, hotpoint(radius=10.0, start_point=4), waypoint(3), script=slow)
        vehicle = world.only_vehicle
        world.run_until(lambda: is_running(world))
        world.edge.is_stalled = True
        world.run_until(lambda: vehicle.uploads == 2 and vehicle.in_mission)
        world.run(after_s)
        world.kill_broker()
        world.edge.is_stalled = False
        world.run(2.0)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 4
        assert vehicle.uploads == 2
        assert vehicle.commands.count(ORBIT) == 1

    def test_a_mission_that_was_over_meanwhile_is_not_flown_twice(self, tmp_path: Path) -> None:
        world = begun(tmp_path, waypoint(2), script=OWN)
        vehicle = world.only_vehicle
        world.run_until(lambda: world.app.sessions.get(1) and bool(world.edge.acknowledgements(1)))
        world.edge.is_stalled = True
        world.run_until(lambda: vehicle.airborne)
        world.kill_broker()
        world.edge.is_stalled = False
        world.run_until(lambda: not vehicle.armed)
        world.run(5.0)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FINISHED
        assert vehicle.uploads == 1

    @pytest.mark.thorough
    def test_two_live_commands_one_behind_the_other(self, tmp_path: Path) -> None:
        world = begun(tmp_path, hotpoint(2, radius=10.0, start_point=4), follow(3), script=OWN)
        vehicle = world.only_vehicle
        world.run_until(lambda: is_running(world))
        world.edge.is_stalled = True
        world.run_until(lambda: vehicle.custom_mode == PX4_FOLLOW)
        world.run(0.15)
        world.kill_broker()
        world.edge.is_stalled = False
        world.run(2.0)
        world.restart_broker()
        world.run_until_over(1201)
        assert world.edge.statuses(1201) == [Status.FINISHED] * 4
        assert vehicle.commands.count(ORBIT) == 1
        assert vehicle.commands.count(mavlink.MAV_CMD_DO_FOLLOW) == 1
