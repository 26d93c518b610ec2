"""Single pictures and series by time or distance: reports and ends."""

import itertools
import math

import pytest

from tests.unit.uav_firmware.modules.payload.harness import (
    ALTITUDE_M,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    MISSION,
    OPERATOR,
    RIVAL,
    PayloadHarness,
)
from uav_firmware.lib.rotation import from_euler
from uav_firmware.msg.payload import CaptureLogReset, ImageStatus, PayloadCommand
from uav_firmware.msg.status import CommandResult, NavigationState

START, STOP = PayloadCommand.IMAGE_START_CAPTURE, PayloadCommand.IMAGE_STOP_CAPTURE
BY_DISTANCE, FORMAT = PayloadCommand.DO_SET_CAM_TRIGG_DIST, PayloadCommand.STORAGE_FORMAT
VIDEO_START, VIDEO_STOP = PayloadCommand.VIDEO_START_CAPTURE, PayloadCommand.VIDEO_STOP_CAPTURE
ACCEPTED, BUSY = CommandResult.ACCEPTED, CommandResult.TEMPORARILY_REJECTED
DENIED, FAILED = CommandResult.DENIED, CommandResult.FAILED


def test_a_picture_is_reported_once_with_position_and_attitude() -> None:
    harness = PayloadHarness()
    harness.position = (30.0, -20.0, -12.0)
    harness.heading_deg = 40.0
    assert harness.command(START, 0, 0, 1) == ACCEPTED
    harness.run(2.0)
    (picture,) = harness.pictures()
    assert picture.image_index == 0
    assert picture.succeeded
    assert picture.file_url == ""
    assert picture.altitude_amsl_m == pytest.approx(ALTITUDE_M + 12.0)
    assert picture.relative_altitude_m == pytest.approx(12.0)
    assert picture.latitude_deg > LATITUDE_DEG
    assert picture.longitude_deg < LONGITUDE_DEG
    assert picture.q_ned_camera == pytest.approx(from_euler(0.0, 0.0, math.radians(40.0)), abs=0.02)


def test_a_series_has_its_count_and_interval() -> None:
    harness = PayloadHarness()
    assert harness.command(START, 0, 2.0, 3) == ACCEPTED
    harness.run(20.0)
    times = [picture.time_us for picture in harness.pictures()]
    assert len(times) == 3
    assert times[2] - times[0] == pytest.approx(4_000_000, abs=100_000)
    assert harness.camera_status.image_status is ImageStatus.IDLE
    assert harness.camera_status.image_count == 3


def test_an_endless_series_runs_until_stopped_and_rejects_others() -> None:
    harness = PayloadHarness()
    harness.command(START, 0, 1.0, 0)
    harness.run(5.0)
    assert harness.camera_status.image_interval_s == 1.0
    assert harness.command(START, 0, 0, 1) == BUSY
    assert harness.command(START, 0, 2.0, 0) == BUSY
    taken = len(harness.pictures())
    assert taken == pytest.approx(5, abs=1)
    assert harness.command(STOP) == ACCEPTED
    harness.run(5.0)
    assert harness.pictures() == []


def test_the_default_interval_is_one_second() -> None:
    harness = PayloadHarness()
    harness.command(START, 0, math.nan, 0)
    harness.run(10.0)
    assert len(harness.pictures()) == pytest.approx(10, abs=1)


def test_a_repeated_sequence_number_takes_no_second_picture() -> None:
    harness = PayloadHarness()
    assert harness.command(START, 0, 0, 1, 5) == ACCEPTED
    harness.run(1.0)
    assert harness.command(START, 0, 0, 1, 5) == ACCEPTED
    assert harness.command(START, 0, 0, 1, 5, sender=RIVAL) == ACCEPTED  # another's fifth
    assert harness.command(START, 0, 0, 1, 6) == ACCEPTED
    harness.run(2.0)
    assert len(harness.pictures()) == 3


def test_sequence_numbers_of_a_restarted_client_are_accepted() -> None:
    harness = PayloadHarness()
    harness.command(START, 0, 0, 1, 1)
    harness.run(11.0)
    harness.command(START, 0, 0, 1, 1)
    harness.run(1.0)
    assert len(harness.pictures()) == 2


def test_single_pictures_are_queued() -> None:
    harness = PayloadHarness()
    for _ in range(12):
        harness.order(START, 0, 0, 1)
    harness.run(10.0)
    results = [ack.result for ack in harness.acks.drain()]
    assert results == [ACCEPTED] * 8 + [BUSY] * 4
    indices = [picture.image_index for picture in harness.pictures()]
    assert indices == list(range(8))


def test_twenty_pictures_of_a_mission_are_all_taken() -> None:
    harness = PayloadHarness()
    harness.flies(NavigationState.AUTO_MISSION)
    for _ in range(20):
        harness.order(START, 0, 0, 1, 7, sender=MISSION)  # a jump may repeat a number
    harness.run(10.0)
    assert len(harness.pictures()) == 20
    assert harness.acks.drain() == []


def test_a_mission_takes_each_picture_in_its_direction() -> None:
    harness = PayloadHarness()
    harness.flies(NavigationState.AUTO_MISSION)
    expected = (-90.0, 0.0, -45.0)
    for pitch in expected:
        harness.order(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, pitch, 0.0, sender=MISSION)
        harness.order(START, 0, 0, 1, sender=MISSION)
    harness.run(20.0)
    taken = harness.pictures()
    pitches = [2.0 * math.degrees(math.asin(p.q_ned_camera[2])) for p in taken]
    assert pitches == pytest.approx(expected, abs=1.5)


def test_pictures_by_distance_are_evenly_spaced() -> None:
    harness = PayloadHarness()
    harness.velocity = (4.0, 0.0, 0.0)
    assert harness.command(BY_DISTANCE, 10.0, 0, 1) == ACCEPTED
    harness.run(20.5)
    latitudes = [picture.latitude_deg for picture in harness.pictures()]
    steps = [(b - a) * 111_000 for a, b in itertools.pairwise(latitudes)]
    assert len(latitudes) == 9
    assert steps == pytest.approx([10.0] * 8, abs=0.5)
    assert harness.command(BY_DISTANCE, 0.0) == ACCEPTED
    harness.run(10.0)
    assert harness.pictures() == []


def test_a_hovering_vehicle_takes_only_the_first_picture_by_distance() -> None:
    harness = PayloadHarness()
    harness.command(BY_DISTANCE, 10.0, 0, 1)
    harness.run(10.0)
    assert len(harness.pictures()) == 1


@pytest.mark.parametrize("state", [NavigationState.AUTO_RTL, NavigationState.AUTO_LAND])
def test_return_ends_pictures_but_not_video(state: NavigationState) -> None:
    harness = PayloadHarness()
    harness.command(START, 0, 1.0, 0)
    harness.command(VIDEO_START)
    harness.run(1.0)
    harness.flies(state)
    harness.run(0.5)
    harness.pictures()
    harness.run(5.0)
    assert harness.pictures() == []
    assert "Pictures stopped" in harness.status_texts()
    assert harness.camera_status.recording_since_us >= 0
    harness.flies(NavigationState.AUTO_LOITER, armed=False)
    harness.run(1.0)
    assert harness.camera_status.recording_since_us == -1


def test_a_series_of_a_paused_mission_is_paused() -> None:
    harness = PayloadHarness()
    harness.flies(NavigationState.AUTO_MISSION)
    harness.order(START, 0, 1.0, 0, sender=MISSION)
    harness.run(3.0)
    assert len(harness.pictures()) >= 3
    harness.flies(NavigationState.AUTO_LOITER)
    harness.run(5.0)
    assert len(harness.pictures()) <= 1
    harness.flies(NavigationState.AUTO_MISSION)
    harness.run(3.0)
    assert 2 <= len(harness.pictures()) <= 4


def test_a_picture_by_hand_in_the_pause_of_a_mission_costs_its_series_nothing() -> None:
    harness = PayloadHarness()
    harness.flies(NavigationState.AUTO_MISSION)
    harness.order(START, 0, 1.0, 6, sender=MISSION)
    harness.order(START, 0, 0, 1, sender=MISSION)  # Behind the series, also in the pause
    harness.run(2.5)
    before = len(harness.pictures())
    assert harness.command(START, 0, 0, 1) == BUSY
    harness.flies(NavigationState.AUTO_LOITER)
    harness.run(2.0)
    before += len(harness.pictures())
    assert harness.command(START, 0, 0, 1) == ACCEPTED
    harness.run(2.0)
    assert len(harness.pictures()) == 1
    harness.flies(NavigationState.AUTO_MISSION)
    harness.run(10.0)
    assert before + len(harness.pictures()) == 6 + 1


def test_the_next_order_of_a_mission_ends_its_endless_series() -> None:
    harness = PayloadHarness()
    harness.flies(NavigationState.AUTO_MISSION)
    harness.order(START, 0, 1.0, 0, sender=MISSION)
    harness.run(2.0)
    harness.order(START, 0, 0, 1, sender=MISSION)
    harness.run(1.0)
    harness.pictures()
    harness.run(5.0)
    assert harness.pictures() == []


def test_full_storage_is_reported_and_format_frees_it() -> None:
    harness = PayloadHarness(CAM_STORAGE_SIZE=2.0)
    harness.command(FORMAT, 1, 1)
    harness.command(START, 0, 0, 1)
    harness.run(1.0)
    assert harness.command(START, 0, 0, 1) == FAILED
    assert "full" in harness.status_texts()
    assert harness.camera_status.used_mib > 1.0
    assert harness.command(FORMAT, 1, 1) == ACCEPTED
    assert (harness.camera_status.used_mib, harness.camera_status.image_count) == (0.0, 0)
    assert isinstance(harness.events.drain()[-1], CaptureLogReset)
    harness.command(START, 0, 0, 1)
    (picture,) = harness.pictures()
    assert picture.image_index == 0
    assert "Camera storage is full" in harness.status_texts()


def test_the_capture_log_alone_can_be_reset() -> None:
    harness = PayloadHarness()
    harness.command(START, 0, 0, 1)
    harness.run(1.0)
    used = harness.camera_status.used_mib
    assert harness.command(FORMAT, 1, 0, 1) == ACCEPTED
    assert (harness.camera_status.used_mib, harness.camera_status.image_count) == (used, 0)


def test_storage_in_use_is_not_formatted() -> None:
    harness = PayloadHarness()
    harness.command(START, 0, 5.0, 0)
    assert harness.command(FORMAT, 1, 1) == BUSY


@pytest.mark.parametrize(
    "wrong",
    [
        (START, 3, 0, 1),
        (START, 0, 0.1, 0),
        (START, 0, 1.0, -2),
        (START, 0, 1.0, 1.5),
        (START, 0, math.inf, 1),
        (START, 0, 0, 1, 0, 7),
        (STOP, 4),
        (BY_DISTANCE, -1.0),
        (BY_DISTANCE, 10.0, 20.0),
        (FORMAT, 2, 1),
        (VIDEO_START, 2),
        (VIDEO_START, 0, 1000.0),
        (PayloadCommand.SET_CAMERA_MODE, 0, 9),
        (PayloadCommand.SET_CAMERA_MODE, 0, math.nan),
    ],
)
def test_invalid_parameters_are_denied_with_a_reason(wrong: tuple[float, ...]) -> None:
    harness = PayloadHarness()
    assert harness.command(int(wrong[0]), *wrong[1:]) == DENIED
    assert "parameter" in harness.status_texts()
    harness.run(3.0)
    assert harness.pictures() == []


def test_video_reports_its_time_and_starts_once() -> None:
    harness = PayloadHarness()
    assert harness.command(VIDEO_START, 0, 2.0) == ACCEPTED
    assert harness.camera_status.report_interval_us == 500_000
    assert harness.command(VIDEO_START) == BUSY
    assert harness.command(START, 0, 0, 1) == ACCEPTED  # pictures go on besides
    assert harness.command(VIDEO_STOP) == ACCEPTED
    assert harness.camera_status.recording_since_us == -1
    assert harness.command(VIDEO_STOP) == ACCEPTED


def test_an_unknown_position_is_reported_as_nan() -> None:
    harness = PayloadHarness()
    harness.order(START, 0, 0, 1, sender=OPERATOR)
    harness.module.update(40_000)  # nothing estimated yet
    (picture,) = harness.pictures()
    assert math.isnan(picture.latitude_deg)
