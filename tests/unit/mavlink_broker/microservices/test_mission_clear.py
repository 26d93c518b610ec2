"""Clearing a plan of a vehicle."""

import pytest

from mavlink_broker.mavlink.dialect import Message, MissionAck, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_upload import (
    CLEAR_ATTEMPTS,
    Cleared,
    MissionClear,
    NotBegun,
    NotCleared,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, received, tick_until

FENCE = 1


def clear() -> MissionClear:
    return MissionClear(ROUTE, RoundTrip(), mission_type=FENCE)


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


@pytest.mark.parametrize(
    ("result", "kind"),
    [(mavlink.MAV_MISSION_DENIED, NotBegun), (mavlink.MAV_MISSION_UNSUPPORTED, NotCleared)],
)
def test_a_vehicle_that_refuses_or_is_busy_ends_it_with_its_reason(
    result: int, kind: type[NotBegun | NotCleared]
) -> None:
    one = clear()
    one.start(0.0)
    one.receive(ack(result), 0.1)
    name = mavlink.enums["MAV_MISSION_RESULT"][result].name
    assert one.outcome == kind(f"geofence could not be removed: {name}")
    assert tick_until(one, 0.1, 60.0) == []
