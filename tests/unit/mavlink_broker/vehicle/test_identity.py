"""A vehicle that was away shows that it is the same: by its clock, or by its number."""

from collections.abc import Sequence

import pytest

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.unit.mavlink_broker.microservices.harness import received

AWAY_S = 20.0


def version(uid: int, long_uid: Sequence[int] = ()) -> Message:
    numbers = uid, [*long_uid, *[0] * (18 - len(long_uid))]
    message = mavlink.MAVLink_autopilot_version_message(
        0, 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, *numbers
    )
    return received(message)


def heartbeat(base_mode: int = 81) -> Message:
    return received(mavlink.MAVLink_heartbeat_message(2, 12, base_mode, 0, 4, 3))


def clock(boot_ms: int) -> Message:
    return received(mavlink.MAVLink_global_position_int_message(boot_ms, *[0] * 8))


def known(*, has_clock: bool) -> Vehicle:
    """A vehicle whose number is known at 1 s."""
    vehicle = Vehicle(1, Route(254, 191, 1, 1))
    for now in (0.0, 0.5, 1.0):
        vehicle.take(heartbeat(), now)
        if has_clock:
            vehicle.take(clock(30_000 + round(now * 1e3)), now)
    vehicle.take(version(6), 1.0)
    assert vehicle.is_identified
    return vehicle


def test_without_a_clock_its_number_is_asked_for_again() -> None:
    vehicle = known(has_clock=False)
    vehicle.take(heartbeat(), 1.0 + AWAY_S)
    assert not vehicle.is_identified
    assert not vehicle.may_be_restarted(1.0 + AWAY_S)


def test_with_a_clock_that_has_to_go_on() -> None:
    vehicle = known(has_clock=True)
    vehicle.take(heartbeat(), 1.0 + AWAY_S)
    assert vehicle.is_identified
    assert vehicle.may_be_restarted(1.0 + AWAY_S)
    vehicle.take(clock(51_000), 1.0 + AWAY_S)
    assert not vehicle.may_be_restarted(1.0 + AWAY_S)


def test_another_number_shows_a_swap_unless_the_vehicle_is_armed() -> None:
    vehicle = known(has_clock=False)
    assert vehicle.is_swapped_for(version(7))
    assert not vehicle.is_swapped_for(version(6))
    assert not vehicle.is_swapped_for(version(0))
    vehicle.take(heartbeat(81 | mavlink.MAV_MODE_FLAG_SAFETY_ARMED), 1.5)
    assert not vehicle.is_swapped_for(version(7))


@pytest.mark.parametrize("boot_ms", [31_000, 31_000 + 18_500, 31_000 + 21_500, 95_000])
def test_a_clock_that_does_not_go_on_as_before_may_be_another_vehicles(boot_ms: int) -> None:
    vehicle, now = known(has_clock=True), 1.0 + AWAY_S
    vehicle.take(heartbeat(), now)
    vehicle.take(clock(boot_ms), now)
    assert not vehicle.is_identified
    assert vehicle.may_be_restarted(now + 10.0)
    vehicle.take(version(6), now + 10.0)
    assert not vehicle.may_be_restarted(now + 10.0)


@pytest.mark.parametrize("ahead_ms", [8000, 60_000])
def test_a_clock_far_ahead_may_be_another_vehicles_also_without_a_silence(ahead_ms: int) -> None:
    vehicle = known(has_clock=True)
    vehicle.take(clock(31_200 + ahead_ms), 1.2)
    assert not vehicle.is_identified
    assert vehicle.may_be_restarted(1.2)


def test_frames_that_a_radio_has_delayed_by_seconds_are_of_the_same_vehicle() -> None:
    vehicle = known(has_clock=True)
    vehicle.take(clock(31_200), 1.2)
    for now, boot_ms in ((2.2, 29_500), (2.3, 32_300), (2.4, 34_900)):
        vehicle.take(clock(boot_ms), now)
    assert vehicle.is_identified


def test_a_clock_that_wraps_goes_on() -> None:
    vehicle = Vehicle(1, Route(254, 191, 1, 1))
    for step in range(200):
        now = step * 0.5
        vehicle.take(heartbeat(), now)
        if step == 0:
            vehicle.take(version(6), now)
        vehicle.take(clock(((1 << 32) - 40_000 + round(now * 1e3)) % (1 << 32)), now)
        assert vehicle.is_identified
        assert not vehicle.may_be_restarted(now)


def test_after_a_jump_the_clock_is_followed_anew() -> None:
    vehicle = known(has_clock=True)
    vehicle.take(heartbeat(), 6.0)
    vehicle.take(clock(30_000 + 60_000 + 6_000), 6.0)
    assert not vehicle.is_identified
    vehicle.take(version(6), 6.5)
    for step in range(100):
        now = 8.0 + 2.0 * step
        vehicle.take(heartbeat(), now)
        vehicle.take(clock(30_000 + 60_000 + round(now * 1e3)), now)
        assert vehicle.is_identified, now


def test_one_that_sends_no_number_is_taken_for_the_same_once_it_answers() -> None:
    vehicle, now = known(has_clock=True), 1.0 + AWAY_S
    vehicle.take(clock(95_000), now)
    vehicle.identify(has_answered=False)
    assert vehicle.may_be_restarted(now + 10.0)
    vehicle.identify(has_answered=True)
    assert not vehicle.may_be_restarted(now + 10.0)


def test_one_in_the_air_is_ordered_whatever_its_clock_shows() -> None:
    vehicle, now = known(has_clock=True), 1.0 + AWAY_S
    vehicle.take(heartbeat(81 | mavlink.MAV_MODE_FLAG_SAFETY_ARMED), now)
    vehicle.take(clock(95_000), now)
    assert not vehicle.may_be_restarted(now)


@pytest.mark.parametrize("rate", [0.2, 1.0, 8.0])
def test_a_simulated_clock_goes_on_at_its_own_rate(rate: float) -> None:
    vehicle = Vehicle(1, Route(254, 191, 1, 1))
    for now in (0.0, 1.0, 2.0, 2.0 + AWAY_S):
        vehicle.take(heartbeat(), now)
        vehicle.take(clock(30_000 + round(now * rate * 1e3)), now)
        if now < AWAY_S:
            vehicle.take(version(6), now)
    assert vehicle.is_identified
    assert not vehicle.may_be_restarted(2.0 + AWAY_S)


def test_long_numbers_are_compared_whatever_zeros_they_end_with() -> None:
    vehicle = known(has_clock=False)
    assert not vehicle.is_swapped_for(version(6, [1]))
    vehicle.take(version(6, [1]), 1.5)
    assert vehicle.is_swapped_for(version(6, [1, 80]))
    assert not vehicle.is_swapped_for(version(6, [1, 0]))
    assert not vehicle.is_swapped_for(version(7))
