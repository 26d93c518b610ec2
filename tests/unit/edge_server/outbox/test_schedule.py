"""What goes out next: order, priority, fairness, blocking, pausing."""

from random import Random

from edge_server.outbox.answers import Outcome, Result
from edge_server.outbox.queue import OutboxRecord, Stream, Trigger
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import (
    BREAKER,
    ENDPOINT_TRIES,
    FAIR_TURN,
    PREFETCH,
    Batch,
    Schedule,
    only_behind_others,
)
from edge_server.outbox.uplink import BatchLimit

CONFIRMED = Result(Outcome.CONFIRMED, "200", 200)
TRY_LATER = Result(Outcome.TRY_LATER, "500", 500)
NO_CLOUD = Result(Outcome.NO_CLOUD, "refused")
NO_ACCESS = Result(Outcome.NO_ACCESS, "401", 401)
REJECTED = Result(Outcome.REJECTED, "422", 422)


def schedule(workers: int = 4, cap_s: float = 10.0) -> Schedule:
    return Schedule(
        backoff=Backoff(1.0, cap_s), probe_interval_s=15.0, workers=workers, random=Random(1)
    )


class Rows:
    """Hands out records with ids in the order of asking."""

    def __init__(self, plan: Schedule) -> None:
        self._plan = plan
        self._newest = 0

    def add(self, kind: str, count: int = 1, vehicle_id: int = 1) -> list[OutboxRecord]:
        stream = Stream(vehicle_id, kind)
        records = []
        for _ in range(count):
            self._newest += 1
            key = f"{self._newest:026d}"
            records.append(OutboxRecord(self._newest, self._newest, key, stream, "{}", 0))
        self._plan.announce([stream])
        self._plan.feed(stream, records, PREFETCH)
        return records


def take(plan: Schedule, now: float) -> list[OutboxRecord]:
    """What goes out one by one."""
    return [record for batch in plan.take(now) for record in batch.records]


def settle(plan: Schedule, record: OutboxRecord, result: Result, now: float) -> Trigger:
    return plan.settle(Batch([record]), [result], now)[0]


def kinds(records: list[OutboxRecord]) -> list[str]:
    return [record.stream.kind for record in records]


def test_one_record_of_a_stream_flies_and_the_next_follows_its_answer() -> None:
    plan = schedule()
    first, second = Rows(plan).add("pose", 2)
    assert take(plan, 0.0) == [first]
    assert take(plan, 0.0) == []
    settle(plan, first, CONFIRMED, 0.0)
    assert take(plan, 0.0) == [second]


def test_priorities_are_kept() -> None:
    plan = schedule(workers=7)
    rows = Rows(plan)
    for kind in ("image", "pose", "state_vector", "mission_report", "alarm"):
        rows.add(kind)
    assert kinds(take(plan, 0.0)) == ["alarm", "mission_report", "state_vector", "pose", "image"]


def test_one_worker_is_kept_for_what_is_urgent() -> None:
    plan = schedule(workers=3)
    rows = Rows(plan)
    for vehicle_id in range(1, 5):
        rows.add("pose", vehicle_id=vehicle_id)
    assert len(take(plan, 0.0)) == 2
    rows.add("alarm")
    assert kinds(take(plan, 0.0)) == ["alarm"]


def test_low_priorities_do_not_starve() -> None:
    plan = schedule(workers=2)
    rows = Rows(plan)
    rows.add("image", 2)
    for vehicle_id in (1, 2):
        rows.add("mission_report", 60, vehicle_id=vehicle_id)
    sent: list[OutboxRecord] = []
    while "image" not in kinds(sent):
        taken = take(plan, 0.0)
        sent += taken
        for record in taken:
            settle(plan, record, CONFIRMED, 0.0)
        assert len(sent) <= 2 * FAIR_TURN


def test_a_failing_stream_waits_alone() -> None:
    plan = schedule()
    rows = Rows(plan)
    (poison,) = rows.add("pose")
    rows.add("battery", 3)
    take(plan, 0.0)
    settle(plan, poison, TRY_LATER, 0.0)
    assert not plan.blocked
    assert kinds(take(plan, 0.0)) == []
    due = plan.next_due(0.0)
    assert due is not None
    assert 0.0 < due <= 1.0
    (again,) = take(plan, due)
    assert (again.outbox_id, again.attempts) == (poison.outbox_id, 1)


def test_no_cloud_blocks_everything_but_one_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    for vehicle_id in range(1, 4):
        rows.add("pose", 2, vehicle_id=vehicle_id)
    flying = take(plan, 0.0)
    for record in flying:
        settle(plan, record, NO_CLOUD, 0.0)
    assert plan.blocked
    due = plan.next_due(0.0)
    assert due is not None
    probe = take(plan, due)
    assert len(probe) == 1
    assert take(plan, due) == []
    settle(plan, probe[0], CONFIRMED, due)
    assert len(take(plan, due + 1.0)) == 3


def test_a_long_outage_does_not_make_the_wait_longer_than_the_cap() -> None:
    plan = schedule(cap_s=10.0)
    Rows(plan).add("pose")
    now = 0.0
    for _ in range(200):
        (probe,) = take(plan, now)
        settle(plan, probe, NO_CLOUD, now)
        due = plan.next_due(now)
        assert due is not None
        assert now <= due <= now + 10.0
        now = due


def test_an_alarm_is_the_first_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    (pose,) = rows.add("pose")
    take(plan, 0.0)
    rows.add("alarm")
    settle(plan, pose, NO_CLOUD, 0.0)
    assert kinds(take(plan, 100.0)) == ["alarm"]


def test_failures_in_a_row_over_all_streams_block_the_uplink() -> None:
    plan = schedule(workers=BREAKER + 1)
    rows = Rows(plan)
    for vehicle_id in range(BREAKER):
        rows.add("pose", vehicle_id=vehicle_id + 1)
    for number, record in enumerate(take(plan, 0.0), start=1):
        settle(plan, record, TRY_LATER, 0.0)
        assert plan.blocked == (number >= BREAKER)


def test_a_refused_key_pauses_until_the_next_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    (pose,) = rows.add("pose")
    take(plan, 0.0)
    rows.add("alarm")
    settle(plan, pose, NO_ACCESS, 0.0)
    assert plan.paused
    assert take(plan, 14.9) == []
    assert plan.next_due(0.0) == 15.0
    (probe,) = take(plan, 15.0)
    settle(plan, probe, CONFIRMED, 15.0)
    assert not plan.paused


def test_a_rejected_record_leaves_and_the_next_one_goes() -> None:
    plan = schedule()
    first, second = Rows(plan).add("pose", 2)
    take(plan, 0.0)
    settle(plan, first, REJECTED, 0.0)
    assert take(plan, 0.0) == [second]


def test_the_clouds_wish_is_heeded() -> None:
    plan = schedule()
    (record,) = Rows(plan).add("pose")
    take(plan, 0.0)
    settle(plan, record, TRY_LATER._replace(retry_after_s=60.0), 0.0)
    assert take(plan, 59.9) == []
    assert len(take(plan, 60.1)) == 1


def test_after_a_rewind_the_record_in_flight_is_not_read_twice() -> None:
    plan = schedule()
    first, second = Rows(plan).add("pose", 2)
    take(plan, 0.0)
    plan.rewind()
    assert plan.to_read() == [(first.stream, 0, PREFETCH)]
    plan.feed(first.stream, [first, second], PREFETCH)
    settle(plan, first, CONFIRMED, 0.0)
    assert take(plan, 0.0) == [second]


def test_with_nothing_to_send_there_is_nothing_to_wait_for() -> None:
    plan = schedule()
    assert plan.next_due(0.0) is None
    (record,) = Rows(plan).add("pose")
    take(plan, 0.0)
    assert plan.next_due(0.0) is None
    settle(plan, record, CONFIRMED, 0.0)
    assert plan.next_due(0.0) is None


BATCH = BatchLimit(100, 10_000)


def keys(batch: Batch) -> list[int]:
    return [record.outbox_id for record in batch.records]


def test_a_batch_holds_each_stream_in_its_order_and_the_urgent_first() -> None:
    plan = schedule()
    rows = Rows(plan)
    first, second, third = rows.add("pose", 3)
    (alarm,) = rows.add("alarm")
    (batch,) = plan.take(0.0, BATCH)
    assert keys(batch) == [p.outbox_id for p in (alarm, first, second, third)]


def test_a_batch_is_bounded_in_records_and_bytes() -> None:
    plan = schedule(workers=5)
    rows = Rows(plan)
    for vehicle_id in (1, 2, 3):
        rows.add("pose", 4, vehicle_id=vehicle_id)
    assert [len(s.records) for s in plan.take(0.0, BatchLimit(6, 10_000))] == [6, 4]
    plan = schedule(workers=5)
    (first, *_) = Rows(plan).add("pose", 9)
    assert [len(s.records) for s in plan.take(0.0, BatchLimit(100, 3 * first.size_bytes))] == [3]


def test_a_picture_travels_alone() -> None:
    plan = schedule()
    rows = Rows(plan)
    rows.add("image", 2)
    rows.add("pose", 2)
    assert [kinds(s.records) for s in plan.take(0.0, BATCH)] == [["pose", "pose"], ["image"]]


def test_the_last_free_worker_takes_only_what_is_urgent() -> None:
    plan = schedule(workers=2)
    rows = Rows(plan)
    rows.add("pose")
    plan.take(0.0, BATCH)
    rows.add("battery")
    rows.add("mission_report")
    rows.add("alarm")
    (batch,) = plan.take(0.0, BATCH)
    assert kinds(batch.records) == ["alarm", "mission_report"]


def test_what_a_batch_did_not_bring_over_goes_again_in_order() -> None:
    plan = schedule()
    a, b, c, d = Rows(plan).add("pose", 4)
    (batch,) = plan.take(0.0, BATCH)
    held_back = Result(Outcome.HELD_BACK, "424", 424)
    plan.settle(batch, [CONFIRMED, TRY_LATER, held_back, held_back], 0.0)
    due = plan.next_due(0.0)
    assert due is not None
    (again,) = plan.take(due, BATCH)
    assert keys(again) == [b.outbox_id, c.outbox_id, d.outbox_id]
    assert [record.attempts for record in again.records] == [1, 0, 0]
    assert a not in again.records


def test_a_batch_that_fails_counts_once() -> None:
    plan = schedule()
    Rows(plan).add("pose", 50)
    (batch,) = plan.take(0.0, BATCH)
    plan.settle(batch, [TRY_LATER] * 50, 0.0)
    assert not plan.blocked


def test_a_probe_is_one_record() -> None:
    plan = schedule()
    Rows(plan).add("pose", 50)
    (batch,) = plan.take(0.0, BATCH)
    plan.settle(batch, [NO_CLOUD] * 50, 0.0)
    (probe,) = plan.take(100.0, BATCH)
    assert len(probe.records) == 1


def test_a_record_on_which_the_cloud_fails_is_not_the_only_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    (poison,) = rows.add("alarm")
    now = 0.0
    for _ in range(BREAKER):
        (probe,) = take(plan, now)
        settle(plan, probe, TRY_LATER, now)
        now = plan.next_due(now) or now
    assert plan.blocked
    rows.add("pose")
    (probe,) = take(plan, now)
    assert probe.stream.kind == "pose"
    settle(plan, probe, CONFIRMED, now)
    assert kinds(take(plan, now + 10.0)) == [poison.stream.kind]


NO_ENDPOINT = Result(Outcome.NO_ENDPOINT, "404", 404)


def test_a_kind_without_a_place_waits_and_the_others_go_on() -> None:
    plan = schedule(workers=6)
    rows = Rows(plan)
    for vehicle_id in (1, 2):
        rows.add("image", vehicle_id=vehicle_id)
    image, other = take(plan, 0.0)
    settle(plan, image, NO_ENDPOINT, 0.0)
    settle(plan, other, NO_ENDPOINT, 0.0)
    rows.add("pose")
    assert kinds(take(plan, 0.0)) == ["pose"]
    assert not plan.blocked
    due = plan.next_due(0.0)
    assert due is not None
    assert len(take(plan, due)) == 1


def test_a_record_without_a_place_is_given_up_after_ten_tries() -> None:
    plan = schedule()
    first, second = Rows(plan).add("image", 2)
    now, triggers = 0.0, []
    for _ in range(ENDPOINT_TRIES):
        (record,) = take(plan, now)
        assert record.outbox_id == first.outbox_id
        triggers.append(settle(plan, record, NO_ENDPOINT, now))
        now = plan.next_due(now) or now
    assert triggers == [Trigger.PUT_OFF] * (ENDPOINT_TRIES - 1) + [Trigger.REJECTED]
    assert take(plan, now + 10.0) == [second]


HELD_BACK = Result(Outcome.HELD_BACK, "424", 424)


def test_held_back_is_believed_only_behind_another_record_of_its_stream() -> None:
    rows = Rows(schedule())
    records = [*rows.add("pose", 2), *rows.add("alarm"), *rows.add("pose", 1, 2)]
    said = only_behind_others(records, [TRY_LATER, HELD_BACK, HELD_BACK, CONFIRMED])
    assert [result.outcome for result in said] == [
        Outcome.TRY_LATER,
        Outcome.HELD_BACK,
        Outcome.TRY_LATER,
        Outcome.CONFIRMED,
    ]


def test_a_cloud_that_holds_everything_back_is_asked_ever_less_often() -> None:
    """Without a pause it was asked two thousand times in six seconds."""
    plan = schedule()
    Rows(plan).add("pose", 3)
    now, asked = 0.0, 0
    while now < 60.0:
        for batch in plan.take(now):
            asked += 1
            said = [HELD_BACK] * len(batch.records)
            plan.settle(batch, only_behind_others(batch.records, said), now)
        due = plan.next_due(now)
        now = now + 0.01 if due is None else due
    assert 5 <= asked < 40
