"""The camera component: identity, answers and reports of pictures."""

import math
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    CAMERA,
    GROUND,
    SYSTEM,
    MavlinkHarness,
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


def received(harness: MavlinkHarness, name: str, **where: Any) -> list[Any]:
    return harness.received(name, component=CAMERA_ID, **where)


def request(
    harness: MavlinkHarness, number: int, *parameters: float, target: int = CAMERA_ID
) -> list[Any]:
    """All messages of component 100 within two ticks after a command."""
    harness.received(component=CAMERA_ID)
    harness.send(command_long(number, *parameters, target_component=target))
    harness.run(40_000)
    return harness.received(component=CAMERA_ID)


def result(messages: list[Any]) -> int:
    (ack,) = [m for m in messages if m.get_type() == "COMMAND_ACK"]
    return int(ack.result)


def orders(harness: MavlinkHarness) -> list[PayloadOrder]:
    return harness.topics.payload_order.drain()


def order(harness: MavlinkHarness) -> VehicleCommand:
    (one,) = orders(harness)
    assert isinstance(one, VehicleCommand)
    return one


def test_the_camera_component_sends_heartbeats_at_1_hz() -> None:
    harness = MavlinkHarness()
    harness.run(10_000_000)
    for peer in (GROUND, BROKER):
        beats = received(harness, "HEARTBEAT", at=peer)
        assert 10 <= len(beats) <= 11
        assert {(m.type, m.autopilot) for m in beats} == {
            (mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID)
        }


def test_each_component_counts_its_own_frames() -> None:
    harness = MavlinkHarness()
    for _ in range(5):
        harness.send(command_long(REQUEST, 260, target_component=CAMERA_ID))
    harness.run(3_000_000)
    sent = [m for m in _everything(harness) if m.get_srcComponent() == CAMERA_ID]
    assert len(sent) > 10
    assert [m.get_seq() for m in sent] == list(range(len(sent)))


def _everything(harness: MavlinkHarness) -> list[Any]:
    from uav_firmware.modules.mavlink.wire.dialect import parse  # noqa: PLC0415 - only this reads raw

    return [m for data, to in harness.memory.sent if to == GROUND for m in parse(data).messages]


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
def test_a_requested_camera_message_has_one_answer(
    command: tuple[float, ...], name: str, target: int
) -> None:
    harness = MavlinkHarness()
    harness.run()
    messages = request(harness, int(command[0]), *command[1:], target=target)
    assert result(messages) == ACCEPTED
    assert len([m for m in messages if m.get_type() == name]) == 1
    assert harness.received("COMMAND_ACK") == []  # The autopilot does not answer


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
def test_unsupported_camera_messages_are_refused_at_once(
    command: tuple[float, ...], expected: int
) -> None:
    harness = MavlinkHarness()
    messages = request(harness, int(command[0]), *command[1:])
    assert result(messages) == expected
    assert orders(harness) == []
    assert harness.commands() == []


@pytest.mark.parametrize("command", [(REQUEST, 269), (2504, 0), (2504, 1)])
def test_the_live_view_is_reported_on_request(command: tuple[float, ...]) -> None:
    messages = request(MavlinkHarness(), int(command[0]), *command[1:])
    assert result(messages) == ACCEPTED
    (reported,) = [m for m in messages if m.get_type() == "VIDEO_STREAM_INFORMATION"]
    assert reported.uri == "http://127.0.0.1:14581/stream"
    assert (reported.stream_id, reported.count) == (1, 1)
    assert (reported.resolution_h, reported.resolution_v) == (480, 360)
    assert reported.flags & mavlink.VIDEO_STREAM_STATUS_FLAGS_RUNNING


def test_camera_messages_are_not_sent_by_the_autopilot() -> None:
    harness = MavlinkHarness()
    (ack,) = harness.request(command_long(REQUEST, 259), "COMMAND_ACK")
    assert ack.result == UNSUPPORTED


@pytest.mark.parametrize("target", [1, CAMERA_ID])
@pytest.mark.parametrize("form", [command_long, command_int])
def test_a_command_is_answered_once_by_the_addressed_component(target: int, form: Any) -> None:
    harness = MavlinkHarness()
    harness.send(form(int(START), 0, 2.0, 3, target_component=target))
    harness.run()
    command = order(harness)
    assert (command.command, command.param2, command.param3) == (START, 2.0, 3.0)
    assert (command.source_system, command.source_component) == (255, 190)
    harness.answer(command, ACCEPTED)
    harness.run()
    answers = [len(harness.received("COMMAND_ACK", component=c)) for c in (1, CAMERA_ID)]
    assert answers == ([1, 0] if target == 1 else [0, 1])
    assert harness.commands() == []


def test_a_command_to_all_components_is_executed_once() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(int(START), 0, 0, 1, target_component=0))
    harness.run()
    harness.answer(order(harness), ACCEPTED)
    harness.run()
    assert len(harness.received("COMMAND_ACK")) == 1
    assert received(harness, "COMMAND_ACK") == []


def test_a_long_command_reports_progress_and_can_be_cancelled() -> None:
    harness = MavlinkHarness()
    panorama = int(PayloadCommand.PANORAMA_CREATE)
    harness.send(command_long(panorama, 360.0, target_component=CAMERA_ID))
    harness.run()
    command = order(harness)
    harness.answer(command, CommandResult.IN_PROGRESS, 25)
    harness.run()
    (ack,) = received(harness, "COMMAND_ACK")
    assert (ack.result, ack.progress) == (CommandResult.IN_PROGRESS, 25)
    harness.send(CommandCancel(target_system=SYSTEM, target_component=CAMERA_ID, command=panorama))
    harness.run()
    (cancel,) = orders(harness)
    assert isinstance(cancel, CancelOrder)
    assert cancel.token == command.token


def test_a_picture_is_reported_to_all_peers_once_and_again_on_request() -> None:
    harness = MavlinkHarness()
    for index in range(3):
        harness.topics.camera_event.publish(IMAGE._replace(image_index=index))
    harness.run(1_000_000)
    for peer in (GROUND, BROKER):
        reported = received(harness, "CAMERA_IMAGE_CAPTURED", at=peer)
        assert [m.image_index for m in reported] == [0, 1, 2]
    (first, *_) = reported
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
    again = request(harness, REQUEST, 263, 1)
    assert result(again) == ACCEPTED
    assert [m.image_index for m in again if m.get_type() == "CAMERA_IMAGE_CAPTURED"] == [1]
    both = request(harness, REQUEST, 263, 1, 2)
    assert [m.image_index for m in both if m.get_type() == "CAMERA_IMAGE_CAPTURED"] == [1, 2]
    assert result(request(harness, REQUEST, 263, 7)) == CommandResult.FAILED
    assert result(request(harness, REQUEST, 263, -1)) == DENIED
    assert result(request(harness, REQUEST, 263, 2, 1)) == DENIED


def test_a_reset_capture_log_clears_the_stored_pictures() -> None:
    harness = MavlinkHarness()
    harness.topics.camera_event.publish(IMAGE)
    harness.topics.camera_event.publish(CaptureLogReset(1))
    harness.run()
    assert result(request(harness, REQUEST, 263, 0)) == CommandResult.FAILED


def test_a_picture_without_a_position() -> None:
    harness = MavlinkHarness()
    nowhere = IMAGE._replace(
        latitude_deg=math.nan,
        longitude_deg=math.nan,
        altitude_amsl_m=math.nan,
        relative_altitude_m=math.nan,
    )
    harness.topics.camera_event.publish(nowhere)
    harness.run()
    (reported,) = received(harness, "CAMERA_IMAGE_CAPTURED")
    assert (reported.lat, reported.lon) == (0, 0)


def test_a_change_of_status_is_sent_at_once() -> None:
    harness = MavlinkHarness()
    harness.run()
    harness.received(component=CAMERA_ID)
    harness.topics.camera_status.publish(CAMERA._replace(image_count=4))
    harness.run()
    (status,) = received(harness, "CAMERA_CAPTURE_STATUS")
    assert status.image_count == 4
    assert status.available_capacity == 750.0


def test_a_recording_is_reported_at_the_requested_rate() -> None:
    harness = MavlinkHarness()
    harness.topics.camera_status.publish(
        CAMERA._replace(recording_since_us=0, report_interval_us=500_000)
    )
    harness.run(5_000_000)
    reported = received(harness, "CAMERA_CAPTURE_STATUS")
    assert len(reported) == pytest.approx(10, abs=2)
    assert reported[-1].video_status == 1
    assert reported[-1].recording_time_ms == pytest.approx(5000, abs=600)
    harness.topics.camera_status.publish(CAMERA)
    harness.run(100_000)
    harness.received(component=CAMERA_ID)
    harness.run(5_000_000)
    assert received(harness, "CAMERA_CAPTURE_STATUS") == []


def test_tracking_is_streamed_by_interval() -> None:
    harness = MavlinkHarness()
    assert result(request(harness, INTERVAL, 275, 200_000)) == ACCEPTED
    harness.run(5_000_000)
    reported = received(harness, "CAMERA_TRACKING_IMAGE_STATUS")
    assert len(reported) == pytest.approx(25, abs=2)
    assert reported[0].rec_top_x == pytest.approx(0.4)
    assert reported[0].rec_bottom_y == pytest.approx(0.8)
    assert math.isnan(reported[0].point_x)
    for query in ((510, 275), (512, 244, 275)):
        interval = request(harness, *query)
        (interval_message,) = [m for m in interval if m.get_type() == "MESSAGE_INTERVAL"]
        assert (interval_message.message_id, interval_message.interval_us) == (275, 200_000)
    assert result(request(harness, 512, 244, 30)) == UNSUPPORTED  # ATTITUDE is the autopilot's
    assert result(request(harness, INTERVAL, 0, -1)) == DENIED  # A heartbeat cannot be disabled


SECOND_ID = 101
SECOND_CAMERA = CAMERA._replace(has_second=True, second_count=2)


def with_second_camera() -> MavlinkHarness:
    harness = MavlinkHarness()
    harness.topics.camera_status.publish(SECOND_CAMERA)
    harness.run(1_000_000)  # The change is reported
    return harness


def second(harness: MavlinkHarness, *parameters: float) -> list[Any]:
    """All messages of component 101 after a request to it."""
    harness.received(component=SECOND_ID)
    harness.send(command_long(REQUEST, *parameters, target_component=SECOND_ID))
    harness.run(40_000)
    return harness.received(component=SECOND_ID)


def test_a_second_camera_is_there_while_second_pictures_are_stored() -> None:
    harness = MavlinkHarness()
    harness.run(5_000_000)
    assert harness.received(component=SECOND_ID) == []
    assert second(harness, 262) == []
    harness.topics.camera_status.publish(SECOND_CAMERA)
    harness.run(5_000_000)
    messages = harness.received(component=SECOND_ID)
    beats = [message for message in messages if message.get_type() == "HEARTBEAT"]
    assert 4 <= len(beats) <= 6
    assert {message.type for message in beats} == {mavlink.MAV_TYPE_CAMERA}
    harness.topics.camera_status.publish(CAMERA)
    harness.run(2_000_000)
    harness.received(component=SECOND_ID)
    harness.run(5_000_000)
    assert harness.received(component=SECOND_ID) == []


@pytest.mark.parametrize(
    ("number", "name"),
    [
        (259, "CAMERA_INFORMATION"),
        (260, "CAMERA_SETTINGS"),
        (261, "STORAGE_INFORMATION"),
        (262, "CAMERA_CAPTURE_STATUS"),
    ],
)
def test_the_second_camera_answers_for_itself(number: int, name: str) -> None:
    answers = second(with_second_camera(), number)
    assert result(answers) == ACCEPTED
    (message,) = [one for one in answers if one.get_type() == name]
    if name == "CAMERA_CAPTURE_STATUS":
        assert message.image_count == 2
    if name == "CAMERA_INFORMATION":
        assert message.flags == mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE


def test_the_second_camera_has_no_shutter_of_its_own() -> None:
    harness = with_second_camera()
    harness.send(command_long(START, 0, 0, 1, target_component=SECOND_ID))
    harness.run(40_000)
    assert result(harness.received(component=SECOND_ID)) == UNSUPPORTED
    assert orders(harness) == []


def test_second_pictures_are_reported_by_the_second_camera_with_numbers_of_their_own() -> None:
    harness = with_second_camera()
    one = IMAGE._replace(image_index=4, file_url="mftp://4.jpg")
    harness.topics.camera_event.publish(one)
    other = one._replace(image_index=5, second_index=0, second_file_url="mftp://ndvi/5.jpg")
    harness.topics.camera_event.publish(other)
    harness.run(1_000_000)
    first = received(harness, "CAMERA_IMAGE_CAPTURED")
    assert [message.image_index for message in first] == [4, 5]
    (message,) = harness.received("CAMERA_IMAGE_CAPTURED", component=SECOND_ID)
    assert (message.image_index, message.file_url) == (0, "mftp://ndvi/5.jpg")
    assert (message.time_utc, message.lat) == (first[1].time_utc, first[1].lat)
    again = second(harness, 263, 0)
    assert result(again) == ACCEPTED
    assert [one.file_url for one in again if one.get_type() != "COMMAND_ACK"] == [message.file_url]
    assert result(second(harness, 263, 4)) == CommandResult.FAILED
    harness.topics.camera_event.publish(CaptureLogReset(1))
    harness.run()
    assert result(second(harness, 263, 0)) == CommandResult.FAILED
