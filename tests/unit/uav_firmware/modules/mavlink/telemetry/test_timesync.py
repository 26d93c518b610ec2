import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, SYSTEM, Bench
from uav_firmware.modules.mavlink.wire.dialect import mavlink


def test_a_request_is_answered_with_own_time_and_the_senders_echoed() -> None:
    bench = Bench()
    bench.run(1_000_000)
    (answer,) = bench.ask(mavlink.MAVLink_timesync_message(0, 123_456_789), "TIMESYNC")
    assert answer.tc1 == pytest.approx(bench.now_us * 1000, abs=20_000_000)
    assert answer.ts1 == 123_456_789
    assert all(message.tc1 == 0 for message in bench.hear("TIMESYNC", at=BROKER))


def test_an_answer_is_not_taken_for_a_request() -> None:
    assert Bench().ask(mavlink.MAVLink_timesync_message(5, 6), "TIMESYNC") == []


def test_a_ping_comes_back_to_its_sender() -> None:
    bench = Bench()
    bench.run()
    (answer,) = bench.ask(mavlink.MAVLink_ping_message(42, 9, 0, 0), "PING", system=200)
    assert (answer.time_usec, answer.seq) == (42, 9)
    assert (answer.target_system, answer.target_component) == (200, 190)


def test_a_ping_with_a_target_is_an_answer_and_gets_none() -> None:
    bench = Bench()
    bench.run()
    assert bench.ask(mavlink.MAVLink_ping_message(42, 9, SYSTEM, 1), "PING") == []


def test_the_time_of_a_ground_station_is_taken_without_an_answer() -> None:
    bench = Bench()
    bench.run(10_000)
    bench.hear()
    bench.say(mavlink.MAVLink_system_time_message(1_700_000_000_000_000, 5))
    bench.run(1_000_000)
    assert bench.hear("SYSTEM_TIME")[0].time_boot_ms < 2_000
