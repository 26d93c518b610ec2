"""Pictures of a camera that stores them: told once, in order, when they are stored or lost."""

import math

import pytest

from tests.unit.uav_firmware.modules.payload.bench import IMAGES_URL, Bench
from uav_firmware.cal.camera import Exposure, Outcome, Picture, SecondPicture
from uav_firmware.lib.rotation import from_euler
from uav_firmware.msg.payload import PayloadCommand
from uav_firmware.msg.status import CommandResult

START, FORMAT = PayloadCommand.IMAGE_START_CAPTURE, PayloadCommand.STORAGE_FORMAT
ACCEPTED, BUSY, FAILED = (
    CommandResult.ACCEPTED,
    CommandResult.TEMPORARILY_REJECTED,
    CommandResult.FAILED,
)
MIB = 1 << 20


class Device:
    """A camera that stores its pictures when it is told to, or fails."""

    def __init__(self, *, works: bool = True, used_bytes: int = 0) -> None:
        self.works = works
        self.is_ready = True
        self.answers = True
        self.used_bytes = used_bytes
        self.exposures: list[Exposure] = []
        self.under_way: list[int] = []
        self.outcomes: list[Outcome] = []
        self.erased = 0
        self.erased_at_once = 100 * MIB

    def expose(self, exposure: Exposure) -> None:
        if not self.works:
            raise OSError("no shutter")
        self.exposures.append(exposure)
        self.under_way.append(exposure.image_index)

    def store(self) -> None:
        self.outcomes += [Outcome(i, Picture((f"{i}.jpg",), MIB)) for i in self.under_way]
        self.used_bytes += MIB * len(self.under_way)
        self.under_way.clear()

    def lose(self) -> None:
        self.outcomes += [Outcome(i, None, "no card") for i in self.under_way]
        self.under_way.clear()

    def collect(self, _now_us: int) -> list[Outcome]:
        found, self.outcomes = self.outcomes, []
        return found

    def erase(self) -> bool:
        self.erased += 1
        self.used_bytes = max(self.used_bytes - self.erased_at_once, 0)
        return self.used_bytes == 0


def test_a_picture_is_told_when_it_is_stored_with_its_file_and_its_size() -> None:
    device = Device()
    bench = Bench(device=device)
    bench.position = (30.0, 0.0, -10.0)
    bench.ask(START, 0, 0, 1)
    bench.position = (60.0, 0.0, -10.0)
    bench.run(1.0)
    assert bench.pictures() == []
    device.store()
    bench.run(0.1)
    (picture,) = bench.pictures()
    assert picture.succeeded
    assert picture.file_url == f"{IMAGES_URL}/0.jpg"
    assert picture.latitude_deg == pytest.approx(40.44367, abs=1e-5)  # Where it was exposed
    assert bench.seen.used_mib == 1.0


def test_the_device_hears_what_the_vehicle_believes() -> None:
    device = Device()
    bench = Bench(device=device, CAM_IMAGE_SECOND=2, CAM_IMAGE_WIDTH=1600)
    bench.heading_deg = 70.0
    bench.ask(START, 0, 0, 1)
    (exposure,) = device.exposures
    assert exposure.time_utc_us == 1_700_000_000_000_000 + exposure.time_us
    assert (exposure.lens.width_px, exposure.lens.height_px) == (1600, 1200)
    assert exposure.relative_altitude_m == pytest.approx(10.0)
    assert exposure.q_ned_frd == from_euler(0.1, -0.1, math.radians(70.0))
    assert exposure.second is SecondPicture.VEGETATION_INDEX


def test_a_device_that_fails_gives_a_failed_picture() -> None:
    bench = Bench(device=Device(works=False))
    bench.ask(START, 0, 0, 1)
    (picture,) = bench.pictures()
    assert not picture.succeeded
    assert picture.file_url == ""
    assert "no shutter" in bench.said()


def test_a_picture_that_cannot_be_stored_is_told_as_failed() -> None:
    device = Device()
    bench = Bench(device=device)
    bench.ask(START, 0, 0, 1)
    device.lose()
    bench.run(0.1)
    (picture,) = bench.pictures()
    assert not picture.succeeded
    assert "no card" in bench.said()
    assert bench.seen.used_mib == 0.0


def test_pictures_are_told_in_their_order_though_one_fails_at_once() -> None:
    device = Device()
    bench = Bench(device=device)
    bench.ask(START, 0, 0, 1)
    bench.run(0.5)
    device.works = False
    bench.ask(START, 0, 0, 1)
    bench.run(0.5)
    assert bench.pictures() == []
    device.store()
    bench.run(0.1)
    assert [(p.image_index, p.succeeded) for p in bench.pictures()] == [(0, True), (1, False)]


def test_a_full_memory_makes_the_shutter_wait() -> None:
    device = Device()
    bench = Bench(device=device)
    device.is_ready = False
    bench.run(0.1)
    bench.ask(START, 0, 0, 1)
    bench.run(2.0)
    assert device.exposures == []
    device.is_ready = True
    bench.run(0.1)
    assert len(device.exposures) == 1


def test_pictures_under_way_count_against_the_room() -> None:
    device = Device()
    bench = Bench(device=device, CAM_STORAGE_SIZE=4.0)  # MiB; a picture may take 1.2
    bench.ask(FORMAT, 1, 1)
    bench.ask(START, 0, 0.5, 0)
    bench.run(5.0)
    assert len(device.exposures) == 3
    assert bench.said().count("storage is full") == 1
    assert bench.ask(START, 0, 0, 1) == FAILED


def test_a_picture_that_a_client_removes_gives_its_room_back() -> None:
    device = Device(used_bytes=3 * MIB)
    bench = Bench(device=device)
    bench.ask(START, 0, 0, 1)
    device.store()
    bench.run(0.1)
    assert bench.seen.used_mib == 4.0
    device.used_bytes -= 2 * MIB  # By MAVFTP
    bench.run(0.1)
    assert bench.seen.used_mib == 2.0


def test_a_format_waits_for_what_is_being_stored() -> None:
    device = Device(used_bytes=3 * MIB)
    bench = Bench(device=device)
    bench.run(0.1)
    assert bench.seen.used_mib == 3.0  # Of an earlier flight
    bench.ask(START, 0, 0, 1)
    bench.run(1.0)
    assert bench.ask(FORMAT, 1, 1) == BUSY
    device.store()
    bench.run(0.1)
    assert bench.ask(FORMAT, 1, 1) == ACCEPTED
    bench.run(0.1)
    assert device.erased == 1
    assert bench.seen.used_mib == 0.0


def test_a_format_goes_on_until_the_card_is_empty() -> None:
    device = Device(used_bytes=3 * MIB)
    device.erased_at_once = MIB
    bench = Bench(device=device)
    bench.run(0.1)
    assert bench.ask(FORMAT, 1, 1) == ACCEPTED
    bench.run(0.5)
    assert device.erased == 3
    assert bench.seen.used_mib == 0.0


def test_a_dead_camera_is_told_as_dead_until_it_answers_again() -> None:
    device = Device()
    bench = Bench(device=device)
    told = []
    for answers in (True, False, True):
        device.answers = answers
        bench.run(0.2)
        told.append(bench.seen.answers)
    assert told == [True, False, True]
