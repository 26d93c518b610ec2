"""Pictures of a flight, from their announcement to the edge server, between scripted ends."""

import base64
import dataclasses
import math
from datetime import datetime, timedelta
from typing import Any

import pytest

from afarcloud.enumerations import Status
from afarcloud.state import Image
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import go_home, mission, takeoff, waypoint
from tests.support.file_server import ScriptedFiles
from tests.support.picture_flight import MISSION, SLOW, PictureFlight
from tests.support.scripted_camera import JPEG, ScriptedCamera


def test_a_picture_is_sent_as_the_vehicle_stores_it() -> None:
    flight = PictureFlight()
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
    flight = PictureFlight(count=3)
    flight.until_pictures()
    for _ in range(3):
        flight.camera.shoot()
        flight.world.run(1.0)
    flight.land()
    assert flight.names == [f"m1201_c3_000{number}.jpeg" for number in range(3)]


@pytest.mark.thorough
def test_a_picture_between_waypoints_belongs_to_the_waypoint() -> None:
    flight = PictureFlight()
    flight.world.edge.plan(mission(takeoff(), waypoint(), go_home()))
    flight.world.run_until(lambda: flight.item == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    flight.world.run(2.0)
    flight.camera.shoot()
    flight.land()
    assert flight.names == ["m1201_c3_0000.jpeg"]


@pytest.mark.first_case
@pytest.mark.parametrize("lost", [(0,), (1,), (2,), (0, 1, 2)])
def test_lost_announcements_are_requested(lost: tuple[int, ...]) -> None:
    flight = PictureFlight(count=3, first_index=40)
    flight.until_pictures()
    for number in range(3):
        flight.camera.shoot(announced=number not in lost)
        flight.world.run(0.5)
    flight.land()
    assert sorted(flight.names) == [f"m1201_c3_00{number}.jpeg" for number in (40, 41, 42)]
    assert flight.message() is None


@pytest.mark.thorough
def test_earlier_pictures_do_not_belong_to_the_mission() -> None:
    flight = PictureFlight(first_index=7)
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.names == ["m1201_c3_0007.jpeg"]


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(3))
def test_a_bad_link_loses_no_picture(seed: int) -> None:
    flight = PictureFlight(count=3, loss=0.2, seed=seed)
    flight.until_pictures()
    for _ in range(3):
        flight.camera.shoot()
        flight.world.run(1.0)
    flight.land()
    flight.world.run_until(lambda: len(flight.images) >= 3, within_s=300.0)
    assert sorted(flight.names) == [f"m1201_c3_000{number}.jpeg" for number in range(3)]


@pytest.mark.thorough
def test_a_failed_picture_is_reported() -> None:
    flight = PictureFlight()
    flight.until_pictures()
    flight.camera.shoot(succeeded=False)
    flight.land()
    assert flight.images == []
    assert flight.message() == "the camera could not take picture 0"


@pytest.mark.thorough
def test_a_picture_that_cannot_be_fetched_is_reported() -> None:
    flight = PictureFlight(url="mftp:///elsewhere/{index}.jpg")
    flight.until_pictures()
    flight.camera.shoot()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=60.0)
    flight.world.run_until(lambda: flight.message() is not None)
    reason = "the vehicle answers: file not found"
    assert flight.message() == f"picture 0 cannot be had in flight: {reason}"


@pytest.mark.thorough
def test_a_picture_refused_in_flight_is_requested_after_the_landing() -> None:
    flight = PictureFlight(files=ScriptedFiles(unknown=frozenset({4})))
    flight.until_pictures()
    flight.camera.shoot()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=60.0)
    flight.world.run_until(lambda: flight.message() is not None)
    flight.world.run_until(lambda: not flight.vehicle.armed, within_s=300.0)
    flight.camera.files.unknown = frozenset()
    flight.world.run_until(lambda: flight.images)
    assert flight.names == ["m1201_c3_0000.jpeg"]


def test_a_picture_has_the_time_at_which_it_was_taken_however_late_its_file_comes() -> None:
    flight = PictureFlight(files=ScriptedFiles(unknown=frozenset({4})))
    flight.until_pictures()
    taken_at = flight.world.clock.utc()
    flight.camera.shoot()
    flight.land()
    flight.camera.files.unknown = frozenset()
    flight.world.run_until(lambda: flight.images, within_s=300.0)
    assert flight.world.clock.utc() - taken_at > timedelta(seconds=20)
    assert _late_s(flight.images[0], taken_at) < 1.0


def test_a_picture_that_was_announced_late_has_the_time_at_which_it_was_taken() -> None:
    flight = PictureFlight()
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
    flight = PictureFlight(url=url)
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.message() == f"picture 0 cannot be fetched: {reason}"


@pytest.mark.thorough
def test_missing_pictures_are_reported() -> None:
    flight = PictureFlight(count=2)
    flight.until_pictures()
    flight.camera.shoot()
    flight.vehicle.script = dataclasses.replace(SLOW, item_time_s=60.0)
    flight.land()
    assert flight.message() == "1 of 2 pictures were not announced"


@pytest.mark.thorough
def test_a_mission_does_not_wait_for_its_pictures() -> None:
    flight = PictureFlight(files=ScriptedFiles(silent=frozenset({4})))
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
    flight = PictureFlight(url="/fs/microsd/{index}.jpg")
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
    flight = PictureFlight()
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
    flight = PictureFlight(count=3)
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
    flight = PictureFlight(count=5)
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


def test_a_new_broker_does_not_fetch_old_pictures() -> None:
    flight = PictureFlight()
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
    flight = PictureFlight()
    boot_ms = flight.camera.boot_ms
    flight.camera.boot_ms = lambda: boot_ms() + 5_000_000
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.names == ["m1201_c3_0000.jpeg"]


@pytest.mark.thorough
def test_a_late_announcement_is_no_difference_of_clocks() -> None:
    flight = PictureFlight(count=2)
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
    flight = PictureFlight()
    flight.world.edge.waiting_pictures = 8
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.camera.files.asked == []
    flight.world.edge.waiting_pictures = 0
    flight.world.run_until(lambda: flight.images)


@pytest.mark.thorough
def test_a_restarted_vehicle_still_has_its_pictures() -> None:
    flight = PictureFlight(files=ScriptedFiles(silent=frozenset({4})))
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    flight.vehicle.reboot(flight.world.clock.now)
    flight.camera.files.restart()
    flight.camera.files.silent = frozenset()
    flight.world.run_until(lambda: flight.images, within_s=200.0)
    assert flight.names == ["m1201_c3_0000.jpeg"]


def test_a_picture_of_no_command_is_not_sent() -> None:
    flight = PictureFlight()
    flight.world.run(10.0)
    flight.camera.shoot()
    flight.world.run(20.0)
    assert flight.images == []


@pytest.mark.first_case
@pytest.mark.parametrize("index", [-1, 2**31 - 2])
def test_unusual_picture_numbers_are_accepted(index: int) -> None:
    flight = PictureFlight()
    flight.camera.first_index = index
    flight.until_pictures()
    flight.camera.shoot()
    flight.land()
    assert flight.world.edge.status(MISSION) == Status.FINISHED
    assert math.isfinite(flight.world.clock.now)


@pytest.mark.thorough
def test_old_announcements_do_not_count_as_a_restart() -> None:
    flight = PictureFlight(count=4, component=1)
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
