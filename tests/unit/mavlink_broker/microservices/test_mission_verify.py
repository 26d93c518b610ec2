"""No mission flies unless it is verified."""

from collections.abc import Sequence

import pytest

from mavlink_broker.mavlink.dialect import Message, MissionCount, MissionCurrent
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_download import Different, MissionVerify, Verified
from tests.unit.mavlink_broker.microservices.harness import ROUTE, kinds, received, tick_until


def verify(opaque_id: int, difference: str | None = None) -> MissionVerify:
    def compare(items: Sequence[Message]) -> str | None:
        del items
        return difference

    return MissionVerify(opaque_id, compare, ROUTE, RoundTrip())


def current(mission_id: int) -> Message:
    return received(MissionCurrent(0, 3, 2, 0, mission_id))


def test_the_same_id_proves_it() -> None:
    one = verify(77)
    assert kinds(one.start(0.0)) == ["COMMAND_LONG"]
    one.receive(current(77), 0.1)
    assert one.outcome == Verified()


def test_another_id_leads_to_reading_back() -> None:
    one = verify(77)
    one.start(0.0)
    one.receive(current(78), 0.1)
    assert one.outcome is None
    assert "MISSION_REQUEST_LIST" in kinds(tick_until(one, 0.1, 8.0))


def test_without_an_id_it_is_read_back_at_once() -> None:
    one = verify(0)
    assert kinds(one.start(0.0)) == ["MISSION_REQUEST_LIST"]
    one.receive(received(MissionCount(254, 191, 0)), 0.1)
    assert one.outcome == Verified()


def test_a_difference_is_reported() -> None:
    one = verify(0, "item 2 differs")
    one.start(0.0)
    one.receive(received(MissionCount(254, 191, 0)), 0.1)
    assert one.outcome == Different("item 2 differs", count=0)


def test_a_silent_vehicle_has_not_proven_anything() -> None:
    one = verify(77)
    one.start(0.0)
    tick_until(one, 0.0, 300.0, step=0.2)
    assert isinstance(one.outcome, Different)


@pytest.mark.parametrize(("kind", "field"), [(1, "fence_id"), (2, "rally_points_id")])
def test_each_kind_of_plan_has_its_own_id(kind: int, field: str) -> None:
    one = MissionVerify(77, lambda _items: None, ROUTE, RoundTrip(), mission_type=kind)
    one.start(0.0)
    one.receive(current(77), 0.1)
    assert one.outcome is None
    one.receive(received(MissionCurrent(0, 3, 2, 0, **{field: 77})), 0.1)
    assert one.outcome == Verified()
