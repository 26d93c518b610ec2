"""Log files from before arming to after disarming, with storage that may fail."""

import contextlib
import io

import numpy as np
import pytest
from pyulog.px4 import PX4ULog  # type: ignore[import-untyped]  # pyulog has no types

from tests.unit.uav_firmware.modules.logger.harness import UTC_US, LoggerHarness, MemoryStore
from uav_firmware.msg.status import HomePosition, StatusText
from uav_firmware.parameters import Registry


def test_nothing_is_written_before_arming() -> None:
    store = MemoryStore()
    LoggerHarness(store).run(10.0)
    assert store.files == []


def test_the_log_covers_the_time_just_before_arming_and_after_disarming() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.run(10.2)
    armed_us = harness.time_us
    harness.fly(3.0)
    times = store.log().get_dataset("vehicle_attitude").data["timestamp"]
    assert armed_us - 2_000_000 <= times[0] <= armed_us - 1_000_000
    disarmed_us = armed_us + 3_000_000
    assert disarmed_us + 400_000 <= times[-1] <= disarmed_us + 1_100_000
    states = store.log().get_dataset("vehicle_status").data
    assert list(states["arming_state"]) == [2, 1]
    assert list(states["timestamp"]) == [armed_us, disarmed_us]


def test_the_shortest_flight_is_logged_with_its_arming() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.run(10.1)
    harness.fly(0.02)
    states = store.log().get_dataset("vehicle_status").data
    assert list(states["arming_state"]) == [2, 1]
    harness.run(5.0)
    assert len(store.files) == 1


def test_no_record_is_missing_between_buffered_and_written_chunks() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.run(7.0)
    harness.fly(5.0)
    times = store.log().get_dataset("vehicle_attitude").data["timestamp"]
    assert set(np.diff(times)) == {20_000}


def test_a_finished_log_is_synced_to_storage() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.fly(1.0)
    assert store.files[0].synced
    assert store.files[0].closed


def test_each_flight_has_a_file_named_after_its_time() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.run(5.0)
    harness.fly(3.0)
    harness.run(5.0)
    harness.fly(3.0)
    assert len(store.files) == 2
    for number in range(2):
        began_us = store.log(number).start_timestamp
        assert store.times_utc_us[number] == UTC_US + began_us


def test_a_killed_process_loses_less_than_a_second() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.set_armed(armed=True)
    harness.run(7.3)
    assert not store.files[0].closed
    assert store.log().last_timestamp > harness.time_us - 600_000


def test_shutdown_in_flight_loses_nothing() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.set_armed(armed=True)
    harness.run(7.3)
    harness.logger.close()
    assert store.files[0].closed
    assert store.log().last_timestamp > harness.time_us - 20_000


def test_full_storage_ends_the_log_with_one_warning_and_a_readable_file() -> None:
    store = MemoryStore(room=20_000)
    harness = LoggerHarness(store)
    harness.fly(30.0)
    assert harness.warnings() == ["Flight log stopped: No space left on device"]
    assert len(store.files) == 1
    assert len(store.files[0].contents) == 20_000
    with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it thinks
        assert store.log().get_dataset("vehicle_attitude").data["timestamp"].size > 100


def test_failed_storage_is_retried_for_the_next_flight() -> None:
    store = MemoryStore()
    store.broken = True
    harness = LoggerHarness(store)
    harness.fly(5.0)
    assert harness.warnings() == ["Flight log stopped: Read-only file system"]
    store.broken = False
    harness.fly(5.0)
    assert harness.warnings() == []
    assert store.files[0].closed


def test_free_space_and_failures_are_published() -> None:
    store = MemoryStore(room=20_000)
    harness = LoggerHarness(store)
    harness.run(1.0)
    assert harness.storage() == (20_000, False)
    harness.set_armed(armed=True)
    harness.run(30.0)
    assert harness.storage() == (20_000, True)
    harness.set_armed(armed=False)
    harness.run(5.0)
    assert harness.storage() == (20_000, False)  # The next flight tries again


def test_unreadable_storage_counts_as_full() -> None:
    store = MemoryStore()
    store.broken = True
    harness = LoggerHarness(store)
    harness.run(3.0)
    assert harness.storage() == (0, False)


def test_a_log_at_its_size_limit_continues_in_a_new_file_without_a_gap() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.registry.set("SDLOG_MAX_SIZE", 1)
    harness.registry.set("SDLOG_PROFILE", 17)
    harness.run(5.0)
    harness.fly(60.0)
    assert len(store.files) > 1
    assert all(file.closed for file in store.files)
    assert all(len(file.contents) < 1_100_000 for file in store.files)
    times = np.concatenate(
        [
            store.log(number).get_dataset("vehicle_attitude").data["timestamp"]
            for number in range(len(store.files))
        ]
    )
    assert set(np.diff(times)) == {4_000}


def test_mode_minus_one_never_logs() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.registry.set("SDLOG_MODE", -1)
    harness.fly(3.0)
    assert store.files == []


def test_mode_1_logs_from_boot() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.registry.set("SDLOG_MODE", 2)
    harness.run(10.0)
    assert store.log().get_dataset("vehicle_attitude").data["timestamp"][0] < 100_000


def test_without_storage_nothing_is_logged() -> None:
    harness = LoggerHarness(None)
    harness.fly(3.0)
    harness.logger.close()
    assert harness.warnings() == []


def test_a_value_that_does_not_fit_drops_one_record_and_warns_once() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    nowhere = HomePosition(0, 0.0, 0.0, 1e300, (0.0, 0.0, 0.0), 0.0)
    harness.topics.home_position.publish(nowhere)
    harness.fly(5.0)
    assert harness.warnings() == ["Not logged: home_position holds a value that does not fit"]
    names = {data.name for data in store.log().data_list}
    assert "home_position" not in names
    assert "vehicle_attitude" in names


def test_status_texts_are_logged_with_their_time() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.run(3.0)
    harness.topics.status_text.publish(StatusText(2_990_000, 4, "Wind is strong"))
    harness.fly(2.0)
    (text,) = store.log().logged_messages
    assert (text.message, text.timestamp, text.log_level) == ("Wind is strong", 2_990_000, ord("4"))


def test_repeated_topics_are_in_every_log() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.topics.home_position.publish(HomePosition(0, 40.0, -3.0, 650.0, (0.0, 0.0, 0.0), 1.0))
    harness.run(30.0)
    harness.fly(5.0)
    home = store.log().get_dataset("home_position").data
    assert home["timestamp"][0] < 30_000_000
    assert set(home["lat"]) == {40.0}
    assert home["timestamp"][-1] - home["timestamp"][0] > 5_000_000


def test_parameters_are_logged_with_their_changes_in_flight() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.registry.set("SDLOG_MAX_SIZE", 32)
    harness.set_armed(armed=True)
    harness.run(3.0)
    harness.registry.set("SDLOG_MAX_SIZE", 33)
    harness.run(2.0)
    log = store.log()
    assert log.initial_parameters["SDLOG_MAX_SIZE"] == 32
    assert log.get_default_parameters(0) == {"SDLOG_MAX_SIZE": 64}
    ((time_us, name, value),) = log.changed_parameters
    assert (name, value) == ("SDLOG_MAX_SIZE", 33)
    assert 2_900_000 < time_us < 3_600_000


def test_the_log_identifies_as_px4() -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.fly(1.0)
    log = store.log()
    assert log.msg_info_dict["sys_name"] == "PX4"
    assert log.msg_info_dict["ver_sw"] == "1.16.0"
    assert log.get_version_info() == (1, 16, 0, 0)
    assert int(log.msg_info_dict["sys_uuid"], 16) == 5
    px4 = PX4ULog(log)
    assert px4.get_mav_type() == "Quadrotor"
    assert px4.get_estimator() == "EKF2"
    px4.add_roll_pitch_yaw()
    assert set(log.get_dataset("vehicle_attitude").data["roll"]) == {0.0}


@pytest.mark.parametrize(("profile", "rate_hz"), [(1, 25), (17, 250)])
def test_the_profile_chooses_the_rates(profile: int, rate_hz: int) -> None:
    store = MemoryStore()
    harness = LoggerHarness(store)
    harness.registry.set("SDLOG_PROFILE", profile)
    harness.run(5.0)
    harness.fly(4.0)
    times = store.log().get_dataset("actuator_motors").data["timestamp"]
    assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(1e6 / rate_hz)


def test_the_parameters_are_px4s() -> None:
    harness = LoggerHarness(None)
    registry: Registry = harness.registry
    assert registry.names() == ["SDLOG_MAX_SIZE", "SDLOG_MODE", "SDLOG_PROFILE"]
