"""Pictures: one, many, by time, by distance; how they are told; what stops them."""

import itertools
import math

import pytest

from tests.unit.uav_firmware.modules.payload.bench import (
    ALTITUDE_M,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    MISSION,
    OPERATOR,
    RIVAL,
    Bench,
)
from uav_firmware.lib.rotation import from_euler
from uav_firmware.msg.payload import CaptureLogReset, ImageStatus, PayloadCommand
from uav_firmware.msg.status import CommandResult, NavigationState

START, STOP = PayloadCommand.IMAGE_START_CAPTURE, PayloadCommand.IMAGE_STOP_CAPTURE
BY_DISTANCE, FORMAT = PayloadCommand.DO_SET_CAM_TRIGG_DIST, PayloadCommand.STORAGE_FORMAT
VIDEO_START, VIDEO_STOP = PayloadCommand.VIDEO_START_CAPTURE, PayloadCommand.VIDEO_STOP_CAPTURE
ACCEPTED, BUSY = CommandResult.ACCEPTED, CommandResult.TEMPORARILY_REJECTED
DENIED, FAILED = CommandResult.DENIED, CommandResult.FAILED


def test_a_picture_is_told_once_with_where_and_how_it_was_taken() -> None:
    bench = Bench()
    bench.position = (30.0, -20.0, -12.0)
    bench.heading_deg = 40.0
    assert bench.ask(START, 0, 0, 1) == ACCEPTED
    bench.run(2.0)
    (picture,) = bench.pictures()
    assert picture.image_index == 0
    assert picture.succeeded
    assert picture.file_url == ""
    assert picture.altitude_amsl_m == pytest.approx(ALTITUDE_M + 12.0)
    assert picture.relative_altitude_m == pytest.approx(12.0)
    assert picture.latitude_deg > LATITUDE_DEG
    assert picture.longitude_deg < LONGITUDE_DEG
    assert picture.q_ned_camera == pytest.approx(from_euler(0.0, 0.0, math.radians(40.0)), abs=0.02)


def test_a_series_has_its_number_and_its_interval() -> None:
    bench = Bench()
    assert bench.ask(START, 0, 2.0, 3) == ACCEPTED
    bench.run(20.0)
    times = [picture.time_us for picture in bench.pictures()]
    assert len(times) == 3
    assert times[2] - times[0] == pytest.approx(4_000_000, abs=100_000)
    assert bench.seen.image_status is ImageStatus.IDLE
    assert bench.seen.image_count == 3


def test_an_endless_series_ends_when_told_to_and_refuses_others_meanwhile() -> None:
    bench = Bench()
    bench.ask(START, 0, 1.0, 0)
    bench.run(5.0)
    assert bench.seen.image_interval_s == 1.0
    assert bench.ask(START, 0, 0, 1) == BUSY
    assert bench.ask(START, 0, 2.0, 0) == BUSY
    taken = len(bench.pictures())
    assert taken == pytest.approx(5, abs=1)
    assert bench.ask(STOP) == ACCEPTED
    bench.run(5.0)
    assert bench.pictures() == []


def test_an_interval_that_is_not_given_is_a_second() -> None:
    bench = Bench()
    bench.ask(START, 0, math.nan, 0)
    bench.run(10.0)
    assert len(bench.pictures()) == pytest.approx(10, abs=1)


def test_a_repeated_sequence_number_takes_no_second_picture() -> None:
    bench = Bench()
    assert bench.ask(START, 0, 0, 1, 5) == ACCEPTED
    bench.run(1.0)
    assert bench.ask(START, 0, 0, 1, 5) == ACCEPTED
    assert bench.ask(START, 0, 0, 1, 5, sender=RIVAL) == ACCEPTED  # another's fifth
    assert bench.ask(START, 0, 0, 1, 6) == ACCEPTED
    bench.run(2.0)
    assert len(bench.pictures()) == 3


def test_a_client_that_begins_again_at_one_gets_its_picture() -> None:
    bench = Bench()
    bench.ask(START, 0, 0, 1, 1)
    bench.run(11.0)
    bench.ask(START, 0, 0, 1, 1)
    bench.run(1.0)
    assert len(bench.pictures()) == 2


def test_single_pictures_that_come_at_once_are_taken_one_after_the_other() -> None:
    bench = Bench()
    for _ in range(12):
        bench.order(START, 0, 0, 1)
    bench.run(10.0)
    results = [ack.result for ack in bench.acks.drain()]
    assert results == [ACCEPTED] * 8 + [BUSY] * 4
    indices = [picture.image_index for picture in bench.pictures()]
    assert indices == list(range(8))


def test_twenty_pictures_in_a_row_of_a_mission_are_all_taken() -> None:
    bench = Bench()
    bench.flies(NavigationState.AUTO_MISSION)
    for _ in range(20):
        bench.order(START, 0, 0, 1, 7, sender=MISSION)  # a jump may repeat a number
    bench.run(10.0)
    assert len(bench.pictures()) == 20
    assert bench.acks.drain() == []


def test_a_mission_takes_each_picture_with_the_gimbal_where_it_said() -> None:
    bench = Bench()
    bench.flies(NavigationState.AUTO_MISSION)
    wanted = (-90.0, 0.0, -45.0)
    for pitch in wanted:
        bench.order(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, pitch, 0.0, sender=MISSION)
        bench.order(START, 0, 0, 1, sender=MISSION)
    bench.run(20.0)
    taken = bench.pictures()
    pitches = [2.0 * math.degrees(math.asin(p.q_ned_camera[2])) for p in taken]
    assert pitches == pytest.approx(wanted, abs=1.5)


def test_pictures_by_distance_lie_evenly() -> None:
    bench = Bench()
    bench.velocity = (4.0, 0.0, 0.0)
    assert bench.ask(BY_DISTANCE, 10.0, 0, 1) == ACCEPTED
    bench.run(20.5)
    latitudes = [picture.latitude_deg for picture in bench.pictures()]
    steps = [(b - a) * 111_000 for a, b in itertools.pairwise(latitudes)]
    assert len(latitudes) == 9
    assert steps == pytest.approx([10.0] * 8, abs=0.5)
    assert bench.ask(BY_DISTANCE, 0.0) == ACCEPTED
    bench.run(10.0)
    assert bench.pictures() == []


def test_a_hovering_vehicle_takes_only_the_picture_that_was_asked_for_at_once() -> None:
    bench = Bench()
    bench.ask(BY_DISTANCE, 10.0, 0, 1)
    bench.run(10.0)
    assert len(bench.pictures()) == 1


@pytest.mark.parametrize("state", [NavigationState.AUTO_RTL, NavigationState.AUTO_LAND])
def test_the_way_home_ends_pictures_but_not_the_video(state: NavigationState) -> None:
    bench = Bench()
    bench.ask(START, 0, 1.0, 0)
    bench.ask(VIDEO_START)
    bench.run(1.0)
    bench.flies(state)
    bench.run(0.5)
    bench.pictures()
    bench.run(5.0)
    assert bench.pictures() == []
    assert "Pictures stopped" in bench.said()
    assert bench.seen.recording_since_us >= 0
    bench.flies(NavigationState.AUTO_LOITER, armed=False)
    bench.run(1.0)
    assert bench.seen.recording_since_us == -1


def test_what_a_mission_began_rests_while_it_is_paused() -> None:
    bench = Bench()
    bench.flies(NavigationState.AUTO_MISSION)
    bench.order(START, 0, 1.0, 0, sender=MISSION)
    bench.run(3.0)
    assert len(bench.pictures()) >= 3
    bench.flies(NavigationState.AUTO_LOITER)
    bench.run(5.0)
    assert len(bench.pictures()) <= 1
    bench.flies(NavigationState.AUTO_MISSION)
    bench.run(3.0)
    assert 2 <= len(bench.pictures()) <= 4


def test_a_missions_endless_series_makes_room_for_its_next_order() -> None:
    bench = Bench()
    bench.flies(NavigationState.AUTO_MISSION)
    bench.order(START, 0, 1.0, 0, sender=MISSION)
    bench.run(2.0)
    bench.order(START, 0, 0, 1, sender=MISSION)
    bench.run(1.0)
    bench.pictures()
    bench.run(5.0)
    assert bench.pictures() == []


def test_a_full_storage_says_so_and_a_format_makes_room_and_begins_a_new_log() -> None:
    bench = Bench(CAM_STORAGE_SIZE=2.0)
    bench.ask(FORMAT, 1, 1)
    bench.ask(START, 0, 0, 1)
    bench.run(1.0)
    assert bench.ask(START, 0, 0, 1) == FAILED
    assert "full" in bench.said()
    assert bench.seen.used_mib > 1.0
    assert bench.ask(FORMAT, 1, 1) == ACCEPTED
    assert (bench.seen.used_mib, bench.seen.image_count) == (0.0, 0)
    assert isinstance(bench.events.drain()[-1], CaptureLogReset)
    bench.ask(START, 0, 0, 1)
    (picture,) = bench.pictures()
    assert picture.image_index == 0
    assert "Camera storage is full" in bench.said()


def test_the_log_alone_can_be_reset() -> None:
    bench = Bench()
    bench.ask(START, 0, 0, 1)
    bench.run(1.0)
    used = bench.seen.used_mib
    assert bench.ask(FORMAT, 1, 0, 1) == ACCEPTED
    assert (bench.seen.used_mib, bench.seen.image_count) == (used, 0)


def test_a_storage_in_use_is_not_formatted() -> None:
    bench = Bench()
    bench.ask(START, 0, 5.0, 0)
    assert bench.ask(FORMAT, 1, 1) == BUSY


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
def test_what_cannot_be_honoured_is_denied_in_words(wrong: tuple[float, ...]) -> None:
    bench = Bench()
    assert bench.ask(int(wrong[0]), *wrong[1:]) == DENIED
    assert "parameter" in bench.said()
    bench.run(3.0)
    assert bench.pictures() == []


def test_video_counts_its_time_and_runs_once() -> None:
    bench = Bench()
    assert bench.ask(VIDEO_START, 0, 2.0) == ACCEPTED
    assert bench.seen.report_interval_us == 500_000
    assert bench.ask(VIDEO_START) == BUSY
    assert bench.ask(START, 0, 0, 1) == ACCEPTED  # pictures go on besides
    assert bench.ask(VIDEO_STOP) == ACCEPTED
    assert bench.seen.recording_since_us == -1
    assert bench.ask(VIDEO_STOP) == ACCEPTED


def test_an_unknown_place_is_told_as_unknown() -> None:
    bench = Bench()
    bench.order(START, 0, 0, 1, sender=OPERATOR)
    bench.module.update(40_000)  # nothing estimated yet
    (picture,) = bench.pictures()
    assert math.isnan(picture.latitude_deg)
