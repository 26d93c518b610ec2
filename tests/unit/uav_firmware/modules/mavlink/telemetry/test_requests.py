import itertools
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.cases import failures
from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    SYSTEM,
    MavlinkHarness,
    command_int,
    command_long,
    empty_topics,
)
from uav_firmware.modules.mavlink.telemetry.streams import STREAMS
from uav_firmware.modules.mavlink.wire.dialect import mavlink

ACCEPTED, NOT_YET, DENIED, UNSUPPORTED = 0, 1, 2, 3
REQUEST, SET_INTERVAL, GET_INTERVAL = 512, 511, 510
ATTITUDE, HOME, VERSION, MODES, MESSAGE_INTERVAL = 30, 242, 148, 435, 244
SECOND_US = 1_000_000


def requested(harness: MavlinkHarness, message: Any, **sender: Any) -> tuple[int, list[Any]]:
    """Result of the only answer, and the other messages."""
    harness.received()
    harness.send(message, **sender)
    harness.run()
    received = harness.received()
    (ack,) = [m for m in received if m.get_type() == "COMMAND_ACK"]
    return ack.result, [m for m in received if m.get_type() != "COMMAND_ACK"]


def check_request(command: Any, message_id: int) -> None:
    harness = MavlinkHarness()
    harness.run(SECOND_US)
    result, messages = requested(harness, command(REQUEST, message_id))
    assert result == ACCEPTED
    assert message_id in {type(m).id for m in messages}


@pytest.mark.thorough
def test_every_streamed_message_can_be_requested() -> None:
    message_ids = [stream.message_id for stream in STREAMS]
    cases = itertools.product([command_long, command_int], message_ids)
    assert failures(check_request, cases) == []


@pytest.mark.parametrize("request_of", [(REQUEST, VERSION), (520, 1), (520, 0)])
def test_autopilot_version_has_the_capabilities(request_of: tuple[int, int]) -> None:
    result, messages = requested(MavlinkHarness(), command_long(*request_of))
    (version,) = [m for m in messages if m.get_type() == "AUTOPILOT_VERSION"]
    assert result == ACCEPTED
    promised = {1, 2, 4, 8, 16, 32, 64, 128, 256, 2048, 8192, 16384, 32768, 262144}
    assert {1 << i for i in range(64) if version.capabilities >> i & 1} == promised
    assert version.flight_sw_version == 0x01100000
    assert version.uid == SYSTEM


def test_modes_are_listed_all_or_one_by_one() -> None:
    harness = MavlinkHarness()
    harness.run(SECOND_US)
    _, messages = requested(harness, command_long(REQUEST, MODES, 0))
    modes = [m for m in messages if m.get_type() == "AVAILABLE_MODES"]
    assert [m.mode_index for m in modes] == list(range(1, modes[0].number_modes + 1))
    assert {m.custom_mode for m in modes} == {
        0x02040000,
        0x03040000,
        0x04040000,
        0x05040000,
        0x06040000,
        0x00020000,
        0x00030000,
        0x00050000,
        0x00060000,
        0x00070000,
        0x01030000,
        0x08040000,
    }
    _, messages = requested(harness, command_long(REQUEST, MODES, 2))
    (one,) = [m for m in messages if m.get_type() == "AVAILABLE_MODES"]
    assert one.to_dict() == modes[1].to_dict()
    assert requested(harness, command_long(REQUEST, MODES, len(modes) + 1))[0] == DENIED


def test_get_home_position_returns_home() -> None:
    result, messages = requested(MavlinkHarness(), command_long(410))
    assert result == ACCEPTED
    assert "HOME_POSITION" in {m.get_type() for m in messages}
    assert (
        requested(MavlinkHarness(topics=empty_topics()), command_long(REQUEST, HOME))[0] == NOT_YET
    )


@pytest.mark.parametrize("message_id", [396, 395, 0xFFFFFF])
def test_unknown_messages_are_refused_at_once(message_id: int) -> None:
    assert requested(MavlinkHarness(), command_long(REQUEST, message_id))[0] == UNSUPPORTED
    assert (
        requested(MavlinkHarness(), command_long(SET_INTERVAL, message_id, 1e6))[0] == UNSUPPORTED
    )


@pytest.mark.parametrize("request_of", [(REQUEST, 300), (519, 1)])
def test_an_old_ground_station_gets_the_protocol_version(request_of: tuple[int, int]) -> None:
    result, messages = requested(MavlinkHarness(), command_long(*request_of))
    (version,) = [m for m in messages if m.get_type() == "PROTOCOL_VERSION"]
    assert result == ACCEPTED
    assert (version.min_version, version.version, version.max_version) == (100, 200, 200)
    assert version.spec_version_hash == [0] * 8


@pytest.mark.parametrize("number", [math.nan, -1.0, 30.5, 1e30, math.inf])
def test_invalid_message_ids_are_denied(number: float) -> None:
    for command in (REQUEST, SET_INTERVAL, GET_INTERVAL):
        assert requested(MavlinkHarness(), command_long(command, number))[0] == DENIED


@pytest.mark.parametrize("interval", [math.nan, -2.0, -0.5, math.inf, 2.0**31, 1e30])
def test_invalid_intervals_are_denied(interval: float) -> None:
    assert requested(MavlinkHarness(), command_long(SET_INTERVAL, ATTITUDE, interval))[0] == DENIED


def rate(harness: MavlinkHarness, name: str, at: Any = None) -> float:
    """Messages of a type in 10 s, as Hz."""
    harness.received()
    harness.received(at=BROKER)
    harness.run(10 * SECOND_US)
    return len(harness.received(name, at=at) if at else harness.received(name)) / 10


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("interval_us", "expected_hz"),
    [(20_000, 50.0), (1_000_000, 1.0), (-1, 0.0), (0, 15.0), (1, 250.0), (0.5, 250.0)],
)
def test_an_interval_holds_for_the_peer_that_asked(interval_us: float, expected_hz: float) -> None:
    harness = MavlinkHarness()
    harness.run(SECOND_US)
    assert requested(harness, command_long(SET_INTERVAL, ATTITUDE, interval_us))[0] == ACCEPTED
    assert rate(harness, "ATTITUDE") == pytest.approx(expected_hz, abs=0.2)
    assert rate(harness, "ATTITUDE", BROKER) == pytest.approx(100.0, abs=0.2)


@pytest.mark.parametrize(
    ("interval_us", "reported_us"),
    [(0.0, 66_667), (-1.0, -1), (1e-30, 4000), (0.5, 4000), (3999.0, 4000), (20_000.4, 20_000)],
)
def test_the_interval_that_holds_is_reported(interval_us: float, reported_us: int) -> None:
    """Only 0 is the default; a shorter one than the vehicle can send is limited."""
    harness = MavlinkHarness()
    assert requested(harness, command_long(SET_INTERVAL, ATTITUDE, interval_us))[0] == ACCEPTED
    _, messages = requested(harness, command_long(GET_INTERVAL, ATTITUDE))
    (interval,) = [m for m in messages if m.get_type() == "MESSAGE_INTERVAL"]
    assert interval.interval_us == reported_us


def test_an_interval_for_all_peers() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(SET_INTERVAL, ATTITUDE, 500_000, 0, 0, 0, 0, 2))
    harness.run()
    assert rate(harness, "ATTITUDE") == pytest.approx(2.0, abs=0.2)
    assert rate(harness, "ATTITUDE", BROKER) == pytest.approx(2.0, abs=0.2)


def test_the_truth_is_streamed_by_interval() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(SET_INTERVAL, 115, 66_667))
    assert rate(harness, "HIL_STATE_QUATERNION") == pytest.approx(15.0, abs=0.2)


@pytest.mark.parametrize("interval_us", [-1.0, 2e6, 2e9])
def test_the_heartbeat_cannot_be_disabled_or_slowed(interval_us: float) -> None:
    assert requested(MavlinkHarness(), command_long(SET_INTERVAL, 0, interval_us))[0] == DENIED


@pytest.mark.thorough
@given(st.floats(min_value=0.0, width=32, allow_infinity=False))
def test_every_accepted_interval_can_be_reported(interval_us: float) -> None:
    harness = MavlinkHarness()
    taken = requested(harness, command_long(SET_INTERVAL, ATTITUDE, interval_us))[0] == ACCEPTED
    result, messages = requested(harness, command_long(GET_INTERVAL, ATTITUDE))
    assert result == ACCEPTED
    assert "MESSAGE_INTERVAL" in {m.get_type() for m in messages}
    assert taken == (interval_us < 2**31)


@pytest.mark.parametrize("query", [(GET_INTERVAL,), (REQUEST, MESSAGE_INTERVAL)])
@pytest.mark.parametrize(
    ("message_id", "expected"), [(ATTITUDE, 66_667), (115, -1), (259, 0), (60_000, 0)]
)
def test_an_interval_can_be_requested(
    message_id: int, expected: int, query: tuple[int, ...]
) -> None:
    """QGroundControl's inspector asks by REQUEST_MESSAGE (MessageIntervalManager)."""
    result, messages = requested(MavlinkHarness(), command_long(*query, message_id))
    (interval,) = [m for m in messages if m.get_type() == "MESSAGE_INTERVAL"]
    assert result == ACCEPTED
    assert (interval.message_id, interval.interval_us) == (message_id, expected)


@pytest.mark.parametrize("message_id", [-1, 0.5, 65_536, math.nan])
def test_an_interval_of_no_message_is_denied(message_id: float) -> None:
    query = command_long(REQUEST, MESSAGE_INTERVAL, message_id)
    assert requested(MavlinkHarness(), query)[0] == DENIED


def test_a_request_to_every_system_is_answered() -> None:
    everybody = command_long(REQUEST, VERSION, target_system=0, target_component=0)
    result, messages = requested(MavlinkHarness(), everybody)
    assert result == ACCEPTED
    assert "AUTOPILOT_VERSION" in {m.get_type() for m in messages}


def test_a_response_can_be_sent_to_all_peers() -> None:
    harness = MavlinkHarness()
    harness.received(at=BROKER)
    harness.send(command_long(REQUEST, VERSION, 0, 0, 0, 0, 0, 2))
    harness.run()
    assert harness.received("AUTOPILOT_VERSION", at=BROKER)
    assert harness.received("COMMAND_ACK", at=BROKER) == []
    assert harness.received("AUTOPILOT_VERSION")


def test_request_data_stream_is_ignored() -> None:
    harness = MavlinkHarness()
    harness.send(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 4, 1))
    assert rate(harness, "ATTITUDE") == pytest.approx(15.0, abs=0.2)
