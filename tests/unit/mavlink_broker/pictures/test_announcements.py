"""What cameras announce: locations and identities; what only the autopilot reports is counted."""

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.pictures.announcements import (
    Feedback,
    FeedbackCounter,
    FileLocation,
    Location,
    WebLocation,
    location_of,
    read_capture,
)
from tests.support.ardupilot_camera import TriggeredCamera
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.picture_flight import image
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT


@pytest.mark.parametrize(
    ("url", "place"),
    [
        ("mftp:///image/1.jpg", FileLocation("/image/1.jpg")),
        ("mftp://image/1.jpg", FileLocation("image/1.jpg")),
        ("mftp://[;comp=100]/image/1.jpg", FileLocation("/image/1.jpg", 100)),
        ("mftp://;comp=12/1.jpg", FileLocation("/1.jpg", 12)),
        ("mftp:///[;comp=7]/1.jpg", FileLocation("/1.jpg", 7)),
        ("/fs/microsd/image/1.jpg", FileLocation("/fs/microsd/image/1.jpg")),
        ("DCIM/100MEDIA/DJI_0001.JPG", FileLocation("DCIM/100MEDIA/DJI_0001.JPG")),
        ("http://192.168.1.9/1.jpg", WebLocation("http://192.168.1.9/1.jpg")),
        ("https://camera.local:8443/1.jpg", WebLocation("https://camera.local:8443/1.jpg")),
    ],
)
def test_every_form_of_url_is_a_location(url: str, place: Location) -> None:
    assert location_of(url) == place


@pytest.mark.parametrize(
    "url",
    [
        "",
        "mftp://",
        "mftp://[;comp=300]/1.jpg",
        "gopher://x/1",
        "http://",
        "http://[",
        "https:///1",
    ],
)
def test_an_invalid_url_is_no_location(url: str) -> None:
    assert location_of(url) is None


@given(st.text(max_size=205))
def test_any_url_is_a_location_or_none(url: str) -> None:
    place = location_of(url)
    if isinstance(place, FileLocation):
        assert place.path
        assert place.component is None or 1 <= place.component <= 255


def announcement(index: int, boot_ms: int, component: int = 100) -> Message:
    message = mavlink.MAVLink_camera_image_captured_message(
        boot_ms, 0, 0, 0, 0, 0, 5000, [1.0, 0.0, 0.0, 0.0], index, 1, b"/1.jpg"
    )
    (decoded,) = Decoder().decode(Encoder(1, component).encode(message))
    return decoded


def test_only_equal_announcements_have_the_same_identity() -> None:
    identities = [
        read_capture(message).identity
        for message in (
            announcement(3, 9000),
            announcement(3, 9000),
            announcement(4, 9000),
            announcement(3, 9001),
            announcement(3, 9000, component=101),
        )
    ]
    assert identities[0] == identities[1]
    assert len(set(identities)) == 4


def test_a_camera_without_a_clock_sends_no_time() -> None:
    assert read_capture(announcement(0, 0)).taken_s is None
    assert read_capture(announcement(0, 1500)).taken_s == 1.5


SLOW = dataclasses.replace(ARDUPILOT, item_time_s=6.0)
MISSION = 1201
PLACE = "40.4434000 -3.7382000 5.0 m"
PIN = pytest.mark.parametrize("has_pin", [False, True], ids=["trigger", "pin"])


class Flight:
    """A vehicle whose mission triggers a camera at its third command."""

    def __init__(self, *, count: int = 1, camera: bool = False, **triggered: Any) -> None:
        self.world = World()
        self.vehicle: ScriptedVehicle = self.world.add_vehicle(script=SLOW)
        self.component = self.world.add_camera(self.vehicle) if camera else None
        self.camera = TriggeredCamera(self.vehicle, **triggered)
        commands = takeoff(), waypoint(), image(3, count), waypoint(4, 20.0), go_home(5)
        self.world.edge.plan(mission(*commands))
        self.world.run_until(lambda: self.item == mavlink.MAV_CMD_IMAGE_START_CAPTURE)
        self.world.run(1.0)

    @property
    def item(self) -> int:
        """The command of the item that is flown."""
        flies = self.vehicle.armed and self.vehicle.items
        return int(self.vehicle.items[self.vehicle.current].command) if flies else 0

    def shoot(self, **how: bool) -> None:
        self.camera.shoot(self.world.clock.now, **how)
        self.world.run(1.0)

    def message(self) -> str | None:
        """The message of the command that takes pictures, behind the flight."""
        self.vehicle.script = dataclasses.replace(SLOW, item_time_s=40.0)
        self.world.run_until_over(MISSION)
        report = self.world.edge.reports(MISSION)[-1]["command_report_array"][2]
        text: str | None = report.get("message")
        return text


@pytest.mark.first_case
@PIN
def test_pictures_are_counted_with_their_places_and_have_no_file(*, has_pin: bool) -> None:
    flight = Flight(count=2, has_pin=has_pin)
    flight.shoot()
    flight.shoot()
    assert flight.message() == f"2 of 2 pictures were taken at {PLACE}, {PLACE}, and have no file"


@pytest.mark.first_case
@PIN
def test_a_lost_message_shows_in_the_next_one(*, has_pin: bool) -> None:
    flight = Flight(count=3, has_pin=has_pin)
    flight.shoot()
    flight.shoot(arrives=False)
    flight.shoot()
    assert flight.message() == f"3 of 3 pictures were taken at {PLACE}, {PLACE}, and have no file"


def test_a_picture_that_the_pin_has_not_confirmed_is_missing() -> None:
    flight = Flight(count=3, has_pin=True)
    flight.shoot()
    flight.shoot(confirms=False)
    flight.shoot()
    text = flight.message() or ""
    assert "1 of 3 pictures were not announced" in text
    assert "2 of 3 pictures were taken at" in text


def test_a_message_over_two_links_is_one_picture() -> None:
    flight = Flight(count=2)
    flight.shoot()
    flight.camera.report(flight.world.clock.now)
    text = flight.message() or ""
    assert "1 of 2 pictures were not announced" in text


def test_two_cameras_that_are_triggered_together_have_taken_each_picture_once() -> None:
    flight = Flight(count=2)
    other = TriggeredCamera(flight.vehicle, instance=1)
    other.shoot(flight.world.clock.now)
    flight.shoot()
    text = flight.message() or ""
    assert "1 of 2 pictures were not announced" in text


class TestBesideACamera:
    """A camera that is a component announces its pictures, and the autopilot reports them too."""

    def test_no_picture_is_counted_twice(self) -> None:
        flight = Flight(count=2, camera=True)
        assert flight.component is not None
        flight.component.shoot()
        flight.shoot()
        assert flight.message() == "1 of 2 pictures were not announced"
        assert len(flight.world.edge.bodies("/image/")) == 1

    def test_a_picture_that_the_camera_does_not_know_is_not_proved_by_the_autopilot(self) -> None:
        flight = Flight(count=2, camera=True)
        assert flight.component is not None
        flight.component.shoot()
        flight.shoot()
        flight.shoot()
        assert flight.message() == "1 of 2 pictures were not announced"

    def test_all_pictures_of_both_need_no_message(self) -> None:
        flight = Flight(count=2, camera=True)
        assert flight.component is not None
        for _ in range(2):
            flight.component.shoot()
            flight.shoot()
        assert flight.message() is None
        assert len(flight.world.edge.bodies("/image/")) == 2

    def test_a_lost_announcement_is_still_requested(self) -> None:
        flight = Flight(camera=True)
        assert flight.component is not None
        flight.component.shoot(announced=False)
        flight.shoot()
        assert flight.message() is None
        assert len(flight.world.edge.bodies("/image/")) == 1

    def test_that_announces_nothing_the_autopilot_s_report_counts(self) -> None:
        flight = Flight(camera=True)
        flight.shoot()
        assert flight.message() == f"1 of 1 pictures were taken at {PLACE}, and have no file"


def feedback(number: int, camera: int = 0, time_us: int = 0) -> Feedback:
    return Feedback(camera, number, time_us, None)


class TestCounting:
    def counts(self, *numbers: int) -> list[int]:
        counter = FeedbackCounter()
        return [counter.take(feedback(n), 10.0 + i)[0] for i, n in enumerate(numbers)]

    def test_a_gap_counts_what_was_lost(self) -> None:
        assert self.counts(7, 8, 11, 12) == [1, 1, 3, 1]

    def test_a_late_or_repeated_message_counts_nothing(self) -> None:
        assert self.counts(7, 9, 8, 9, 10) == [1, 2, 0, 0, 1]

    def test_the_count_goes_on_behind_its_last_number(self) -> None:
        assert self.counts(65534, 65535, 1) == [1, 1, 2]

    def test_a_jump_begins_anew(self) -> None:
        assert self.counts(7, 5000, 5001) == [1, 1, 1]

    def test_a_restart_begins_anew(self) -> None:
        counter = FeedbackCounter()
        counter.take(feedback(40), 10.0)
        counter.restarted(15.0)
        assert counter.take(feedback(2), 20.0) == (2, 15.0)

    def test_more_cameras_than_a_vehicle_has_are_not_kept(self) -> None:
        counter = FeedbackCounter()
        found = [counter.take(feedback(1, camera), 10.0)[0] for camera in range(20)]
        assert found == [1] * 8 + [0] * 12


class TestTime:
    def test_of_a_pin_is_that_since_boot_also_where_its_32_bits_end(self) -> None:
        assert feedback(1, time_us=99_000_000).taken_s(100.0, None) == pytest.approx(99.0)
        just_before = (1 << 32) - 1_000_000
        assert feedback(1, time_us=just_before).taken_s(4295.967296, None) == pytest.approx(
            4293.967296
        )

    def test_of_day_needs_the_vehicle_s_clock(self) -> None:
        one = feedback(1, time_us=1_790_000_098_000_000)
        assert one.taken_s(100.0, 1_790_000_000.0) == pytest.approx(98.0)
        assert one.taken_s(100.0, None) == 100.0

    @pytest.mark.parametrize("time_us", [0, 1, 1_800_000_000_000_000, 5_000_000_000])
    def test_that_cannot_be_is_the_present(self, time_us: int) -> None:
        assert feedback(1, time_us=time_us).taken_s(100.0, 1_790_000_000.0) == 100.0
