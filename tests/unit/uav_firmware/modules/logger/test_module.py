"""From before arming to after disarming, on a medium that may refuse."""

import contextlib
import io

import numpy as np
import pytest
from pyulog.px4 import PX4ULog  # type: ignore[import-untyped]  # pyulog tells no types

from tests.unit.uav_firmware.modules.logger.logbook import UTC_US, Logbook, MemoryStore
from uav_firmware.msg.status import HomePosition, StatusText
from uav_firmware.parameters import Registry


def test_nothing_is_written_before_arming() -> None:
    store = MemoryStore()
    Logbook(store).run(10.0)
    assert store.files == []


def test_the_log_holds_the_moment_before_arming_and_the_moment_after_disarming() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.run(10.2)
    armed_us = book.time_us
    book.fly(3.0)
    times = store.log().get_dataset("vehicle_attitude").data["timestamp"]
    assert armed_us - 2_000_000 <= times[0] <= armed_us - 1_000_000
    disarmed_us = armed_us + 3_000_000
    assert disarmed_us + 400_000 <= times[-1] <= disarmed_us + 1_100_000
    states = store.log().get_dataset("vehicle_status").data
    assert list(states["arming_state"]) == [2, 1]
    assert list(states["timestamp"]) == [armed_us, disarmed_us]


def test_the_shortest_flight_leaves_a_log_with_its_arming() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.run(10.1)
    book.fly(0.02)
    states = store.log().get_dataset("vehicle_status").data
    assert list(states["arming_state"]) == [2, 1]
    book.run(5.0)
    assert len(store.files) == 1


def test_no_record_is_missing_where_memory_meets_file() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.run(7.0)
    book.fly(5.0)
    times = store.log().get_dataset("vehicle_attitude").data["timestamp"]
    assert set(np.diff(times)) == {20_000}


def test_the_finished_log_is_brought_to_the_medium() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.fly(1.0)
    assert store.files[0].synced
    assert store.files[0].closed


def test_each_flight_has_a_file_named_after_its_time() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.run(5.0)
    book.fly(3.0)
    book.run(5.0)
    book.fly(3.0)
    assert len(store.files) == 2
    for number in range(2):
        began_us = store.log(number).start_timestamp
        assert store.times_utc_us[number] == UTC_US + began_us


def test_a_killed_vehicle_loses_less_than_a_second() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.set_armed(armed=True)
    book.run(7.3)
    assert not store.files[0].closed
    assert store.log().last_timestamp > book.time_us - 600_000


def test_switching_off_in_flight_loses_nothing() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.set_armed(armed=True)
    book.run(7.3)
    book.logger.close()
    assert store.files[0].closed
    assert store.log().last_timestamp > book.time_us - 20_000


def test_a_full_medium_ends_the_log_with_one_warning_and_a_readable_file() -> None:
    store = MemoryStore(room=20_000)
    book = Logbook(store)
    book.fly(30.0)
    assert book.warnings() == ["Flight log stopped: No space left on device"]
    assert len(store.files) == 1
    assert len(store.files[0].contents) == 20_000
    with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it thinks
        assert store.log().get_dataset("vehicle_attitude").data["timestamp"].size > 100


def test_a_medium_that_refuses_is_asked_again_for_the_next_flight() -> None:
    store = MemoryStore()
    store.broken = True
    book = Logbook(store)
    book.fly(5.0)
    assert book.warnings() == ["Flight log stopped: Read-only file system"]
    store.broken = False
    book.fly(5.0)
    assert book.warnings() == []
    assert store.files[0].closed


def test_the_room_that_is_left_is_told_and_what_was_refused() -> None:
    store = MemoryStore(room=20_000)
    book = Logbook(store)
    book.run(1.0)
    assert book.storage() == (20_000, False)
    book.set_armed(armed=True)
    book.run(30.0)
    assert book.storage() == (20_000, True)
    book.set_armed(armed=False)
    book.run(5.0)
    assert book.storage() == (20_000, False)  # The next flight tries again


def test_a_medium_that_does_not_even_tell_has_no_room() -> None:
    store = MemoryStore()
    store.broken = True
    book = Logbook(store)
    book.run(3.0)
    assert book.storage() == (0, False)


def test_a_log_that_grows_too_large_goes_on_in_the_next_file_without_a_gap() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.registry.set("SDLOG_MAX_SIZE", 1)
    book.registry.set("SDLOG_PROFILE", 17)
    book.run(5.0)
    book.fly(60.0)
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


def test_never_means_never() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.registry.set("SDLOG_MODE", -1)
    book.fly(3.0)
    assert store.files == []


def test_a_log_from_boot_begins_at_boot() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.registry.set("SDLOG_MODE", 2)
    book.run(10.0)
    assert store.log().get_dataset("vehicle_attitude").data["timestamp"][0] < 100_000


def test_without_a_medium_nothing_happens() -> None:
    book = Logbook(None)
    book.fly(3.0)
    book.logger.close()
    assert book.warnings() == []


def test_a_value_that_does_not_fit_costs_one_record_and_one_warning() -> None:
    store = MemoryStore()
    book = Logbook(store)
    nowhere = HomePosition(0, 0.0, 0.0, 1e300, (0.0, 0.0, 0.0), 0.0)
    book.topics.home_position.publish(nowhere)
    book.fly(5.0)
    assert book.warnings() == ["Not logged: home_position holds a value that does not fit"]
    names = {data.name for data in store.log().data_list}
    assert "home_position" not in names
    assert "vehicle_attitude" in names


def test_what_was_said_stands_in_the_log_with_its_time() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.run(3.0)
    book.topics.status_text.publish(StatusText(2_990_000, 4, "Wind is strong"))
    book.fly(2.0)
    (text,) = store.log().logged_messages
    assert (text.message, text.timestamp, text.log_level) == ("Wind is strong", 2_990_000, ord("4"))


def test_what_seldom_changes_is_in_every_log() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.topics.home_position.publish(HomePosition(0, 40.0, -3.0, 650.0, (0.0, 0.0, 0.0), 1.0))
    book.run(30.0)
    book.fly(5.0)
    home = store.log().get_dataset("home_position").data
    assert home["timestamp"][0] < 30_000_000
    assert set(home["lat"]) == {40.0}
    assert home["timestamp"][-1] - home["timestamp"][0] > 5_000_000


def test_parameters_are_logged_with_their_changes_in_flight() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.registry.set("SDLOG_MAX_SIZE", 32)
    book.set_armed(armed=True)
    book.run(3.0)
    book.registry.set("SDLOG_MAX_SIZE", 33)
    book.run(2.0)
    log = store.log()
    assert log.initial_parameters["SDLOG_MAX_SIZE"] == 32
    assert log.get_default_parameters(0) == {"SDLOG_MAX_SIZE": 64}
    ((time_us, name, value),) = log.changed_parameters
    assert (name, value) == ("SDLOG_MAX_SIZE", 33)
    assert 2_900_000 < time_us < 3_600_000


def test_the_log_presents_itself_as_px4s() -> None:
    store = MemoryStore()
    book = Logbook(store)
    book.fly(1.0)
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
    book = Logbook(store)
    book.registry.set("SDLOG_PROFILE", profile)
    book.run(5.0)
    book.fly(4.0)
    times = store.log().get_dataset("actuator_motors").data["timestamp"]
    assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(1e6 / rate_hz)


def test_the_parameters_are_px4s() -> None:
    book = Logbook(None)
    registry: Registry = book.registry
    assert registry.names() == ["SDLOG_MAX_SIZE", "SDLOG_MODE", "SDLOG_PROFILE"]
