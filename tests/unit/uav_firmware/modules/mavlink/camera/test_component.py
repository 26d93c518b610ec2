"""Component 100 on the wire: who it is, what it answers, what it says of pictures."""

import math
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    CAMERA,
    GROUND,
    SYSTEM,
    Bench,
    command_int,
    command_long,
)
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import CommandCancel
from uav_firmware.msg.payload import (
    CancelOrder,
    CaptureLogReset,
    ImageCaptured,
    PayloadCommand,
    PayloadOrder,
)
from uav_firmware.msg.status import CommandResult, VehicleCommand

CAMERA_ID = 100
REQUEST, INTERVAL = 512, 511
START = PayloadCommand.IMAGE_START_CAPTURE
ACCEPTED, DENIED, UNSUPPORTED = (
    CommandResult.ACCEPTED,
    CommandResult.DENIED,
    CommandResult.UNSUPPORTED,
)
IMAGE = ImageCaptured(
    time_us=5_000_000,
    image_index=0,
    latitude_deg=40.5,
    longitude_deg=-3.5,
    altitude_amsl_m=662.0,
    relative_altitude_m=12.0,
    q_ned_camera=(0.5, 0.5, 0.5, 0.5),
    succeeded=True,
    file_url="",
)


def heard(bench: Bench, name: str, **where: Any) -> list[Any]:
    return bench.hear(name, component=CAMERA_ID, **where)


def ask(bench: Bench, number: int, *parameters: float, target: int = CAMERA_ID) -> list[Any]:
    """All that component 100 says within two ticks after a command."""
    bench.hear(component=CAMERA_ID)
    bench.say(command_long(number, *parameters, target_component=target))
    bench.run(40_000)
    return bench.hear(component=CAMERA_ID)


def result(messages: list[Any]) -> int:
    (ack,) = [m for m in messages if m.get_type() == "COMMAND_ACK"]
    return int(ack.result)


def orders(bench: Bench) -> list[PayloadOrder]:
    return bench.topics.payload_order.drain()


def order(bench: Bench) -> VehicleCommand:
    (one,) = orders(bench)
    assert isinstance(one, VehicleCommand)
    return one


def test_a_camera_shows_itself_once_a_second_beside_the_vehicle() -> None:
    bench = Bench()
    bench.run(10_000_000)
    for peer in (GROUND, BROKER):
        beats = heard(bench, "HEARTBEAT", at=peer)
        assert 10 <= len(beats) <= 11
        assert {(m.type, m.autopilot) for m in beats} == {
            (mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID)
        }


def test_each_component_counts_its_own_frames() -> None:
    bench = Bench()
    for _ in range(5):
        bench.say(command_long(REQUEST, 260, target_component=CAMERA_ID))
    bench.run(3_000_000)
    sent = [m for m in _everything(bench) if m.get_srcComponent() == CAMERA_ID]
    assert len(sent) > 10
    assert [m.get_seq() for m in sent] == list(range(len(sent)))


def _everything(bench: Bench) -> list[Any]:
    from uav_firmware.modules.mavlink.wire.dialect import parse  # noqa: PLC0415 - only this reads raw

    return [m for data, to in bench.memory.sent if to == GROUND for m in parse(data).messages]


@pytest.mark.parametrize("target", [CAMERA_ID, 0])
@pytest.mark.parametrize(
    ("command", "name"),
    [
        ((REQUEST, 259), "CAMERA_INFORMATION"),
        ((REQUEST, 260), "CAMERA_SETTINGS"),
        ((REQUEST, 261), "STORAGE_INFORMATION"),
        ((REQUEST, 261, 1), "STORAGE_INFORMATION"),
        ((REQUEST, 262), "CAMERA_CAPTURE_STATUS"),
        ((REQUEST, 275), "CAMERA_TRACKING_IMAGE_STATUS"),
        ((REQUEST, 276), "CAMERA_TRACKING_GEO_STATUS"),
        ((521, 1), "CAMERA_INFORMATION"),
        ((522, 1), "CAMERA_SETTINGS"),
        ((525, 0, 1), "STORAGE_INFORMATION"),
        ((527, 1), "CAMERA_CAPTURE_STATUS"),
    ],
)
def test_what_is_asked_for_comes_with_one_answer(
    command: tuple[float, ...], name: str, target: int
) -> None:
    bench = Bench()
    bench.run()
    messages = ask(bench, int(command[0]), *command[1:], target=target)
    assert result(messages) == ACCEPTED
    assert len([m for m in messages if m.get_type() == name]) == 1
    assert bench.hear("COMMAND_ACK") == []  # the autopilot stays silent


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ((REQUEST, 148), UNSUPPORTED),
        ((REQUEST, 30), UNSUPPORTED),
        ((REQUEST, -5), DENIED),
        ((REQUEST, 261, 4), DENIED),
        ((REQUEST, 269, 9), DENIED),
        ((REQUEST, 270, 2), DENIED),
        ((525, 3, 1), DENIED),
        ((521, 0), ACCEPTED),
        ((2504, 7), DENIED),
        ((531, 1, 1), UNSUPPORTED),
        ((532, 1, 1), UNSUPPORTED),
        ((400, 1), UNSUPPORTED),
        ((1000, -30), UNSUPPORTED),
    ],
)
def test_what_the_camera_has_not_is_refused_at_once(
    command: tuple[float, ...], expected: int
) -> None:
    bench = Bench()
    messages = ask(bench, int(command[0]), *command[1:])
    assert result(messages) == expected
    assert orders(bench) == []
    assert bench.commands() == []


@pytest.mark.parametrize("command", [(REQUEST, 269), (2504, 0), (2504, 1)])
def test_the_live_view_is_told_to_who_asks(command: tuple[float, ...]) -> None:
    messages = ask(Bench(), int(command[0]), *command[1:])
    assert result(messages) == ACCEPTED
    (told,) = [m for m in messages if m.get_type() == "VIDEO_STREAM_INFORMATION"]
    assert told.uri == "http://127.0.0.1:14581/stream"
    assert (told.stream_id, told.count) == (1, 1)
    assert (told.resolution_h, told.resolution_v) == (480, 360)
    assert told.flags & mavlink.VIDEO_STREAM_STATUS_FLAGS_RUNNING


def test_the_cameras_messages_are_not_the_autopilots() -> None:
    bench = Bench()
    (ack,) = bench.ask(command_long(REQUEST, 259), "COMMAND_ACK")
    assert ack.result == UNSUPPORTED


@pytest.mark.parametrize("target", [1, CAMERA_ID])
@pytest.mark.parametrize("form", [command_long, command_int])
def test_a_command_is_answered_once_by_whom_it_was_sent_to(target: int, form: Any) -> None:
    bench = Bench()
    bench.say(form(int(START), 0, 2.0, 3, target_component=target))
    bench.run()
    command = order(bench)
    assert (command.command, command.param2, command.param3) == (START, 2.0, 3.0)
    assert (command.source_system, command.source_component) == (255, 190)
    bench.answer(command, ACCEPTED)
    bench.run()
    answers = [len(bench.hear("COMMAND_ACK", component=c)) for c in (1, CAMERA_ID)]
    assert answers == ([1, 0] if target == 1 else [0, 1])
    assert bench.commands() == []


def test_a_command_to_all_components_is_carried_out_once() -> None:
    bench = Bench()
    bench.say(command_long(int(START), 0, 0, 1, target_component=0))
    bench.run()
    bench.answer(order(bench), ACCEPTED)
    bench.run()
    assert len(bench.hear("COMMAND_ACK")) == 1
    assert heard(bench, "COMMAND_ACK") == []


def test_a_long_command_tells_progress_and_can_be_cancelled() -> None:
    bench = Bench()
    panorama = int(PayloadCommand.PANORAMA_CREATE)
    bench.say(command_long(panorama, 360.0, target_component=CAMERA_ID))
    bench.run()
    command = order(bench)
    bench.answer(command, CommandResult.IN_PROGRESS, 25)
    bench.run()
    (ack,) = heard(bench, "COMMAND_ACK")
    assert (ack.result, ack.progress) == (CommandResult.IN_PROGRESS, 25)
    bench.say(CommandCancel(target_system=SYSTEM, target_component=CAMERA_ID, command=panorama))
    bench.run()
    (cancel,) = orders(bench)
    assert isinstance(cancel, CancelOrder)
    assert cancel.token == command.token


def test_a_picture_is_told_to_everybody_once_and_again_on_request() -> None:
    bench = Bench()
    for index in range(3):
        bench.topics.camera_event.publish(IMAGE._replace(image_index=index))
    bench.run(1_000_000)
    for peer in (GROUND, BROKER):
        told = heard(bench, "CAMERA_IMAGE_CAPTURED", at=peer)
        assert [m.image_index for m in told] == [0, 1, 2]
    (first, *_) = told
    assert (first.lat, first.lon, first.alt, first.relative_alt) == (
        405_000_000,
        -35_000_000,
        662_000,
        12_000,
    )
    assert first.q == [0.5] * 4
    assert first.time_utc == 1_700_000_005_000_000
    assert first.capture_result == 1
    assert first.file_url == ""
    again = ask(bench, REQUEST, 263, 1)
    assert result(again) == ACCEPTED
    assert [m.image_index for m in again if m.get_type() == "CAMERA_IMAGE_CAPTURED"] == [1]
    both = ask(bench, REQUEST, 263, 1, 2)
    assert [m.image_index for m in both if m.get_type() == "CAMERA_IMAGE_CAPTURED"] == [1, 2]
    assert result(ask(bench, REQUEST, 263, 7)) == CommandResult.FAILED
    assert result(ask(bench, REQUEST, 263, -1)) == DENIED
    assert result(ask(bench, REQUEST, 263, 2, 1)) == DENIED


def test_a_new_log_forgets_the_pictures() -> None:
    bench = Bench()
    bench.topics.camera_event.publish(IMAGE)
    bench.topics.camera_event.publish(CaptureLogReset(1))
    bench.run()
    assert result(ask(bench, REQUEST, 263, 0)) == CommandResult.FAILED


def test_an_unknown_place_can_be_told() -> None:
    bench = Bench()
    nowhere = IMAGE._replace(
        latitude_deg=math.nan,
        longitude_deg=math.nan,
        altitude_amsl_m=math.nan,
        relative_altitude_m=math.nan,
    )
    bench.topics.camera_event.publish(nowhere)
    bench.run()
    (told,) = heard(bench, "CAMERA_IMAGE_CAPTURED")
    assert (told.lat, told.lon) == (0, 0)


def test_a_change_of_status_is_told_at_once() -> None:
    bench = Bench()
    bench.run()
    bench.hear(component=CAMERA_ID)
    bench.topics.camera_status.publish(CAMERA._replace(image_count=4))
    bench.run()
    (status,) = heard(bench, "CAMERA_CAPTURE_STATUS")
    assert status.image_count == 4
    assert status.available_capacity == 750.0


def test_a_recording_is_reported_as_often_as_it_was_asked_for() -> None:
    bench = Bench()
    bench.topics.camera_status.publish(
        CAMERA._replace(recording_since_us=0, report_interval_us=500_000)
    )
    bench.run(5_000_000)
    told = heard(bench, "CAMERA_CAPTURE_STATUS")
    assert len(told) == pytest.approx(10, abs=2)
    assert told[-1].video_status == 1
    assert told[-1].recording_time_ms == pytest.approx(5000, abs=600)
    bench.topics.camera_status.publish(CAMERA)
    bench.run(100_000)
    bench.hear(component=CAMERA_ID)
    bench.run(5_000_000)
    assert heard(bench, "CAMERA_CAPTURE_STATUS") == []


def test_tracking_is_streamed_by_interval() -> None:
    bench = Bench()
    assert result(ask(bench, INTERVAL, 275, 200_000)) == ACCEPTED
    bench.run(5_000_000)
    told = heard(bench, "CAMERA_TRACKING_IMAGE_STATUS")
    assert len(told) == pytest.approx(25, abs=2)
    assert told[0].rec_top_x == pytest.approx(0.4)
    assert told[0].rec_bottom_y == pytest.approx(0.8)
    assert math.isnan(told[0].point_x)
    interval = ask(bench, 510, 275)
    (said,) = [m for m in interval if m.get_type() == "MESSAGE_INTERVAL"]
    assert said.interval_us == 200_000
    assert result(ask(bench, INTERVAL, 0, -1)) == DENIED  # a heartbeat is never off
