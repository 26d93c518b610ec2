"""Clearing a plan of a vehicle."""

import pytest

from mavlink_broker.mavlink.dialect import Message, MissionAck, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_upload import (
    CLEAR_ATTEMPTS,
    Cleared,
    MissionClear,
    NotCleared,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, received, tick_until

FENCE = 1


def clear() -> MissionClear:
    return MissionClear(ROUTE, RoundTrip(), mission_type=FENCE, busy_pause_s=6.0)


def ack(result: int, mission_type: int = FENCE) -> Message:
    return received(MissionAck(254, 191, result, mission_type))


def test_it_ends_when_the_vehicle_acknowledges() -> None:
    one = clear()
    (order,) = one.start(0.0)
    assert (order.get_type(), order.mission_type) == ("MISSION_CLEAR_ALL", FENCE)
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED, mission_type=0), 0.1)
    assert one.outcome is None
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED), 0.1)
    assert one.outcome == Cleared()


def test_a_silent_vehicle_is_retried_and_then_fails() -> None:
    one = clear()
    sent = one.start(0.0) + tick_until(one, 0.0, 60.0)
    assert len(sent) == CLEAR_ATTEMPTS
    assert one.outcome == NotCleared("geofence could not be removed: no answer")


def test_a_busy_vehicle_is_left_alone_for_a_while() -> None:
    one = clear()
    one.start(0.0)
    one.receive(ack(mavlink.MAV_MISSION_DENIED), 0.1)
    assert tick_until(one, 0.1, 6.0) == []
    assert len(tick_until(one, 6.0, 6.3)) == 1
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED), 6.4)
    assert one.outcome == Cleared()


@pytest.mark.parametrize("result", [mavlink.MAV_MISSION_DENIED, mavlink.MAV_MISSION_UNSUPPORTED])
def test_a_vehicle_that_refuses_ends_it_with_its_reason(result: int) -> None:
    one = clear()
    one.start(0.0)
    now = 0.0
    while one.outcome is None:
        now += 7.0
        one.receive(ack(result), now)
        one.tick(now + 6.5)
        assert now < 100.0
    name = mavlink.enums["MAV_MISSION_RESULT"][result].name
    assert one.outcome == NotCleared(f"geofence could not be removed: {name}")
