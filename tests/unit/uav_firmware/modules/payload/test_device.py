"""Pictures of a camera that stores them: reported once, in order, when they are stored or lost."""

import math

import pytest

from tests.unit.uav_firmware.modules.payload.harness import IMAGES_URL, PayloadHarness
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
    """A camera that stores its pictures on request, or fails."""

    def __init__(self, *, works: bool = True, used_bytes: int = 0) -> None:
        self.works = works
        self.is_ready = True
        self.answers = True
        self.used_bytes = used_bytes
        self.exposures: list[Exposure] = []
        self.in_progress: list[int] = []
        self.outcomes: list[Outcome] = []
        self.erased = 0
        self.seconds = False
        self.erased_at_once = 100 * MIB

    def expose(self, exposure: Exposure) -> None:
        if not self.works:
            raise OSError("no shutter")
        self.exposures.append(exposure)
        self.in_progress.append(exposure.image_index)

    def store(self) -> None:
        self.outcomes += [
            Outcome(i, Picture((f"{i}.jpg",), MIB, ("ndvi", f"{i}.jpg") if self.seconds else None))
            for i in self.in_progress
        ]
        self.used_bytes += MIB * len(self.in_progress)
        self.in_progress.clear()

    def lose(self) -> None:
        self.outcomes += [Outcome(i, None, "no card") for i in self.in_progress]
        self.in_progress.clear()

    def collect(self, _now_us: int) -> list[Outcome]:
        found, self.outcomes = self.outcomes, []
        return found

    def erase(self) -> bool:
        self.erased += 1
        self.used_bytes = max(self.used_bytes - self.erased_at_once, 0)
        return self.used_bytes == 0


def test_a_stored_picture_is_reported_with_its_file_and_size() -> None:
    device = Device()
    harness = PayloadHarness(device=device)
    harness.position = (30.0, 0.0, -10.0)
    harness.command(START, 0, 0, 1)
    harness.position = (60.0, 0.0, -10.0)
    harness.run(1.0)
    assert harness.pictures() == []
    device.store()
    harness.run(0.1)
    (picture,) = harness.pictures()
    assert picture.succeeded
    assert picture.file_url == f"{IMAGES_URL}/0.jpg"
    assert picture.latitude_deg == pytest.approx(40.44367, abs=1e-5)  # Where it was exposed
    assert harness.camera_status.used_mib == 1.0


def test_second_pictures_have_numbers_of_their_own() -> None:
    device = Device()
    harness = PayloadHarness(device=device)
    found = []
    for device.seconds in (False, True, True):
        harness.command(START, 0, 0, 1)
        harness.run(1.0)
        device.store()
        harness.run(0.1)
        (picture,) = harness.pictures()
        found.append((picture.image_index, picture.second_index, picture.second_file_url))
    urls = [f"{IMAGES_URL}/ndvi/{index}.jpg" for index in (1, 2)]
    assert found == [(0, -1, ""), (1, 0, urls[0]), (2, 1, urls[1])]
    assert harness.camera_status.second_count == 2


def test_the_device_receives_the_estimated_pose() -> None:
    device = Device()
    harness = PayloadHarness(device=device, CAM_IMAGE_SECOND=2, CAM_IMAGE_WIDTH=1600)
    harness.heading_deg = 70.0
    harness.command(START, 0, 0, 1)
    (exposure,) = device.exposures
    assert exposure.time_utc_us == 1_700_000_000_000_000 + exposure.time_us
    assert (exposure.lens.width_px, exposure.lens.height_px) == (1600, 1200)
    assert exposure.relative_altitude_m == pytest.approx(10.0)
    assert exposure.q_ned_frd == from_euler(0.1, -0.1, math.radians(70.0))
    assert exposure.second is SecondPicture.VEGETATION_INDEX


def test_a_failing_device_gives_a_failed_picture() -> None:
    harness = PayloadHarness(device=Device(works=False))
    harness.command(START, 0, 0, 1)
    (picture,) = harness.pictures()
    assert not picture.succeeded
    assert picture.file_url == ""
    assert "no shutter" in harness.status_texts()


def test_a_picture_that_cannot_be_stored_is_reported_as_failed() -> None:
    device = Device()
    harness = PayloadHarness(device=device)
    harness.command(START, 0, 0, 1)
    device.lose()
    harness.run(0.1)
    (picture,) = harness.pictures()
    assert not picture.succeeded
    assert "no card" in harness.status_texts()
    assert harness.camera_status.used_mib == 0.0


def test_pictures_are_reported_in_order_when_one_fails_at_once() -> None:
    device = Device()
    harness = PayloadHarness(device=device)
    harness.command(START, 0, 0, 1)
    harness.run(0.5)
    device.works = False
    harness.command(START, 0, 0, 1)
    harness.run(0.5)
    assert harness.pictures() == []
    device.store()
    harness.run(0.1)
    assert [(p.image_index, p.succeeded) for p in harness.pictures()] == [(0, True), (1, False)]


def test_full_memory_delays_the_shutter() -> None:
    device = Device()
    harness = PayloadHarness(device=device)
    device.is_ready = False
    harness.run(0.1)
    harness.command(START, 0, 0, 1)
    harness.run(2.0)
    assert device.exposures == []
    device.is_ready = True
    harness.run(0.1)
    assert len(device.exposures) == 1


def test_pictures_in_progress_count_as_used_space() -> None:
    device = Device()
    harness = PayloadHarness(device=device, CAM_STORAGE_SIZE=4.0)  # MiB; a picture may take 1.2
    harness.command(FORMAT, 1, 1)
    harness.command(START, 0, 0.5, 0)
    harness.run(5.0)
    assert len(device.exposures) == 3
    assert harness.status_texts().count("storage is full") == 1
    assert harness.command(START, 0, 0, 1) == FAILED


def test_removing_a_picture_frees_its_space() -> None:
    device = Device(used_bytes=3 * MIB)
    harness = PayloadHarness(device=device)
    harness.command(START, 0, 0, 1)
    device.store()
    harness.run(0.1)
    assert harness.camera_status.used_mib == 4.0
    device.used_bytes -= 2 * MIB  # By MAVFTP
    harness.run(0.1)
    assert harness.camera_status.used_mib == 2.0


def test_format_is_rejected_while_pictures_are_being_stored() -> None:
    device = Device(used_bytes=3 * MIB)
    harness = PayloadHarness(device=device)
    harness.run(0.1)
    assert harness.camera_status.used_mib == 3.0  # Of an earlier flight
    harness.command(START, 0, 0, 1)
    harness.run(1.0)
    assert harness.command(FORMAT, 1, 1) == BUSY
    device.store()
    harness.run(0.1)
    assert harness.command(FORMAT, 1, 1) == ACCEPTED
    harness.run(0.1)
    assert device.erased == 1
    assert harness.camera_status.used_mib == 0.0


def test_format_continues_until_the_device_is_empty() -> None:
    device = Device(used_bytes=3 * MIB)
    device.erased_at_once = MIB
    harness = PayloadHarness(device=device)
    harness.run(0.1)
    assert harness.command(FORMAT, 1, 1) == ACCEPTED
    harness.run(0.5)
    assert device.erased == 3
    assert harness.camera_status.used_mib == 0.0


def test_an_unresponsive_camera_is_reported_until_it_answers() -> None:
    device = Device()
    harness = PayloadHarness(device=device)
    reported = []
    for answers in (True, False, True):
        device.answers = answers
        harness.run(0.2)
        reported.append(harness.camera_status.answers)
    assert reported == [True, False, True]
