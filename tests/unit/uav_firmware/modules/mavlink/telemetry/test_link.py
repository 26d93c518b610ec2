import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, SYSTEM, MavlinkHarness
from uav_firmware.modules.mavlink.wire.dialect import mavlink


def test_a_request_is_answered_with_own_time_and_the_senders_echoed() -> None:
    harness = MavlinkHarness()
    harness.run(1_000_000)
    (answer,) = harness.request(mavlink.MAVLink_timesync_message(0, 123_456_789), "TIMESYNC")
    assert answer.tc1 == pytest.approx(harness.now_us * 1000, abs=20_000_000)
    assert answer.ts1 == 123_456_789
    assert all(message.tc1 == 0 for message in harness.received("TIMESYNC", at=BROKER))


def test_a_timesync_answer_is_not_answered() -> None:
    assert MavlinkHarness().request(mavlink.MAVLink_timesync_message(5, 6), "TIMESYNC") == []


def test_a_ping_request_is_answered() -> None:
    harness = MavlinkHarness()
    harness.run()
    (answer,) = harness.request(mavlink.MAVLink_ping_message(42, 9, 0, 0), "PING", system=200)
    assert (answer.time_usec, answer.seq) == (42, 9)
    assert (answer.target_system, answer.target_component) == (200, 190)


def test_a_ping_with_a_target_is_not_answered() -> None:
    harness = MavlinkHarness()
    harness.run()
    assert harness.request(mavlink.MAVLink_ping_message(42, 9, SYSTEM, 1), "PING") == []


def test_system_time_is_not_answered() -> None:
    harness = MavlinkHarness()
    harness.run(10_000)
    harness.received()
    harness.send(mavlink.MAVLink_system_time_message(1_700_000_000_000_000, 5))
    harness.run(1_000_000)
    assert harness.received("SYSTEM_TIME")[0].time_boot_ms < 2_000
