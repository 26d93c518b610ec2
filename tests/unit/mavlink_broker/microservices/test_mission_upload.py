"""The upload against every answer that vehicles are known to send."""

from typing import Any

import pytest

from mavlink_broker.mavlink.dialect import Message, MissionAck, mavlink
from mavlink_broker.mavlink.mission_item import (
    from_message,
    to_message,
    trigger_camera,
    waypoint,
)
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_upload import (
    COPY_WITHIN_S,
    COUNT_ATTEMPTS,
    MOST_REPETITIONS,
    MissionUpload,
    NotBegun,
    NotStored,
    Stored,
    Uncertain,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, kinds, received, tick_until

COUNT = 3
ITEM = waypoint(latitude_deg=1.0, longitude_deg=2.0, relative_altitude_m=5.0)


def upload(count: int = COUNT) -> MissionUpload:
    items = [to_message(ITEM, seq=i, first=0, system=1, component=1) for i in range(count)]
    return MissionUpload(items, ROUTE, RoundTrip(), busy_pause_s=6.0)


def request(
    seq: int, *, as_float: bool = False, system: int = 254, mission_type: int = 0
) -> Message:
    kind: Any = (
        mavlink.MAVLink_mission_request_message
        if as_float
        else mavlink.MAVLink_mission_request_int_message
    )
    return received(kind(system, 191, seq, mission_type))


def ack(result: int, opaque_id: int = 0, mission_type: int = 0) -> Message:
    return received(MissionAck(254, 191, result, mission_type, opaque_id))


def sent_all() -> MissionUpload:
    one = upload()
    one.start(0.0)
    for seq in range(COUNT):
        one.receive(request(seq), 0.1)
    return one


def test_every_requested_item_is_sent_and_the_id_is_returned() -> None:
    one = upload()
    (count,) = one.start(0.0)
    assert (count.get_type(), count.count) == ("MISSION_COUNT", COUNT)
    for seq in range(COUNT):
        (item,) = one.receive(request(seq), 0.1)
        assert (item.get_type(), item.seq) == ("MISSION_ITEM_INT", seq)
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED, 77), 0.2)
    assert one.outcome == Stored(77)


def test_a_request_is_answered_any_number_of_times_and_in_any_order() -> None:
    one = upload()
    one.start(0.0)
    for number, seq in enumerate((0, 0, 1, 0, 2, 1, 2)):
        (item,) = one.receive(request(seq), 0.1 + number * COPY_WITHIN_S)
        assert item.seq == seq


def test_a_link_that_doubles_messages_does_not_multiply_them_from_item_to_item() -> None:
    """This vehicle answers each copy of an item with the request of the next one."""
    one = upload(40)
    one.start(0.0)
    requests, sent, now = [0], 0, 0.0
    while requests and sent < 1000:
        now += 0.02
        items = [item.seq for seq in requests for item in one.receive(request(seq), now)]
        sent += len(items)
        requests = [seq + 1 for seq in items for _ in range(2) if seq + 1 < 40]
    assert sent == 40


def test_the_deprecated_request_is_answered_with_the_integer_item() -> None:
    one = upload()
    one.start(0.0)
    assert kinds(one.receive(request(0, as_float=True), 0.1)) == ["MISSION_ITEM_INT"]


def test_a_request_beyond_the_end_or_to_another_client_is_ignored() -> None:
    one = upload()
    one.start(0.0)
    assert one.receive(request(COUNT), 0.1) == []
    assert one.receive(request(0, system=255), 0.1) == []


def test_the_count_is_repeated_until_the_first_request() -> None:
    one = upload()
    one.start(0.0)
    assert set(kinds(tick_until(one, 0.0, 5.0))) == {"MISSION_COUNT"}
    one.receive(request(0), 5.1)
    assert tick_until(one, 5.1, 9.0) == []


def test_no_item_is_sent_without_a_request_before_the_last() -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    assert tick_until(one, 0.1, 4.9) == []


def test_a_missing_acknowledgement_makes_the_last_item_go_again() -> None:
    one = sent_all()
    again = tick_until(one, 0.1, 4.0)
    assert again
    assert {message.seq for message in again} == {COUNT - 1}
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED, 5), 4.1)
    assert one.outcome == Stored(5)


def test_without_an_acknowledgement_the_outcome_is_uncertain() -> None:
    one = sent_all()
    tick_until(one, 0.1, 60.0)
    assert one.outcome == Uncertain()


@pytest.mark.parametrize(
    "result", [mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_INVALID_SEQUENCE]
)
def test_a_vehicle_that_knows_no_repeated_item_leaves_it_uncertain(result: int) -> None:
    one = sent_all()
    tick_until(one, 0.1, 4.0)
    one.receive(ack(result), 4.1)
    assert one.outcome == Uncertain()


def test_an_acceptance_before_all_requests_is_ignored() -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED, 9), 0.2)
    assert one.outcome is None


@pytest.mark.parametrize(
    ("result", "name"),
    [
        (mavlink.MAV_MISSION_UNSUPPORTED, "UNSUPPORTED"),
        (mavlink.MAV_MISSION_INVALID_PARAM3, "INVALID_PARAM3"),
        (mavlink.MAV_MISSION_DENIED, "DENIED"),
    ],
)
def test_a_refusal_names_the_item(result: int, name: str) -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    one.receive(request(1), 0.2)
    one.receive(ack(result), 0.3)
    knows_no_such_item = name in {"UNSUPPORTED", "INVALID_PARAM3"}
    refusal = NotStored(f"mission refused: MAV_MISSION_{name}", 1, knows_no_such_item)
    assert one.outcome == refusal


def test_a_refusal_for_want_of_space_names_the_size_of_the_mission() -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    one.receive(ack(mavlink.MAV_MISSION_NO_SPACE), 0.2)
    reason = "mission refused: MAV_MISSION_NO_SPACE for 3 items"
    assert one.outcome == NotStored(reason, 0, is_too_long=True)


@pytest.mark.parametrize("result", [mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_DENIED])
def test_a_busy_vehicle_is_left_alone_for_a_while(result: int) -> None:
    one = upload()
    one.start(0.0)
    one.receive(ack(result), 0.1)
    assert tick_until(one, 0.1, 6.0) == []
    assert kinds(tick_until(one, 6.0, 6.3)) == ["MISSION_COUNT"]


@pytest.mark.parametrize("has_taken", [False, True])
def test_one_that_yields_ends_on_a_busy_vehicle_that_has_taken_nothing(*, has_taken: bool) -> None:
    """Else the vehicle may hold a part of it, and the caller must not take that for another's."""
    items = [to_message(ITEM, seq=i, first=0, system=1, component=1) for i in range(COUNT)]
    one = MissionUpload(items, ROUTE, RoundTrip(), busy_pause_s=6.0, yields=True)
    one.start(0.0)
    now = 0.1
    if has_taken:
        one.receive(request(0), now)
        while not kinds(tick_until(one, now, now + 1.0)):
            now += 1.0
            assert now < 60.0, "the count is repeated"
    one.receive(ack(mavlink.MAV_MISSION_ERROR), now + 1.0)
    assert (one.outcome is None) == has_taken
    if not has_taken:
        assert one.outcome == NotBegun("mission refused: MAV_MISSION_ERROR")


def test_a_transient_error_does_not_end_a_transfer() -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    one.receive(ack(mavlink.MAV_MISSION_ERROR), 0.2)
    assert kinds(one.receive(request(1), 0.3)) == ["MISSION_ITEM_INT"]


def test_a_stalled_transfer_restarts() -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    assert kinds(tick_until(one, 0.1, 6.4)) == ["MISSION_COUNT"]


def test_a_cancelled_transfer_restarts() -> None:
    one = upload()
    one.start(0.0)
    one.receive(request(0), 0.1)
    one.receive(ack(mavlink.MAV_MISSION_OPERATION_CANCELLED), 0.2)
    assert "MISSION_COUNT" in kinds(tick_until(one, 0.2, 1.5))


def test_a_vehicle_that_never_answers_ends_it() -> None:
    one = upload()
    sent = one.start(0.0) + tick_until(one, 0.0, 300.0)
    assert len(sent) == 4 * COUNT_ATTEMPTS
    assert isinstance(one.outcome, NotStored)
    assert "no answer to MISSION_COUNT" in one.outcome.reason


def test_messages_of_other_mission_types_are_ignored() -> None:
    one = sent_all()
    one.receive(ack(mavlink.MAV_MISSION_ACCEPTED, 3, mission_type=1), 0.2)
    assert one.outcome is None


def test_a_transfer_with_repeated_requests_continues() -> None:
    """Over a link that loses much, one item may take many requests."""
    one = upload()
    one.start(0.0)
    now = 0.0
    for _ in range(MOST_REPETITIONS):
        now += 1.0
        assert kinds(one.receive(request(0), now)) == ["MISSION_ITEM_INT"]
        assert one.tick(now + 0.9) == []
    assert kinds(one.receive(request(1), now + 1.0)) == ["MISSION_ITEM_INT"]


@pytest.mark.parametrize("asked", [0, COUNT - 1], ids=["the first", "the last"])
def test_endless_requests_of_one_item_end_the_transfer(asked: int) -> None:
    one = upload()
    one.start(0.0)
    for seq in range(asked):
        one.receive(request(seq), 0.1)
    now = 0.1
    while one.outcome is None and now < 1000.0:
        now += 0.2
        one.receive(request(asked), now)
        one.tick(now)
    assert isinstance(one.outcome, NotStored | Uncertain)


def test_the_vehicles_last_answer_is_the_reason_of_a_stall() -> None:
    one = upload()
    one.start(0.0)
    now = 0.0
    while one.outcome is None:
        now += 0.5
        one.receive(request(0), now)
        one.receive(ack(mavlink.MAV_MISSION_ERROR), now)
        tick_until(one, now, now + 6.5)
        now += 6.5
        assert now < 300.0
    assert one.outcome == NotStored("mission upload failed 4 times: MAV_MISSION_ERROR", 0)


@pytest.mark.parametrize(("kind", "name"), [(1, "geofence"), (2, "rally points")])
def test_each_kind_of_plan_has_its_own_transfer(kind: int, name: str) -> None:
    items = [
        to_message(ITEM, seq=i, first=None, system=1, component=1, mission_type=kind)
        for i in range(COUNT)
    ]
    one = MissionUpload(items, ROUTE, RoundTrip(), busy_pause_s=6.0, mission_type=kind)
    (count,) = one.start(0.0)
    assert (count.mission_type, count.count) == (kind, COUNT)
    assert one.receive(request(0), 0.1) == []  # Of a mission
    (item,) = one.receive(request(0, mission_type=kind), 0.1)
    assert (item.mission_type, item.current) == (kind, 0)
    one.receive(ack(mavlink.MAV_MISSION_DENIED), 0.2)
    assert one.outcome is None
    one.receive(ack(mavlink.MAV_MISSION_DENIED, mission_type=kind), 0.2)
    assert one.outcome == NotStored(f"{name} refused: MAV_MISSION_DENIED", 0)


class TestAVehicleWithoutIntegerItems:
    def one(self) -> MissionUpload:
        place = waypoint(latitude_deg=40.4434, longitude_deg=-3.7382, relative_altitude_m=5.0)
        items = [
            to_message(item, seq=i, first=0, system=1, component=1)
            for i, item in enumerate([place, trigger_camera()])
        ]
        upload = MissionUpload(items, ROUTE, RoundTrip(), busy_pause_s=6.0, as_floats=True)
        upload.start(0.0)
        return upload

    def test_gets_degrees_in_a_plain_frame_for_a_float_request(self) -> None:
        (item,) = map(received, self.one().receive(request(0, as_float=True), 0.1))
        assert (item.get_type(), item.frame) == ("MISSION_ITEM", 3)
        assert (item.x, item.y, item.z) == pytest.approx((40.4434, -3.7382, 5.0), abs=8e-6)
        held = from_message(item)
        assert held.latitude_deg == pytest.approx(40.4434, abs=8e-6)
        assert held.frame == 6

    def test_gets_numbers_where_there_is_no_place(self) -> None:
        (item,) = map(received, self.one().receive(request(1, as_float=True), 0.1))
        assert (item.x, from_message(item).fifth) == (1.0, 1)

    def test_gets_integers_for_an_integer_request(self) -> None:
        assert kinds(self.one().receive(request(0), 0.1)) == ["MISSION_ITEM_INT"]
