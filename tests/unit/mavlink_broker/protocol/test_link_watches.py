"""Heartbeats, restarts and round trips."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.dialect import mavlink
from mavlink_broker.protocol.heartbeat import (
    NOT_VEHICLES,
    LinkState,
    LinkWatch,
    OwnHeartbeat,
    is_vehicle,
)
from mavlink_broker.protocol.reboot import RebootWatch
from mavlink_broker.protocol.round_trip import (
    FIRST_TIMEOUT_S,
    LONGEST_TIMEOUT_S,
    SHORTEST_TIMEOUT_S,
    RoundTrip,
)
from tests.unit.mavlink_broker.protocol.harness import tick_until


def test_our_heartbeat_comes_once_a_second_and_is_no_ground_stations() -> None:
    sent = tick_until(OwnHeartbeat(), 0.0, 10.0)
    assert len(sent) == 10
    assert {message.type for message in sent} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}
    assert not is_vehicle(sent[0])


@pytest.mark.parametrize("kind", sorted(NOT_VEHICLES))
def test_what_does_not_fly_is_no_vehicle(kind: int) -> None:
    message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 4, 3)
    assert not is_vehicle(message)


@pytest.mark.parametrize(
    ("age", "state"),
    [
        (0.0, LinkState.CONNECTED),
        (1.9, LinkState.CONNECTED),
        (2.1, LinkState.STALE),
        (4.9, LinkState.STALE),
        (5.1, LinkState.LOST),
    ],
)
def test_a_link_ages_with_its_heartbeat(age: float, state: LinkState) -> None:
    watch = LinkWatch()
    watch.heard(100.0)
    assert watch.state(100.0 + age) is state


def test_a_vehicle_never_heard_is_lost() -> None:
    assert LinkWatch().state(0.0) is LinkState.LOST


@given(st.lists(st.integers(0, 900), max_size=50))
def test_frames_that_overtake_one_another_are_no_restart(late_ms: list[int]) -> None:
    watch = RebootWatch()
    for index, late in enumerate(late_ms):
        assert not watch.sample(10_000 + 200 * index - late)


@given(st.integers(5_000, 2**31), st.integers(0, 1_000))
def test_a_clock_that_begins_again_is_a_restart_told_once(before: int, after: int) -> None:
    watch = RebootWatch()
    watch.sample(before)
    told = [watch.sample(after + 200 * i) for i in range(10)]
    assert told.count(True) == 1


def test_one_very_late_frame_is_no_restart() -> None:
    watch = RebootWatch()
    watch.sample(60_000)
    assert not watch.sample(10_000)
    assert not watch.sample(60_200)
    assert not watch.sample(10_200)
    assert not watch.sample(60_400)


@given(st.lists(st.floats(0.0, 60.0), min_size=1, max_size=40))
def test_timeouts_stay_within_what_links_do(samples: list[float]) -> None:
    round_trip = RoundTrip()
    for sample in samples:
        round_trip.sample(sample)
        assert SHORTEST_TIMEOUT_S <= round_trip.timeout_s <= LONGEST_TIMEOUT_S


def test_a_fast_link_has_short_timeouts_and_a_slow_one_long_ones() -> None:
    timeouts = []
    for delay in (0.01, 0.4, 1.5):
        round_trip = RoundTrip()
        assert round_trip.timeout_s == FIRST_TIMEOUT_S
        for _ in range(20):
            round_trip.sample(delay)
        timeouts.append(round_trip.timeout_s)
        assert round_trip.timeout_s > delay
    assert timeouts == sorted(timeouts)
