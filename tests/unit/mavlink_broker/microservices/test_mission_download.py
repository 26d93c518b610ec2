"""Downloading a plan of a vehicle."""

import pytest

from mavlink_broker.mavlink.dialect import Message, MissionAck, MissionCount, mavlink
from mavlink_broker.mavlink.mission_item import from_message, to_message, waypoint
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_download import Downloaded, MissionDownload, NotDownloaded
from mavlink_broker.microservices.mission_protocol import MAX_ITEMS
from tests.unit.mavlink_broker.microservices.harness import ROUTE, kinds, received, tick_until

ITEM = waypoint(latitude_deg=1.0, longitude_deg=2.0, relative_altitude_m=5.0)


def item(seq: int) -> Message:
    return received(to_message(ITEM, seq=seq, first=0, system=254, component=191))


def count(number: int) -> Message:
    return received(MissionCount(254, 191, number))


def download() -> MissionDownload:
    one = MissionDownload(ROUTE, RoundTrip())
    one.start(0.0)
    return one


def is_over(one: MissionDownload) -> bool:
    return one.outcome is not None


def test_items_are_requested_one_by_one() -> None:
    one = download()
    (first,) = one.receive(count(2), 0.1)
    assert (first.get_type(), first.seq) == ("MISSION_REQUEST_INT", 0)
    (second,) = one.receive(item(0), 0.2)
    assert second.seq == 1
    assert kinds(one.receive(item(1), 0.3)) == ["MISSION_ACK"]
    assert isinstance(one.outcome, Downloaded)
    assert [i.seq for i in one.outcome.items] == [0, 1]


def test_an_empty_mission_is_over_at_once() -> None:
    one = download()
    one.receive(count(0), 0.1)
    assert one.outcome == Downloaded(())


def test_an_unanswered_request_is_repeated() -> None:
    one = download()
    assert set(kinds(tick_until(one, 0.0, 3.0))) == {"MISSION_REQUEST_LIST"}
    one.receive(count(2), 3.1)
    again = tick_until(one, 3.1, 6.0)
    assert {(m.get_type(), m.seq) for m in again} == {("MISSION_REQUEST_INT", 0)}


def test_repeated_and_early_items_are_not_counted() -> None:
    one = download()
    one.receive(count(3), 0.1)
    for seq in (0, 0, 2):
        one.receive(item(seq), 0.2)
    one.receive(item(1), 0.3)
    assert not is_over(one)
    one.receive(item(2), 0.4)
    assert isinstance(one.outcome, Downloaded)
    assert [i.seq for i in one.outcome.items] == [0, 1, 2]


def test_a_refused_download_restarts_from_the_count() -> None:
    one = download()
    one.receive(count(2), 0.1)
    one.receive(received(MissionAck(254, 191, mavlink.MAV_MISSION_ERROR)), 0.2)
    assert kinds(tick_until(one, 0.2, 1.3)) == ["MISSION_REQUEST_LIST"]


def test_a_silent_vehicle_ends_it() -> None:
    one = download()
    tick_until(one, 0.0, 200.0, step=0.2)
    assert one.outcome == NotDownloaded("mission could not be read back: no answer")


def test_a_plan_of_more_items_than_are_kept_is_not_read() -> None:
    one = download()
    assert kinds(one.receive(count(MAX_ITEMS), 0.1)) == ["MISSION_REQUEST_INT"]
    one = download()
    (cancelled,) = one.receive(count(65_535), 0.1)
    assert cancelled.type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert one.outcome == NotDownloaded(
        f"mission could not be read back: it has 65535 items, limit {MAX_ITEMS}"
    )
    assert tick_until(one, 0.1, 30.0) == []


@pytest.mark.parametrize("kind", [1, 2])
def test_each_kind_of_plan_is_read_by_itself(kind: int) -> None:
    one = MissionDownload(ROUTE, RoundTrip(), mission_type=kind)
    (first,) = one.start(0.0)
    assert first.mission_type == kind
    assert one.receive(count(2), 0.1) == []  # Of a mission
    (request,) = one.receive(received(MissionCount(254, 191, 1, kind)), 0.1)
    assert request.mission_type == kind
    held = to_message(ITEM, seq=0, first=None, system=254, component=191, mission_type=kind)
    (ack,) = one.receive(received(held), 0.2)
    assert (ack.get_type(), ack.mission_type) == ("MISSION_ACK", kind)


def test_float_items_are_requested_of_a_vehicle_without_integer_items() -> None:
    one = MissionDownload(ROUTE, RoundTrip(), as_floats=True)
    one.start(0.0)
    assert kinds(one.receive(count(1), 0.1)) == ["MISSION_REQUEST"]
    place = mavlink.MAVLink_mission_item_message(
        254, 191, 0, 3, 16, 1, 1, 0, 0, 0, 0, 40.0, -3.0, 5
    )
    one.receive(received(place), 0.2)
    assert isinstance(one.outcome, Downloaded)
    assert from_message(one.outcome.items[0]).latitude_deg == 40.0
