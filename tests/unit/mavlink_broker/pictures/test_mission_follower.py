"""Whose the pictures are while the broker, its link or its vehicle is away, or restarted."""

import dataclasses
import math
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from afarcloud.plan import Mission
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.pictures.attribution import Attribution
from mavlink_broker.pictures.collector import MISSION_WITHIN_S, PROGRESS_WITHIN_S
from mavlink_broker.pictures.mission_follower import EarlierFlight
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.recovery_state import RecoveryState
from tests.support.broker_world import go_home, hotpoint, land, mission, takeoff, waypoint
from tests.support.picture_flight import MISSION, SLOW, PictureFlight, image, is_at, number_of
from tests.support.vehicle_script import HOME
from tests.unit.mavlink_broker.pictures.attributed import commands_of, taker


def test_a_restarted_broker_whose_link_is_lost_gives_the_pictures_to_their_command() -> None:
    """They were taken while nobody received it: the waypoint before them took none."""
    flight = PictureFlight(count=3)
    flight.until(mavlink.MAV_CMD_NAV_WAYPOINT)
    flight.world.restart_broker()
    flight.world.run(0.5)
    flight.vehicle.silent = True
    for _ in range(3):
        flight.world.run(8.0)
        flight.camera.shoot()
    flight.world.run(5.0)
    flight.vehicle.silent = False
    flight.land()
    assert flight.names == [f"m1201_c3_000{number}.jpeg" for number in range(3)]


def test_a_picture_waits_for_the_progress_of_a_vehicle_whose_link_is_lost() -> None:
    """Its announcement is the last that is received, before its command is seen to run."""
    flight = PictureFlight(count=1)
    flight.until(mavlink.MAV_CMD_NAV_WAYPOINT)
    flight.vehicle.silent = True
    flight.world.run_until(lambda: flight.item == mavlink.MAV_CMD_IMAGE_START_CAPTURE)
    flight.vehicle.silent = False
    flight.camera.shoot()
    flight.vehicle.silent = True
    flight.world.run(3.0 * PROGRESS_WITHIN_S)
    assert flight.names == []
    flight.vehicle.silent = False
    flight.land()
    assert flight.names == ["m1201_c3_0000.jpeg"]


@pytest.mark.parametrize("is_killed", [False, True], ids=["link-away", "broker-killed"])
def test_pictures_that_are_taken_unseen_before_a_restart_in_flight_go_to_their_commands(
    tmp_path: Path, *, is_killed: bool
) -> None:
    """The link is away during all of them, and the vehicle never shows again how far it came."""
    flight = PictureFlight(journal=tmp_path)
    commands = (takeoff(), waypoint(), image(3, 2), image(4, 2), image(5), go_home(6))
    flight.world.edge.plan(mission(*commands))
    flight.world.run_until(lambda: flight.item == mavlink.MAV_CMD_NAV_WAYPOINT)
    flight.world.run(3.0)
    flight.vehicle.silent = True
    if is_killed:
        flight.world.kill_broker()
    for _ in range(5):
        flight.world.run(4.0)
        flight.camera.shoot(announced=False)
    flight.world.run(2.0)
    flight.vehicle.reboot(flight.world.clock.now)
    flight.world.run(8.0)
    flight.vehicle.silent = False
    if is_killed:
        flight.world.restart_broker()
    flight.land()
    flight.world.run(30.0)
    assert flight.world.edge.status(MISSION) == Status.FAILED
    assert sorted(flight.names, key=number_of) == [
        f"m1201_c{command}_{number:04d}.jpeg" for number, command in enumerate([3, 3, 4, 4, 5])
    ]


@pytest.mark.first_case
@pytest.mark.parametrize("within_s", [30.0, 200.0])
def test_pictures_wait_for_the_mission_that_the_edge_server_sends_again(
    within_s: float, tmp_path: Path
) -> None:
    """A restarted broker that cannot reach the edge server does not know what is flown."""
    flight = PictureFlight(count=3, journal=tmp_path)
    flight.until_pictures()
    flight.camera.shoot()
    flight.world.run_until(lambda: flight.names)
    flight.world.kill_broker()
    flight.world.edge.posts.clear()
    flight.world.restart_broker()
    flight.world.edge.take_work()  # It is lost on its way
    for _ in range(2):
        flight.world.run(1.0)
        flight.camera.shoot()
    flight.world.run(within_s)
    is_late = within_s > MISSION_WITHIN_S
    assert len(flight.names) == (3 if is_late else 0)
    flight.world.edge.hand_out_again()
    flight.land()
    kind = "found" if is_late else "m1201_c3"
    assert sorted(flight.names) == [f"{kind}_000{number}.jpeg" for number in range(3)]


def test_pictures_that_were_taken_while_the_broker_stood_still_belong_to_their_command() -> None:
    """It was suspended at the waypoint before, and reads at once what has arrived meanwhile."""
    flight = PictureFlight(count=2)
    world = flight.world
    plan = mission(takeoff(), waypoint(), image(3, 2), waypoint(4, 20.0), image(5), go_home(6))
    world.edge.plan(plan)
    world.run_until(lambda: flight.item == mavlink.MAV_CMD_NAV_WAYPOINT and flight.vehicle.current)

    def stand_still(until: int) -> None:
        while flight.item != until:
            world.clock.now += 0.1
            world.air.step()

    stand_still(mavlink.MAV_CMD_IMAGE_START_CAPTURE)
    flight.camera.shoot()
    flight.camera.shoot()
    stand_still(mavlink.MAV_CMD_NAV_WAYPOINT)
    stand_still(mavlink.MAV_CMD_IMAGE_START_CAPTURE)
    flight.camera.shoot()
    stand_still(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    flight.land()
    assert [name.split("_")[1] for name in flight.names] == ["c3", "c3", "c5"]
    assert flight.message(2) is None
    assert flight.message(4) is None


def test_a_picture_that_is_stored_late_belongs_to_the_command_that_has_taken_it() -> None:
    """The camera numbers and announces it behind the first one of the next command."""
    flight = PictureFlight()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=1.5)
    world, camera, capture = flight.world, flight.camera, mavlink.MAV_CMD_IMAGE_START_CAPTURE
    world.edge.plan(mission(takeoff(), waypoint(), image(3, 2), image(4, 2), go_home(5)))
    world.run_until(partial(is_at, flight.vehicle, capture, 0))
    camera.shoot()
    world.run_until(partial(is_at, flight.vehicle, capture, 1))
    taken_ms = camera.boot_ms() - 100
    camera.shoot()
    world.run(1.0)
    camera.shoot(taken_ms=taken_ms)
    camera.shoot()
    flight.land()
    assert sorted(flight.names, key=number_of) == [
        "m1201_c3_0000.jpeg",
        "m1201_c4_0001.jpeg",
        "m1201_c3_0002.jpeg",
        "m1201_c4_0003.jpeg",
    ]


def test_a_series_that_outlasts_its_mission_stays_with_its_command() -> None:
    """The vehicle returns by its failsafe over the place of a command that it never flew."""
    flight = PictureFlight(count=4)
    world, camera = flight.world, flight.camera
    plan = mission(takeoff(), waypoint(), image(3, 4), waypoint(4, 200.0), image(5, 2), go_home(6))
    world.edge.plan(plan)
    world.run_until(lambda: flight.item == mavlink.MAV_CMD_IMAGE_START_CAPTURE)
    world.run(1.0)
    here, there = ((round(HOME[0] * 1e7 + m * 90), round(HOME[1] * 1e7)) for m in (10, 200))
    for place_e7 in (here, here, there, there):
        camera.place_e7 = place_e7
        camera.shoot()
        world.run(1.0)
        flight.vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        world.run(1.0)
    world.run(40.0)
    assert world.edge.status(MISSION) == Status.FAILED
    assert flight.names == [f"m1201_c3_000{number}.jpeg" for number in range(4)]


@pytest.mark.first_case
@pytest.mark.parametrize("kill_before", [8, 1, 3, 5])
@pytest.mark.parametrize("edge_away_s", [0.0, 30.0])
@pytest.mark.parametrize("is_second", [True, False])
def test_commands_at_one_place_keep_their_pictures_over_a_restart(
    kill_before: int, edge_away_s: float, is_second: bool, tmp_path: Path
) -> None:
    """The restarted broker gets the pictures of before from the newest back.

    `is_second`: the same commands have been flown a minute before.
    """
    flight = PictureFlight(journal=tmp_path)
    if is_second:
        take_pictures_of(flight, 1200)
        flight.world.edge.posts.clear()
    first = len(flight.camera.taken)
    take_pictures_of(flight, MISSION, kill_before=first + kill_before, edge_away_s=edge_away_s)
    flight.world.run(30.0)
    names = {name for name in flight.names if number_of(name) >= first}
    assert sorted(names, key=number_of) == [
        f"m1201_c{command}_{first + number:04d}.jpeg"
        for number, command in enumerate([3] * 4 + [4] * 2 + [5] * 3)
    ]


def take_pictures_of(
    flight: PictureFlight, mission_id: int, *, kill_before: int = -1, edge_away_s: float = 0.0
) -> None:
    """Fly three commands that take pictures at one place; the broker is killed before one."""
    world, vehicle = flight.world, flight.vehicle
    commands = (takeoff(), waypoint(), image(3, 4), image(4, 2), image(5, 3), go_home(6))
    world.edge.plan(mission(*commands, mission_id=mission_id))
    back_at = 0.0
    for number, count in enumerate((4, 2, 3)):
        world.run_until(partial(is_at, vehicle, mavlink.MAV_CMD_IMAGE_START_CAPTURE, number))
        for _ in range(count):
            if len(flight.camera.taken) == kill_before:
                world.kill_broker()
                world.run(1.0)
                world.restart_broker()
                back_at = world.clock.now + edge_away_s
                if edge_away_s:
                    world.edge.take_work()  # It is lost on its way
            flight.camera.shoot()
            world.run(1.0)
    if edge_away_s:
        world.run(max(0.0, back_at - world.clock.now))
        world.edge.hand_out_again()
    world.run_until_over(mission_id)
    world.run(30.0)


@pytest.mark.parametrize(
    ("end", "since_s"), [(hotpoint(4), [500.0] * 4), (land(4), [-math.inf] * 4)]
)
def test_no_picture_of_a_flight_before_is_of_a_command_that_an_earlier_run_saw_end(
    end: dict[str, Any], since_s: list[float]
) -> None:
    """Its items were ordered at 560 s, in the flight for which it was armed at 500 s.

    A mission that has landed in between was begun in a flight before.
    """
    steps = mission(takeoff(1), waypoint(2), image(3), end, waypoint(5))
    commands = Mission.model_validate(steps).command_array
    ledger = MissionLedger(1201, commands)
    recovery = RecoveryState()
    recovery.armed_s = 500.0
    recovery.note_segment(ledger.name_of(4), 560.0)
    earlier = EarlierFlight()
    earlier.recall(recovery)
    assert earlier.since_s(ledger, commands) == [*since_s, 560.0]
    attribution = Attribution()
    attribution.update(taker(4), 570.0, resumed_since_s=560.0)
    attribution.add_earlier(taker(2, expected=2), since_s[2], is_undated=True)
    assert commands_of(attribution, 450.0) == [None if since_s[2] > 0.0 else 2]
    assert commands_of(attribution, 530.0) == [2]
