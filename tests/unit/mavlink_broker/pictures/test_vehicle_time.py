"""The time of pictures: the vehicle's clock, whatever the broker's own one shows."""

import itertools
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import Route, mavlink
from mavlink_broker.pictures.vehicle_time import (
    PROVED_WITHIN_S,
    REAL_RATE_WITHIN,
    RECENT_S,
    CameraClocks,
    VehicleTime,
)
from mavlink_broker.vehicle.vehicle import Vehicle

UP_S = 100_000.0
"""The broker's clock: its computer runs for longer than the vehicle."""


class ClockedVehicle:
    """A vehicle that sends its clock."""

    def __init__(self) -> None:
        self.vehicle = Vehicle(1, Route(254, 191, 1, 1))
        self.time = VehicleTime(self.vehicle)

    def send(self, since_boot_s: float, now: float) -> float:
        """Send the clock; gives how far earlier times are to be shifted."""
        boot_ms = round(since_boot_s * 1e3)
        message = mavlink.MAVLink_global_position_int_message(boot_ms, *[0] * 8)
        self.vehicle.snapshot.take(message)
        return self.time.update(now)


def test_what_was_noted_by_the_brokers_clock_is_shifted_to_that_of_the_vehicle() -> None:
    one = ClockedVehicle()
    noted_s = one.time.at(UP_S)
    shift_s = one.send(52.0, UP_S + 2.0)
    assert noted_s + shift_s == pytest.approx(50.0)
    assert one.time.at(UP_S + 2.0) == pytest.approx(52.0)
    assert one.send(53.0, UP_S + 3.0) == 0.0


def test_the_time_goes_on_between_two_messages() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    assert one.time.at(UP_S + 1.5) == pytest.approx(53.5)
    assert one.time.received_s == pytest.approx(52.0)


def test_nothing_is_taken_in_the_future() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    assert one.time.of(54.0, None, UP_S + 1.0) == pytest.approx(53.0)
    assert one.time.of(51.0, None, UP_S + 1.0) == pytest.approx(51.0)


def test_a_restart_goes_on_behind_what_was_before() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    before_s = one.time.of(51.0, None, UP_S)
    one.time.at(UP_S)
    one.time.restarted()
    one.send(3.0, UP_S + 30.0)
    assert one.time.at(UP_S + 30.0) > before_s + RECENT_S
    assert one.time.of(51.0, None, UP_S + 30.0) == pytest.approx(before_s)


def test_a_clock_that_goes_back_is_not_believed_before_a_restart_is_proved() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    one.send(3.0, UP_S + 1.0)
    assert one.time.is_doubtful
    assert one.time.at(UP_S + 1.0) == pytest.approx(53.0)
    one.time.restarted()
    assert not one.time.is_doubtful


@pytest.mark.parametrize("is_proved_late", [False, True])
def test_a_clock_that_stays_back_is_that_of_a_restart(*, is_proved_late: bool) -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    before_s = one.time.at(UP_S)
    one.send(3.0, UP_S + 1.0)
    one.send(3.0 + PROVED_WITHIN_S, UP_S + 1.0 + PROVED_WITHIN_S)
    assert not one.time.is_doubtful
    if is_proved_late:
        one.time.restarted()
        one.send(5.0 + PROVED_WITHIN_S, UP_S + 3.0 + PROVED_WITHIN_S)
    assert one.time.at(UP_S + 3.0 + PROVED_WITHIN_S) > before_s + RECENT_S
    assert one.time.of(51.0, None, UP_S + 3.0 + PROVED_WITHIN_S) == pytest.approx(before_s - 1.0)


def test_a_restart_behind_one_that_was_assumed_is_another() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    one.send(3.0, UP_S + 1.0)
    one.send(3.0 + PROVED_WITHIN_S, UP_S + 1.0 + PROVED_WITHIN_S)
    before_s = one.time.at(UP_S + 20.0)
    one.send(0.5, UP_S + 21.0)
    one.time.restarted()
    one.send(1.5, UP_S + 22.0)
    assert one.time.at(UP_S + 22.0) > before_s + RECENT_S


def test_a_picture_of_before_a_restart_that_only_an_earlier_run_has_seen_is_older() -> None:
    """Its time since boot lies ahead of the vehicle's clock, which the camera shares."""
    one = ClockedVehicle()
    one.send(16.0, UP_S)
    assert one.time.of(29.0, None, UP_S, is_same_clock=True) < 0.0
    assert one.time.of(29.0, None, UP_S) == pytest.approx(16.0)


def test_everything_is_recent_until_the_clock_is_known() -> None:
    one = ClockedVehicle()
    assert one.time.is_recent(40.0, UP_S)
    one.send(RECENT_S + 60.0, UP_S)
    assert not one.time.is_recent(40.0, UP_S)
    assert one.time.is_recent(80.0, UP_S)


def test_what_the_vehicles_clock_dates_has_a_time_of_the_brokers() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    one.send(62.0, UP_S + 10.0)
    expected = {40.0: UP_S - 12.0, 55.0: UP_S + 3.0, 62.5: UP_S + 10.5}
    found = {time_s: one.time.broker_time(time_s, UP_S + 11.0) for time_s in expected}
    assert found == pytest.approx(expected)


@given(
    speed=st.floats(0.2, 20.0),
    seconds=st.lists(st.floats(1.0, 60.0), min_size=2, max_size=20),
    share=st.floats(-0.5, 1.0),
)
def test_a_simulated_vehicles_clock_runs_at_its_speed(
    speed: float, seconds: list[float], share: float
) -> None:
    """Also before a restarted broker has received it, unless its rate may be a real one's."""
    assume(share >= 0.0 or abs(speed - 1.0) >= REAL_RATE_WITHIN + 0.01)
    one = ClockedVehicle()
    nows = [UP_S + after for after in itertools.accumulate(seconds)]
    for now in nows:
        one.send(10.0 + speed * (now - UP_S), now)
    at = nows[0] + share * (nows[-1] - nows[0])
    taken_s = 10.0 + speed * (at - UP_S)
    assert one.time.broker_time(taken_s, nows[-1]) == pytest.approx(at, abs=0.05)


def test_messages_that_come_unevenly_do_not_make_a_clock_fast() -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    one.send(54.0, UP_S + 1.9)
    assert one.time.broker_time(0.0, UP_S + 2.0) == pytest.approx(UP_S - 52.0)


@pytest.mark.parametrize("time_s", [54.0, 52.0 - RECENT_S - 2.0, -math.inf])
def test_what_a_clock_cannot_have_measured_is_of_now(time_s: float) -> None:
    one = ClockedVehicle()
    one.send(52.0, UP_S)
    assert one.time.broker_time(time_s, UP_S + 1.0) == UP_S + 1.0


def test_nothing_is_dated_before_the_vehicle_has_sent_its_clock() -> None:
    assert ClockedVehicle().time.broker_time(UP_S - 20.0, UP_S) == UP_S


def test_what_was_before_a_restart_is_dated_by_the_clock_before_it() -> None:
    one = ClockedVehicle()
    one.send(42.0, UP_S - 10.0)
    one.send(52.0, UP_S)
    one.time.restarted()
    one.send(3.0, UP_S + 63.0)
    before_s = one.time.of(51.0, None, UP_S + 63.0)
    assert one.time.broker_time(before_s, UP_S + 63.0) == pytest.approx(UP_S - 1.0)


def test_what_was_after_a_restart_that_nobody_has_seen_is_dated_by_the_clock_behind_it() -> None:
    one = ClockedVehicle()
    one.send(600.0, UP_S)
    one.time.restarted()
    one.send(300.0, UP_S + 400.0)
    taken_s = one.time.of(200.0, None, UP_S + 400.0)
    assert one.time.broker_time(taken_s, UP_S + 400.0) == pytest.approx(UP_S + 300.0)


CAMERA = 100


def test_a_camera_with_a_clock_of_its_own_is_believed_at_once() -> None:
    one, clocks = ClockedVehicle(), CameraClocks()
    one.send(52.0, UP_S)
    assert clocks.take(CAMERA, 12.0, one.time, UP_S)
    assert clocks.lag_s(CAMERA) == pytest.approx(40.0)
    assert not clocks.is_doubtful(CAMERA, UP_S)


def test_a_camera_that_shows_a_restart_before_its_vehicle_does_is_not_believed() -> None:
    one, clocks = ClockedVehicle(), CameraClocks()
    one.send(52.0, UP_S)
    assert clocks.take(CAMERA, 52.0, one.time, UP_S)
    assert not clocks.take(CAMERA, 4.0, one.time, UP_S + 6.0)
    assert clocks.is_doubtful(CAMERA, UP_S + 6.0)
    clocks.clear()  # The vehicle has shown its restart
    one.time.restarted()
    one.send(5.0, UP_S + 7.0)
    assert clocks.take(CAMERA, 5.0, one.time, UP_S + 7.0)
    assert clocks.lag_s(CAMERA) == pytest.approx(0.0)


def test_a_camera_that_is_received_before_its_vehicle_is_not_believed_for_a_while() -> None:
    one, clocks = ClockedVehicle(), CameraClocks()
    assert not clocks.take(CAMERA, None, one.time, UP_S)
    assert clocks.is_doubtful(CAMERA, UP_S + 1.0)
    one.send(13.0, UP_S + 2.0)
    assert clocks.take(CAMERA, 13.0, one.time, UP_S + 2.0)
    assert clocks.lag_s(CAMERA) == pytest.approx(0.0)


def test_a_camera_whose_vehicle_never_sends_its_clock_is_believed_in_the_end() -> None:
    one, clocks = ClockedVehicle(), CameraClocks()
    assert not clocks.take(CAMERA, None, one.time, UP_S)
    assert clocks.take(CAMERA, None, one.time, UP_S + PROVED_WITHIN_S)
    assert not clocks.is_doubtful(CAMERA, UP_S + PROVED_WITHIN_S)


def test_a_camera_that_alone_was_restarted_is_believed_after_a_while() -> None:
    one, clocks = ClockedVehicle(), CameraClocks()
    one.send(52.0, UP_S)
    assert clocks.take(CAMERA, 52.0, one.time, UP_S)
    assert not clocks.take(CAMERA, 1.0, one.time, UP_S + 5.0)
    later = UP_S + 5.0 + PROVED_WITHIN_S
    assert not clocks.is_doubtful(CAMERA, later)
    assert clocks.take(CAMERA, 1.0 + PROVED_WITHIN_S, one.time, later)
    assert clocks.lag_s(CAMERA) == pytest.approx(56.0)
