"""Pictures of a flight, from their announcement to the edge server, between scripted ends."""

import base64
import dataclasses
import math
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from afarcloud.state import Image
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.pictures.pictures import MISSION_WITHIN_S
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.file_server import ScriptedFiles
from tests.support.scripted_camera import JPEG, ScriptedCamera
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import HOME, PX4

SLOW = dataclasses.replace(PX4, item_time_s=6.0)
MISSION = 1201


def image(command_id: int = 3, count: int = 1) -> dict[str, Any]:
    parameters = {
        "yaw_angle": 0,
        "pitch_angle": -90,
        "photo_count": count,
        "time_interval": int(count > 1),
    }
    return {"command_id": command_id, "command_type_id": 4, "parameters": parameters}


class Flight:
    """A vehicle with a camera on a mission that takes pictures at its third command."""

    def __init__(
        self,
        *,
        count: int = 1,
        loss: float = 0.0,
        seed: int = 1,
        journal: Path | None = None,
        **camera: Any,
    ) -> None:
        self.world = World(loss=loss, seed=seed, journal=journal)
        self.vehicle: ScriptedVehicle = self.world.add_vehicle(script=SLOW)
        self.camera: ScriptedCamera = self.world.add_camera(self.vehicle, **camera)
        self.count = count

    def until_pictures(self) -> None:
        """Fly until the vehicle is at the item that takes the pictures."""
        self.until(mavlink.MAV_CMD_IMAGE_START_CAPTURE)

    def until(self, command: int) -> None:
        """Fly until the vehicle is at an item with that MAV_CMD for the first time."""
        self.world.edge.plan(
            mission(takeoff(), waypoint(), image(3, self.count), waypoint(4, 20.0), go_home(5))
        )
        self.world.run_until(lambda: self.item == command)
        self.world.run(1.0)

    @property
    def item(self) -> int:
        """The command of the item that is flown."""
        flies = self.vehicle.armed and self.vehicle.items
        return int(self.vehicle.items[self.vehicle.current].command) if flies else 0

    def land(self) -> None:
        """Fly to the end."""
        self.world.run_until_over(MISSION)
        self.world.run(15.0)

    @property
    def images(self) -> list[dict[str, Any]]:
        return self.world.edge.bodies("/image/")

    @property
    def names(self) -> list[str]:
        return [body["name"] for body in self.images]

    def message(self, command: int = 2) -> str | None:
        reports = self.world.edge.reports(MISSION)
        text: str | None = reports[-1]["command_report_array"][command].get("message")
        return text


def test_a_picture_is_sent_as_the_vehicle_stores_it() -> None:
    flight = Flight()
    flight.until_pictures()
    index = flight.camera.shoot()
    flight.land()
    (body,) = flight.images
    sent = Image.model_validate(body)
    assert base64.b64decode(sent.frame) == JPEG + bytes([index])
    assert sent.image_size == len(JPEG) + 1
    assert sent.name == "m1201_c3_0000.jpeg"
    assert flight.world.edge.status(MISSION) == Status.FINISHED
    assert flight.message() is None


@pytest.mark.thorough
def test_a_burst_of_pictures_keeps_its_order() -> None:
    flight = Flight(count=3)
    flight.until_pictures()
    for _ in range(3):
        flight.camera.shoot()
        flight.world.run(1.0)
    flight.land()
    assert flight.names == [f"m1201_c3_000{number}.jpeg" for number in range(3)]


@pytest.mark.thorough
def test_a_picture_between_waypoints_belongs_to_the_waypoint() -> None:
    flight = Flight()
    flight.world.edge.plan(mission(takeoff(), waypoint(), go_home()))
    flight.world.run_until(lambda: flight.item == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    flight.world.run(2.0)
    flight.camera.shoot()
    flight.land()
    assert flight.names == ["m1201_c3_0000.jpeg"]


@pytest.mark.first_case
@pytest.mark.parametrize("lost", [(0,), (1,), (2,), (0, 1, 2)])
def test_lost_announcements_are_requested(lost: tuple[int, ...]) -> None:
    flight = Flight(count=3, first_index=40)
    flight.until_pictures()
    for number in range(3):
        flight.camera.shoot(announced=number not in lost)
        flight.world.run(0.5)
    flight.land()
    assert sorted(flight.names) == [f"m1201_c3_00{number}.jpeg" for number in (40, 41, 42)]
    assert flight.message() is None


@pytest.mark.thorough
def test_earlier_pictures_do_not_belong_to_the_mission() -> None:
    flight = Flight(first_index=7)
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.names == ["m1201_c3_0007.jpeg"]


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(3))
def test_a_bad_link_loses_no_picture(seed: int) -> None:
    flight = Flight(count=3, loss=0.2, seed=seed)
    flight.until_pictures()
    for _ in range(3):
        flight.camera.shoot()
        flight.world.run(1.0)
    flight.land()
    flight.world.run_until(lambda: len(flight.images) >= 3, within_s=300.0)
    assert sorted(flight.names) == [f"m1201_c3_000{number}.jpeg" for number in range(3)]


@pytest.mark.thorough
def test_a_failed_picture_is_reported() -> None:
    flight = Flight()
    flight.until_pictures()
    flight.camera.shoot(succeeded=False)
    flight.land()
    assert flight.images == []
    assert flight.message() == "the camera could not take picture 0"


@pytest.mark.thorough
def test_a_picture_that_cannot_be_fetched_is_reported() -> None:
    flight = Flight(url="mftp:///elsewhere/{index}.jpg")
    flight.until_pictures()
    flight.camera.shoot()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=60.0)
    flight.world.run_until(lambda: flight.message() is not None)
    reason = "the vehicle answers: file not found"
    assert flight.message() == f"picture 0 cannot be had in flight: {reason}"


@pytest.mark.thorough
def test_a_picture_refused_in_flight_is_requested_after_the_landing() -> None:
    flight = Flight(files=ScriptedFiles(unknown=frozenset({4})))
    flight.until_pictures()
    flight.camera.shoot()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=60.0)
    flight.world.run_until(lambda: flight.message() is not None)
    flight.world.run_until(lambda: not flight.vehicle.armed, within_s=300.0)
    flight.camera.files.unknown = frozenset()
    flight.world.run_until(lambda: flight.images)
    assert flight.names == ["m1201_c3_0000.jpeg"]


def test_a_picture_has_the_time_at_which_it_was_taken_however_late_its_file_comes() -> None:
    flight = Flight(files=ScriptedFiles(unknown=frozenset({4})))
    flight.until_pictures()
    taken_at = flight.world.clock.utc()
    flight.camera.shoot()
    flight.land()
    flight.camera.files.unknown = frozenset()
    flight.world.run_until(lambda: flight.images, within_s=300.0)
    assert flight.world.clock.utc() - taken_at > timedelta(seconds=20)
    assert _late_s(flight.images[0], taken_at) < 1.0


def test_a_picture_that_was_announced_late_has_the_time_at_which_it_was_taken() -> None:
    flight = Flight()
    flight.until_pictures()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=90.0)
    taken_at = flight.world.clock.utc()
    flight.camera.shoot(announced=False)
    flight.world.run(40.0)
    flight.camera.shoot()
    flight.world.run_until(lambda: len(flight.images) == 2)
    late_s = {body["name"]: _late_s(body, taken_at) for body in flight.images}
    expected = {"m1201_c3_0000.jpeg": 0.0, "m1201_c3_0001.jpeg": 40.0}
    assert late_s == pytest.approx(expected, abs=1.0)


def _late_s(image: dict[str, Any], at: datetime) -> float:
    """How long after a time an image says that it was recorded."""
    return (datetime.fromisoformat(image["recorded_at"]) - at).total_seconds()


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("url", "reason"),
    [("", "its location is unknown"), ("gopher://x/1.jpg", "'gopher://x/1.jpg' is not a location")],
)
def test_an_invalid_location_is_reported(url: str, reason: str) -> None:
    flight = Flight(url=url)
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.message() == f"picture 0 cannot be fetched: {reason}"


@pytest.mark.thorough
def test_missing_pictures_are_reported() -> None:
    flight = Flight(count=2)
    flight.until_pictures()
    flight.camera.shoot()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=60.0)
    flight.land()
    assert flight.message() == "1 of 2 pictures were not announced"


@pytest.mark.thorough
def test_a_mission_does_not_wait_for_its_pictures() -> None:
    flight = Flight(files=ScriptedFiles(silent=frozenset({4})))
    flight.until_pictures()
    flight.camera.shoot()
    flight.world.run_until_over(MISSION)
    assert flight.world.edge.status(MISSION) == Status.FINISHED
    assert flight.images == []
    flight.camera.files.silent = frozenset()
    flight.world.run_until(lambda: flight.images, within_s=200.0)
    assert flight.names == ["m1201_c3_0000.jpeg"]


@pytest.mark.thorough
def test_files_that_the_camera_does_not_serve_are_requested_from_the_autopilot() -> None:
    flight = Flight(url="/fs/microsd/{index}.jpg")
    autopilot = ScriptedCamera(1, flight.camera.put, lambda: 0, component=1)
    autopilot.files.files = {"/fs/microsd/0.jpg": JPEG}
    receive = flight.camera.receive

    def both(frame: bytes) -> None:
        receive(frame)
        autopilot.receive(frame)

    flight.camera.receive = both  # type: ignore[method-assign]  # the autopilot receives it too
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    (body,) = flight.images
    assert base64.b64decode(body["frame"]) == JPEG


@pytest.mark.thorough
def test_a_restarted_broker_sends_the_same_picture_under_the_same_key() -> None:
    flight = Flight()
    flight.until_pictures()
    flight.camera.shoot()
    flight.world.run_until(lambda: flight.images)
    flight.world.restart_broker()
    flight.land()
    keys = {p.idempotency_key for p in flight.world.edge.posts if p.path == "/image/"}
    assert len(flight.images) == 2
    assert len(keys) == 1


@pytest.mark.thorough
def test_a_restarted_broker_fetches_what_was_taken_while_it_was_away() -> None:
    flight = Flight(count=3)
    flight.until_pictures()
    flight.world.kill_broker()
    for _ in range(3):
        flight.camera.shoot()
        flight.world.run(0.5)
    flight.world.restart_broker()
    flight.land()
    sizes = [body["image_size"] for body in flight.images]
    assert len(sizes) == 3
    assert flight.message() is None


def test_a_restarted_broker_fetches_what_was_taken_before_it_received_the_vehicle() -> None:
    """The link is away when it starts: some pictures are older than this run, some are not."""
    flight = Flight(count=5)
    flight.until_pictures()
    flight.world.kill_broker()
    flight.vehicle.silent = True
    for is_restart in (False, True):
        if is_restart:
            flight.world.restart_broker()
        for _ in range(2):
            flight.camera.shoot()
            flight.world.run(2.0)
    flight.vehicle.silent = False
    flight.camera.shoot()
    flight.land()
    assert len(flight.images) == 5


def test_a_restarted_broker_whose_link_is_lost_gives_the_pictures_to_their_command() -> None:
    """They were taken while nobody received it: the waypoint before them took none."""
    flight = Flight(count=3)
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


@pytest.mark.parametrize("is_killed", [False, True], ids=["link-away", "broker-killed"])
def test_pictures_that_are_taken_unseen_before_a_restart_in_flight_go_to_their_commands(
    tmp_path: Path, *, is_killed: bool
) -> None:
    """The link is away during all of them, and the vehicle never shows again how far it came."""
    flight = Flight(journal=tmp_path)
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
    assert sorted(flight.names, key=_number_of) == [
        f"m1201_c{command}_{number:04d}.jpeg" for number, command in enumerate([3, 3, 4, 4, 5])
    ]


@pytest.mark.parametrize("within_s", [30.0, 200.0])
def test_pictures_wait_for_the_mission_that_the_edge_server_sends_again(
    within_s: float, tmp_path: Path
) -> None:
    """A restarted broker that cannot reach the edge server does not know what is flown."""
    flight = Flight(count=3, journal=tmp_path)
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


def test_a_new_broker_does_not_fetch_old_pictures() -> None:
    flight = Flight()
    flight.world.is_broker_running = False
    flight.world.run(1.0)
    for _ in range(5):
        flight.camera.shoot(announced=False)
    flight.world.clock.now += 1200.0
    flight.world.restart_broker()
    flight.world.run(10.0)
    assert flight.images == []
    assert [number for wanted, number in flight.camera.asked if wanted == 263] == [4]


@pytest.mark.thorough
def test_the_clock_of_a_camera_may_differ_from_the_vehicles() -> None:
    flight = Flight()
    boot_ms = flight.camera.boot_ms
    flight.camera.boot_ms = lambda: boot_ms() + 5_000_000
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.names == ["m1201_c3_0000.jpeg"]


@pytest.mark.thorough
def test_a_late_announcement_is_no_difference_of_clocks() -> None:
    flight = Flight(count=2)
    flight.until_pictures()
    for _ in range(2):
        flight.camera.shoot(announced=False)
    flight.world.run_until(lambda: flight.item == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    flight.camera.taken, late = [], flight.camera.taken
    flight.world.run(15.0)
    flight.camera.taken = late
    for message in late:
        flight.world.send_from(flight.vehicle, message, mavlink.MAV_COMP_ID_CAMERA)
    flight.land()
    assert sorted(flight.names) == ["m1201_c3_0000.jpeg", "m1201_c3_0001.jpeg"]


@pytest.mark.thorough
def test_no_picture_is_fetched_while_the_edge_server_takes_none() -> None:
    flight = Flight()
    flight.world.edge.waiting_pictures = 8
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.camera.files.asked == []
    flight.world.edge.waiting_pictures = 0
    flight.world.run_until(lambda: flight.images)


@pytest.mark.thorough
def test_a_restarted_vehicle_still_has_its_pictures() -> None:
    flight = Flight(files=ScriptedFiles(silent=frozenset({4})))
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    flight.vehicle.reboot(flight.world.clock.now)
    flight.camera.files.restart()
    flight.camera.files.silent = frozenset()
    flight.world.run_until(lambda: flight.images, within_s=200.0)
    assert flight.names == ["m1201_c3_0000.jpeg"]


def test_a_picture_of_no_command_is_not_sent() -> None:
    flight = Flight()
    flight.world.run(10.0)
    flight.camera.shoot()
    flight.world.run(20.0)
    assert flight.images == []


@pytest.mark.first_case
@pytest.mark.parametrize("index", [-1, 2**31 - 2])
def test_unusual_picture_numbers_are_accepted(index: int) -> None:
    flight = Flight()
    flight.camera.first_index = index
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.world.edge.status(MISSION) == Status.FINISHED
    assert math.isfinite(flight.world.clock.now)


@pytest.mark.thorough
def test_old_announcements_do_not_count_as_a_restart() -> None:
    flight = Flight(count=4, component=1)
    flight.camera.heartbeat = lambda: None  # type: ignore[method-assign]  # the autopilot has its own
    flight.world.run(40.0)
    flight.until_pictures()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=120.0)
    flight.world.kill_broker()
    for _ in range(4):
        flight.camera.shoot()
        flight.world.run(0.3)
    flight.world.restart_broker()
    flight.world.run(40.0)
    flight.camera.shoot()
    flight.world.run(20.0)
    assert len(flight.images) == 5
    assert flight.world.edge.status(MISSION) == Status.RUNNING


def test_pictures_that_were_taken_while_the_broker_stood_still_belong_to_their_command() -> None:
    """It was suspended at the waypoint before, and reads at once what has arrived meanwhile."""
    flight = Flight(count=2)
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
    flight = Flight()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=1.5)
    world, camera, capture = flight.world, flight.camera, mavlink.MAV_CMD_IMAGE_START_CAPTURE
    world.edge.plan(mission(takeoff(), waypoint(), image(3, 2), image(4, 2), go_home(5)))
    world.run_until(partial(_is_at, flight.vehicle, capture, 0))
    camera.shoot()
    world.run_until(partial(_is_at, flight.vehicle, capture, 1))
    taken_ms = camera.boot_ms() - 100
    camera.shoot()
    world.run(1.0)
    camera.shoot(taken_ms=taken_ms)
    camera.shoot()
    flight.land()
    assert sorted(flight.names, key=_number_of) == [
        "m1201_c3_0000.jpeg",
        "m1201_c4_0001.jpeg",
        "m1201_c3_0002.jpeg",
        "m1201_c4_0003.jpeg",
    ]


def test_a_series_that_outlasts_its_mission_stays_with_its_command() -> None:
    """The vehicle returns by its failsafe over the place of a command that it never flew."""
    flight = Flight(count=4)
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
    flight = Flight(journal=tmp_path)
    if is_second:
        take_pictures_of(flight, 1200)
        flight.world.edge.posts.clear()
    first = len(flight.camera.taken)
    take_pictures_of(flight, MISSION, kill_before=first + kill_before, edge_away_s=edge_away_s)
    flight.world.run(30.0)
    names = {name for name in flight.names if _number_of(name) >= first}
    assert sorted(names, key=_number_of) == [
        f"m1201_c{command}_{first + number:04d}.jpeg"
        for number, command in enumerate([3] * 4 + [4] * 2 + [5] * 3)
    ]


def take_pictures_of(
    flight: Flight, mission_id: int, *, kill_before: int = -1, edge_away_s: float = 0.0
) -> None:
    """Fly three commands that take pictures at one place; the broker is killed before one."""
    world, vehicle = flight.world, flight.vehicle
    commands = (takeoff(), waypoint(), image(3, 4), image(4, 2), image(5, 3), go_home(6))
    world.edge.plan(mission(*commands, mission_id=mission_id))
    back_at = 0.0
    for number, count in enumerate((4, 2, 3)):
        world.run_until(partial(_is_at, vehicle, mavlink.MAV_CMD_IMAGE_START_CAPTURE, number))
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


def _is_at(vehicle: ScriptedVehicle, command: int, number: int) -> bool:
    """Whether the vehicle is at an item with that MAV_CMD, the first one having the number 0."""
    places = [seq for seq, item in enumerate(vehicle.items) if item.command == command]
    return vehicle.armed and len(places) > number and vehicle.current >= places[number]


def _number_of(name: str) -> int:
    return int(name.removesuffix(".jpeg").rpartition("_")[2])
