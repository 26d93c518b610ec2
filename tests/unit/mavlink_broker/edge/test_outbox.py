"""Posts that wait for the edge server: order, urgency, back-off, and which may be dropped."""

import random
from collections.abc import Callable
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.edge.outbox import (
    LONGEST_PAUSE_S,
    LONGEST_WAITING_EVERY,
    Outbox,
    Post,
    Urgency,
)


def queue(max_state_vectors: int = 1000) -> Outbox:
    return Outbox(random.Random(1), max_state_vectors=max_state_vectors)


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


def drain(waiting: Outbox, now: float = 0.0) -> list[tuple[str, int]]:
    sent = []
    while (one := waiting.take(now)) is not None:
        sent.append((one.lane, one.body["n"]))
        waiting.answered(one)
    return sent


@given(st.lists(st.sampled_from(["pose", "battery", "mission_report"]), max_size=30))
def test_order_within_a_lane_is_kept(lanes: list[str]) -> None:
    waiting = queue()
    for number, lane in enumerate(lanes):
        waiting.put(post(lane, number))
    sent = drain(waiting)
    assert len(sent) == len(lanes)
    for lane in set(lanes):
        numbers = [number for name, number in sent if name == lane]
        assert numbers == sorted(numbers)


@given(st.lists(st.booleans(), max_size=60))
def test_failures_never_change_the_order_or_lose_anything(successes: list[bool]) -> None:
    waiting, sent, now = queue(), [], 0.0
    for number in range(5):
        waiting.put(post("pose", number))
    for success in successes:
        now += LONGEST_PAUSE_S
        one = waiting.take(now)
        if one is None:
            break
        if success:
            sent.append(one.body["n"])
            waiting.answered(one)
        else:
            waiting.failed(one, now, is_unreachable=False)
    assert sent == list(range(len(sent)))
    assert len(waiting) == 5 - len(sent)


def test_a_lane_has_one_post_in_flight() -> None:
    waiting = queue()
    waiting.put(post("pose", 0))
    waiting.put(post("pose", 1))
    assert waiting.take(0.0) is not None
    assert waiting.take(0.0) is None


def test_reports_precede_telemetry() -> None:
    waiting = queue()
    waiting.put(state_vector(0))
    waiting.put(post("pose", 1))
    waiting.put(post("mission_report", 2, urgency=Urgency.REPORT))
    waiting.put(post("alarm", 3, urgency=Urgency.ALARM))
    assert [number for _, number in drain(waiting)] == [3, 2, 1, 0]


def test_a_registered_vehicles_description_goes_behind_its_reports() -> None:
    waiting = queue()
    waiting.put(registration())
    drain(waiting)
    waiting.put(registration(number=1))
    waiting.put(post("mission_report", 1, urgency=Urgency.REPORT))
    assert drain(waiting) == [("mission_report", 1), ("vehicle", 1)]


@settings(max_examples=20)
@given(st.integers(1, 20), st.sampled_from(list(Urgency)))
def test_no_lane_starves_behind_posts_that_keep_coming(vehicles: int, urgent: Urgency) -> None:
    """A slow edge server, which answers fewer posts than arrive, still receives of every lane."""
    waiting, now = queue(), 0.0
    for vehicle_id in range(1, vehicles + 1):
        waiting.put(registration(vehicle_id))
    drain(waiting)
    waiting.put(post("image", 7, vehicle_id=1, urgency=Urgency.PICTURE))
    sent = []
    for _ in range(LONGEST_WAITING_EVERY * (2 * vehicles + 2)):
        now += 0.5
        for vehicle_id in range(1, vehicles + 1):
            waiting.put(registration(vehicle_id))
            waiting.put(post("flood", 0, vehicle_id, urgency=urgent))
        one = waiting.take(now)
        assert one is not None
        waiting.answered(one)
        sent.append((one.lane, one.vehicle_id))
    wanted = {("vehicle", n) for n in range(1, vehicles + 1)} | {("image", 1)}
    assert wanted <= set(sent)


def test_a_lane_that_failed_waits_and_blocks_no_other() -> None:
    waiting = queue()
    waiting.put(post("pose"))
    waiting.put(post("battery"))
    first = waiting.take(0.0)
    assert first is not None
    waiting.failed(first, 0.0, is_unreachable=False)
    second = waiting.take(0.0)
    assert second is not None
    assert second.lane != first.lane
    assert waiting.take(LONGEST_PAUSE_S) is first


def test_pauses_grow_up_to_a_limit() -> None:
    waiting = queue()
    waiting.put(post("pose"))
    pauses, now = [], 0.0
    for _ in range(12):
        one = waiting.take(now)
        assert one is not None
        waiting.failed(one, now, is_unreachable=True)
        due = waiting.next_due()
        assert due is not None
        pauses.append(due - now)
        now = due
    assert pauses[0] <= 0.2
    assert pauses[-1] > pauses[0]
    assert max(pauses) <= LONGEST_PAUSE_S


def test_all_lanes_are_ready_when_the_edge_server_answers_again() -> None:
    waiting = queue()
    for lane in ("pose", "battery"):
        waiting.put(post(lane))
    one, other = waiting.take(0.0), waiting.take(0.0)
    assert one is not None
    assert other is not None
    waiting.failed(one, 0.0, is_unreachable=True)
    waiting.answered(other)
    assert waiting.take(0.0) is one


def test_only_the_oldest_state_vectors_are_dropped_and_counted() -> None:
    waiting = queue(max_state_vectors=10)
    for number in range(25):
        waiting.put(state_vector(number))
        waiting.put(post("pose", number))
    assert waiting.dropped == 15
    sent = drain(waiting)
    assert [n for lane, n in sent if lane == "state_vector"] == list(range(15, 25))
    assert [n for lane, n in sent if lane == "pose"] == list(range(25))


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


def test_a_newer_description_replaces_one_that_failed() -> None:
    waiting = queue()
    waiting.put(registration(number=1))
    one = waiting.take(0.0)
    assert one is not None
    waiting.put(registration(number=2))
    waiting.failed(one, 0.0, is_unreachable=True)
    assert drain(waiting, now=LONGEST_PAUSE_S) == [("vehicle", 2)]


def result(number: int) -> Post:
    return post("mission_report", number, path="/pose/", may_be_duplicate=True)


def report(number: int) -> Post:
    return post("mission_report", number)


RESULT_OR_REPORT = st.lists(st.sampled_from([result, report]), min_size=1, max_size=20)


def refuse_for_space(waiting: Outbox, one: Post, now: float) -> None:
    waiting.failed(one, now, is_unreachable=False, is_temporary=True, lacks_space=True)


@given(RESULT_OR_REPORT)
def test_reports_and_acknowledgements_go_past_results_without_space(
    makers: list[Callable[[int], Post]],
) -> None:
    """While the edge server refuses results, all others arrive at once, in order."""
    waiting = queue()
    sent: list[Post] = []
    posts = [make(number) for number, make in enumerate(makers)]
    for one in posts:
        waiting.put(one)
    others = [one for one in posts if not one.is_result]
    while len(sent) < len(others):
        assert waiting.next_due() == 0.0
        taken = waiting.take(0.0)
        assert taken is not None
        if taken.is_result:
            refuse_for_space(waiting, taken, 0.0)
            assert waiting.has_failures
        else:
            sent.append(taken)
            waiting.answered(taken)
    assert sent == others
    results = [one.body["n"] for one in posts if one.is_result]
    assert [number for _, number in drain(waiting, LONGEST_PAUSE_S)] == results


@given(RESULT_OR_REPORT, st.lists(st.sampled_from(["answer", "full", "away", "put"])))
def test_results_and_others_each_keep_their_order_whatever_fails(
    makers: list[Callable[[int], Post]], acts: list[str]
) -> None:
    waiting, now = queue(), 0.0
    sent: list[Post] = []
    put: list[Post] = []
    for act in [*acts, *["put", "answer"] * len(makers), *["answer"] * len(acts)]:
        if act == "put":
            put.append(makers[len(put) % len(makers)](len(put)))
            waiting.put(put[-1])
            continue
        now += LONGEST_PAUSE_S
        taken = waiting.take(now)
        if taken is None:
            continue
        if act == "answer":
            sent.append(taken)
            waiting.answered(taken)
        elif act == "full" and taken.is_result:
            refuse_for_space(waiting, taken, now)
        else:
            waiting.failed(taken, now, is_unreachable=act == "away")
    for is_result in (False, True):
        kept = [one for one in put if one.is_result is is_result]
        assert [one for one in sent if one.is_result is is_result] == kept
    assert len(waiting) == 0


def test_a_result_precedes_its_report_again_when_there_is_space() -> None:
    waiting = queue()
    waiting.put(result(0))
    waiting.put(report(1))
    first = waiting.take(0.0)
    assert first is not None
    refuse_for_space(waiting, first, 0.0)
    passing = waiting.take(0.0)
    assert passing is not None
    waiting.answered(passing)
    waiting.put(result(2))
    assert waiting.take(0.0) is None, "a result goes behind an older one"
    assert waiting.at_risk(0.0) == [first, *waiting.unspooled()[1:]]
    waiting.put(report(3))
    now = LONGEST_PAUSE_S
    assert waiting.take(now) is first
    waiting.answered(first)
    assert [number for _, number in drain(waiting, now)] == [2, 3]


def test_a_result_that_fails_otherwise_holds_its_report_back() -> None:
    waiting = queue()
    waiting.put(result(0))
    waiting.put(report(1))
    first = waiting.take(0.0)
    assert first is not None
    waiting.failed(first, 0.0, is_unreachable=False, is_temporary=True)
    assert waiting.take(0.0) is None


def test_what_goes_past_a_result_is_stored_at_its_place() -> None:
    """The spool numbers posts in the order of the lane, also the one in flight."""
    waiting = queue()
    posts = [result(0), report(1), report(2)]
    for one in posts:
        waiting.put(one)
    first = waiting.take(0.0)
    assert first is not None
    refuse_for_space(waiting, first, 0.0)
    assert waiting.take(0.0) is posts[1]
    assert waiting.unspooled() == posts
    first.spool_number = 1
    assert waiting.unspooled() == posts[1:]
    waiting.failed(posts[1], 0.0, is_unreachable=False, is_temporary=True, lacks_space=True)
    assert waiting.unspooled() == posts[1:]
