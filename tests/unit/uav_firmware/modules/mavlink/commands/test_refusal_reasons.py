"""What this module refuses by itself: whoever sent the command receives the reason, nobody else."""

import math
from random import Random
from typing import Any

import pytest

from tests.support.ground_station import whole_texts
from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    MavlinkHarness,
    command_long,
    empty_topics,
    status,
)
from uav_firmware.modules.mavlink.camera_component import OWN, SHARED
from uav_firmware.modules.mavlink.wire.dialect import mavlink

NAN = math.nan
REBOOT, STORAGE, SET_MODE, STANDARD_MODE, HOME = 246, 245, 176, 262, 410
GET_INTERVAL, SET_INTERVAL, REQUEST, VERSION, CAPABILITIES = 510, 511, 512, 519, 520
CAMERA_INFORMATION, STORAGE_INFORMATION, STREAM, LOG, ARM = 521, 525, 2504, 2510, 400
SECOND_US = 1_000_000


def replies(harness: MavlinkHarness, message: Any, component: int = 1) -> tuple[list[int], Any]:
    """Results and texts of what a command is answered with."""
    harness.received(component=component)
    harness.received(at=BROKER, component=component)
    harness.send(message)
    harness.run()
    received = harness.received(component=component)
    assert whole_texts(harness.received(at=BROKER, component=component)) == []
    results = [m.result for m in received if m.get_type() == "COMMAND_ACK"]
    return results, whole_texts(received)


@pytest.mark.parametrize(
    ("command", "result", "text"),
    [
        ((SET_MODE, 1, 4, 99), 2, "DO_SET_MODE denied: there is no mode 4/99"),
        ((STANDARD_MODE, 99), 4, "DO_SET_STANDARD_MODE failed: the vehicle has no standard mode"),
        ((STORAGE, 7), 2, "PREFLIGHT_STORAGE denied: parameter 1 is 7, no action"),
        ((STORAGE, 1, 5), 2, "PREFLIGHT_STORAGE denied: parameter 2 is 5"),
        ((STORAGE, 1), 1, "PREFLIGHT_STORAGE refused: the vehicle is armed"),
        ((REBOOT, 1), 1, "PREFLIGHT_REBOOT_SHUTDOWN refused: the vehicle is armed"),
        ((REBOOT, 1, 2), 2, "PREFLIGHT_REBOOT_SHUTDOWN denied: parameters 1 to 4"),
        ((HOME, 1), 2, "GET_HOME_POSITION denied: parameter 1 is set but has no effect"),
        ((GET_INTERVAL, NAN), 2, "GET_MESSAGE_INTERVAL denied: there is no message nan"),
        ((SET_INTERVAL, 30, -2), 2, "SET_MESSAGE_INTERVAL denied: -2 us is no interval"),
        ((SET_INTERVAL, 30, NAN), 2, "SET_MESSAGE_INTERVAL denied: nan us is no interval"),
        ((SET_INTERVAL, 30, math.inf), 2, "SET_MESSAGE_INTERVAL denied: inf us is no interval"),
        ((SET_INTERVAL, 0, 2e6), 2, "SET_MESSAGE_INTERVAL denied: a heartbeat is sent"),
        ((REQUEST, 30, 0, 0, 0, 0, 0, 9), 2, "REQUEST_MESSAGE denied: parameter 7 is 9"),
        ((REQUEST, 397, 0, 0, 0, 0, 0, 9), 2, "REQUEST_MESSAGE denied: parameter 7 is 9"),
        ((REQUEST, 435, 99), 2, "REQUEST_MESSAGE denied: parameter 2: there is no mode 99"),
        ((REQUEST, 244, 0.5), 2, "REQUEST_MESSAGE denied: there is no message 0.5"),
        ((VERSION, 1, 1), 2, "REQUEST_PROTOCOL_VERSION denied: parameter 2 is set"),
        ((CAPABILITIES, 1, 1), 2, "REQUEST_AUTOPILOT_CAPABILITIES denied: parameter 2 is set"),
        ((LOG, 1), 2, "LOGGING_START denied: parameter 1 is 1: only ULog (0) is streamed"),
    ],
)
def test_the_sender_receives_the_reason(command: tuple[float, ...], result: int, text: str) -> None:
    results, received = replies(MavlinkHarness(), command_long(int(command[0]), *command[1:]))
    assert results == [result]
    (only,) = received
    assert only.startswith(text)


@pytest.mark.parametrize(
    ("command", "result", "text"),
    [
        ((CAMERA_INFORMATION, 7), 2, "REQUEST_CAMERA_INFORMATION denied: 7 is not 1, a request"),
        ((STORAGE_INFORMATION, 7, 1), 2, "REQUEST_STORAGE_INFORMATION denied: parameter 1"),
        ((STREAM, 7), 2, "REQUEST_VIDEO_STREAM_INFORMATION denied: parameter 1"),
        ((REQUEST, 261, 7), 2, "REQUEST_MESSAGE denied: parameter 2: the camera has no number 7"),
        ((REQUEST, 263, -1), 2, "REQUEST_MESSAGE denied: parameter 2: there is no picture -1"),
        ((REQUEST, 263, 5, 2), 2, "REQUEST_MESSAGE denied: parameter 3: the last picture, 2"),
        ((REQUEST, 263, 5), 4, "REQUEST_MESSAGE failed: the camera has no record of picture 5"),
        ((SET_INTERVAL, NAN), 2, "SET_MESSAGE_INTERVAL denied: there is no message nan"),
    ],
)
def test_the_camera_gives_reasons_too(command: tuple[float, ...], result: int, text: str) -> None:
    message = command_long(int(command[0]), *command[1:], target_component=100)
    results, received = replies(MavlinkHarness(), message, component=100)
    assert results == [result]
    (only,) = received
    assert only.startswith(text)


@pytest.mark.parametrize("number", sorted(OWN | SHARED))
def test_the_camera_refuses_nothing_without_one_reason(number: int) -> None:
    name = mavlink.enums["MAV_CMD"][number].name.removeprefix("MAV_CMD_")
    random, harness = Random(number), MavlinkHarness()
    refusals = 0
    for _ in range(40):
        parameters = random.choices((NAN, math.inf, -math.inf, 0, 1, -1, 261, 263, 1e30), k=7)
        message = command_long(number, *parameters, target_component=100)
        (result,), received = replies(harness, message, component=100)
        refusals += result in {1, 2, 4}
        reasons = [text for text in received if text.startswith(f"{name} ")]
        assert len(reasons) == (result in {1, 2, 4}), message
    assert refusals


def test_a_message_without_contents_is_named() -> None:
    harness = MavlinkHarness(topics=empty_topics())
    assert replies(harness, command_long(REQUEST, 242)) == (
        [1],
        ["REQUEST_MESSAGE refused: message 242 has no contents yet"],
    )


@pytest.mark.parametrize(
    ("command", "severity"),
    [
        ((REQUEST, 435, 99), mavlink.MAV_SEVERITY_NOTICE),
        ((SET_INTERVAL, 30, -2), mavlink.MAV_SEVERITY_NOTICE),
        ((SET_MODE, 1, 4, 99), mavlink.MAV_SEVERITY_WARNING),
        ((STORAGE, 7), mavlink.MAV_SEVERITY_WARNING),
    ],
)
def test_only_an_order_that_is_refused_is_a_warning(
    command: tuple[float, ...], severity: int
) -> None:
    """Programs ask for messages that are not known yet, and pass warnings on to operators."""
    harness = MavlinkHarness()
    harness.send(command_long(int(command[0]), *command[1:]))
    harness.run()
    received = {text.severity for text in harness.received("STATUSTEXT")}
    assert received == {severity}


def test_an_answer_that_does_not_come_is_a_failure_with_a_reason() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(ARM, 1.0))
    harness.run(3 * SECOND_US)
    received = harness.received()
    assert [m.result for m in received if m.get_type() == "COMMAND_ACK"] == [4]
    assert whole_texts(received) == ["COMPONENT_ARM_DISARM failed: no answer in time"]


def test_too_many_commands_at_once_are_refused_with_a_reason() -> None:
    harness = MavlinkHarness()
    for number in range(80):
        harness.send(command_long(115, float(number)))
    harness.run()
    received = harness.received()
    results = [m.result for m in received if m.get_type() == "COMMAND_ACK"]
    assert results == [1] * len(whole_texts(received))
    text = "CONDITION_YAW refused: too many commands wait for their answers"
    assert set(whole_texts(received)) == {text}


def test_parameters_that_cannot_be_saved_are_a_reason() -> None:
    def fail() -> None:
        raise OSError(28, "No space left on device")

    harness = MavlinkHarness(save=fail)
    harness.topics.vehicle_status.publish(status())
    results, received = replies(harness, command_long(STORAGE, 1))
    assert results == [4]
    assert received == ["PREFLIGHT_STORAGE failed: No space left on device"]


def test_what_is_not_there_and_what_is_accepted_need_no_text() -> None:
    harness = MavlinkHarness()
    assert replies(harness, command_long(2600)) == ([3], [])
    assert replies(harness, command_long(REQUEST, 396)) == ([3], [])
    assert replies(harness, command_long(REQUEST, 30)) == ([0], [])


def test_a_repetition_has_its_answer_without_the_text_again() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(ARM, 1.0))
    harness.run(3 * SECOND_US)
    harness.received()
    again = replies(harness, command_long(ARM, 1.0, confirmation=1))
    assert again == ([mavlink.MAV_RESULT_FAILED], [])
