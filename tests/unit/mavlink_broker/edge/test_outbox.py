"""What waits for the edge server: order, urgency, back-off, loss only where it may be."""

import random
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.edge.outbox import LONGEST_PAUSE_S, Post, SendQueue, Urgency


def queue(kept: int = 1000) -> SendQueue:
    return SendQueue(random.Random(1), kept=kept)


def post(lane: str = "pose", number: int = 0, vehicle_id: int = 1, **changed: Any) -> Post:
    fields: dict[str, Any] = {
        "method": "POST",
        "path": f"/{lane}/",
        "body": {"n": number},
        "vehicle_id": vehicle_id,
        "lane": lane,
        "urgency": Urgency.RESULT,
        "needs_registration": False,
    }
    return Post(**(fields | changed))


def state_vector(number: int, vehicle_id: int = 1) -> Post:
    return post("state_vector", number, vehicle_id, urgency=Urgency.TELEMETRY, may_be_dropped=True)


def registration(vehicle_id: int = 1, number: int = 0) -> Post:
    return post("vehicle", number, vehicle_id, urgency=Urgency.REGISTRATION, replaces=True)


def drain(waiting: SendQueue, now: float = 0.0) -> list[tuple[str, int]]:
    told = []
    while (one := waiting.take(now)) is not None:
        told.append((one.lane, one.body["n"]))
        waiting.answered(one)
    return told


@given(st.lists(st.sampled_from(["pose", "battery", "mission_report"]), max_size=30))
def test_order_within_a_lane_is_kept(lanes: list[str]) -> None:
    waiting = queue()
    for number, lane in enumerate(lanes):
        waiting.put(post(lane, number))
    told = drain(waiting)
    assert len(told) == len(lanes)
    for lane in set(lanes):
        numbers = [number for name, number in told if name == lane]
        assert numbers == sorted(numbers)


@given(st.lists(st.booleans(), max_size=60))
def test_failures_never_change_the_order_or_lose_anything(successes: list[bool]) -> None:
    waiting, told, now = queue(), [], 0.0
    for number in range(5):
        waiting.put(post("pose", number))
    for success in successes:
        now += LONGEST_PAUSE_S
        one = waiting.take(now)
        if one is None:
            break
        if success:
            told.append(one.body["n"])
            waiting.answered(one)
        else:
            waiting.failed(one, now, cut_off=False)
    assert told == list(range(len(told)))
    assert len(waiting) == 5 - len(told)


def test_only_one_of_a_lane_is_in_flight() -> None:
    waiting = queue()
    waiting.put(post("pose", 0))
    waiting.put(post("pose", 1))
    assert waiting.take(0.0) is not None
    assert waiting.take(0.0) is None


def test_reports_go_before_telemetry() -> None:
    waiting = queue()
    waiting.put(state_vector(0))
    waiting.put(post("pose", 1))
    waiting.put(post("mission_report", 2, urgency=Urgency.REPORT))
    waiting.put(post("alarm", 3, urgency=Urgency.ALARM))
    assert [number for _, number in drain(waiting)] == [3, 2, 1, 0]


def test_a_lane_that_failed_waits_and_does_not_hold_up_the_others() -> None:
    waiting = queue()
    waiting.put(post("pose"))
    waiting.put(post("battery"))
    first = waiting.take(0.0)
    assert first is not None
    waiting.failed(first, 0.0, cut_off=False)
    second = waiting.take(0.0)
    assert second is not None
    assert second.lane != first.lane
    assert waiting.take(LONGEST_PAUSE_S) is first


def test_pauses_grow_and_have_a_limit() -> None:
    waiting = queue()
    waiting.put(post("pose"))
    pauses, now = [], 0.0
    for _ in range(12):
        one = waiting.take(now)
        assert one is not None
        waiting.failed(one, now, cut_off=True)
        due = waiting.next_due()
        assert due is not None
        pauses.append(due - now)
        now = due
    assert pauses[0] <= 0.2
    assert pauses[-1] > pauses[0]
    assert max(pauses) <= LONGEST_PAUSE_S


def test_an_edge_server_that_is_back_is_told_everything_at_once() -> None:
    waiting = queue()
    for lane in ("pose", "battery"):
        waiting.put(post(lane))
    one, other = waiting.take(0.0), waiting.take(0.0)
    assert one is not None
    assert other is not None
    waiting.failed(one, 0.0, cut_off=True)
    waiting.answered(other)
    assert waiting.take(0.0) is one


def test_the_oldest_state_vectors_are_dropped_and_counted_and_nothing_else() -> None:
    waiting = queue(kept=10)
    for number in range(25):
        waiting.put(state_vector(number))
        waiting.put(post("pose", number))
    assert waiting.dropped == 15
    told = drain(waiting)
    assert [n for lane, n in told if lane == "state_vector"] == list(range(15, 25))
    assert [n for lane, n in told if lane == "pose"] == list(range(25))


def test_a_vehicles_reports_wait_for_its_registration() -> None:
    waiting = queue()
    waiting.put(post("pose", needs_registration=True))
    assert waiting.take(0.0) is None
    assert waiting.next_due() is None
    waiting.put(registration(vehicle_id=2))
    waiting.put(registration(vehicle_id=1))
    assert [lane for lane, _ in drain(waiting)] == ["vehicle", "vehicle", "pose"]


def test_a_newer_description_replaces_the_waiting_one() -> None:
    waiting = queue()
    for number in range(5):
        waiting.put(registration(number=number))
    assert drain(waiting) == [("vehicle", 4)]


def test_a_description_that_failed_gives_way_to_a_newer_one() -> None:
    waiting = queue()
    waiting.put(registration(number=1))
    one = waiting.take(0.0)
    assert one is not None
    waiting.put(registration(number=2))
    waiting.failed(one, 0.0, cut_off=True)
    assert drain(waiting, now=LONGEST_PAUSE_S) == [("vehicle", 2)]
