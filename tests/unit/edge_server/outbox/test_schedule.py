"""What goes out next: order, priority, fairness, blocking, pausing."""

from random import Random

from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.queue import Parcel, Stream
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import BREAKER, FAIR_TURN, PREFETCH, Schedule

CONFIRMED = Verdict(Meaning.CONFIRMED, "200", 200)
TRY_LATER = Verdict(Meaning.TRY_LATER, "500", 500)
NO_CLOUD = Verdict(Meaning.NO_CLOUD, "refused")
NO_ACCESS = Verdict(Meaning.NO_ACCESS, "401", 401)
REJECTED = Verdict(Meaning.REJECTED, "422", 422)


def schedule(workers: int = 4, cap_s: float = 10.0) -> Schedule:
    return Schedule(
        backoff=Backoff(1.0, cap_s), probe_interval_s=15.0, workers=workers, random=Random(1)
    )


class Rows:
    """Hands out parcels with ids in the order of asking."""

    def __init__(self, plan: Schedule) -> None:
        self._plan = plan
        self._newest = 0

    def add(self, kind: str, count: int = 1, vehicle_id: int = 1) -> list[Parcel]:
        stream = Stream(vehicle_id, kind)
        parcels = []
        for _ in range(count):
            self._newest += 1
            key = f"{self._newest:026d}"
            parcels.append(Parcel(self._newest, self._newest, key, stream, "{}", 0))
        self._plan.announce([stream])
        self._plan.feed(stream, parcels, PREFETCH)
        return parcels


def kinds(parcels: list[Parcel]) -> list[str]:
    return [parcel.stream.kind for parcel in parcels]


def test_one_record_of_a_stream_flies_and_the_next_follows_its_answer() -> None:
    plan = schedule()
    first, second = Rows(plan).add("pose", 2)
    assert plan.take(0.0) == [first]
    assert plan.take(0.0) == []
    plan.settle(first, CONFIRMED, 0.0)
    assert plan.take(0.0) == [second]


def test_priorities_are_kept() -> None:
    plan = schedule(workers=7)
    rows = Rows(plan)
    for kind in ("image", "pose", "state_vector", "mission_report", "alarm"):
        rows.add(kind)
    assert kinds(plan.take(0.0)) == ["alarm", "mission_report", "state_vector", "pose", "image"]


def test_one_worker_is_kept_for_what_is_urgent() -> None:
    plan = schedule(workers=3)
    rows = Rows(plan)
    for vehicle_id in range(1, 5):
        rows.add("pose", vehicle_id=vehicle_id)
    assert len(plan.take(0.0)) == 2
    rows.add("alarm")
    assert kinds(plan.take(0.0)) == ["alarm"]


def test_low_priorities_do_not_starve() -> None:
    plan = schedule(workers=2)
    rows = Rows(plan)
    rows.add("image", 2)
    for vehicle_id in (1, 2):
        rows.add("mission_report", 60, vehicle_id=vehicle_id)
    sent: list[Parcel] = []
    while "image" not in kinds(sent):
        taken = plan.take(0.0)
        sent += taken
        for parcel in taken:
            plan.settle(parcel, CONFIRMED, 0.0)
        assert len(sent) <= 2 * FAIR_TURN


def test_a_failing_stream_waits_alone() -> None:
    plan = schedule()
    rows = Rows(plan)
    (poison,) = rows.add("pose")
    rows.add("battery", 3)
    plan.take(0.0)
    plan.settle(poison, TRY_LATER, 0.0)
    assert not plan.blocked
    assert kinds(plan.take(0.0)) == []
    due = plan.next_due(0.0)
    assert due is not None
    assert 0.0 < due <= 1.0
    (again,) = plan.take(due)
    assert (again.outbox_id, again.attempts) == (poison.outbox_id, 1)


def test_no_cloud_blocks_everything_but_one_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    for vehicle_id in range(1, 4):
        rows.add("pose", 2, vehicle_id=vehicle_id)
    flying = plan.take(0.0)
    for parcel in flying:
        plan.settle(parcel, NO_CLOUD, 0.0)
    assert plan.blocked
    due = plan.next_due(0.0)
    assert due is not None
    probe = plan.take(due)
    assert len(probe) == 1
    assert plan.take(due) == []
    plan.settle(probe[0], CONFIRMED, due)
    assert len(plan.take(due + 1.0)) == 3


def test_a_long_outage_does_not_make_the_wait_longer_than_the_cap() -> None:
    plan = schedule(cap_s=10.0)
    Rows(plan).add("pose")
    now = 0.0
    for _ in range(200):
        (probe,) = plan.take(now)
        plan.settle(probe, NO_CLOUD, now)
        due = plan.next_due(now)
        assert due is not None
        assert now <= due <= now + 10.0
        now = due


def test_an_alarm_is_the_first_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    (pose,) = rows.add("pose")
    plan.take(0.0)
    rows.add("alarm")
    plan.settle(pose, NO_CLOUD, 0.0)
    assert kinds(plan.take(100.0)) == ["alarm"]


def test_failures_in_a_row_over_all_streams_block_the_uplink() -> None:
    plan = schedule(workers=BREAKER + 1)
    rows = Rows(plan)
    for vehicle_id in range(BREAKER):
        rows.add("pose", vehicle_id=vehicle_id + 1)
    for number, parcel in enumerate(plan.take(0.0), start=1):
        plan.settle(parcel, TRY_LATER, 0.0)
        assert plan.blocked == (number >= BREAKER)


def test_a_refused_key_pauses_until_the_next_probe() -> None:
    plan = schedule()
    rows = Rows(plan)
    (pose,) = rows.add("pose")
    plan.take(0.0)
    rows.add("alarm")
    plan.settle(pose, NO_ACCESS, 0.0)
    assert plan.paused
    assert plan.take(14.9) == []
    assert plan.next_due(0.0) == 15.0
    (probe,) = plan.take(15.0)
    plan.settle(probe, CONFIRMED, 15.0)
    assert not plan.paused


def test_a_rejected_record_leaves_and_the_next_one_goes() -> None:
    plan = schedule()
    first, second = Rows(plan).add("pose", 2)
    plan.take(0.0)
    plan.settle(first, REJECTED, 0.0)
    assert plan.take(0.0) == [second]


def test_the_clouds_wish_is_heeded() -> None:
    plan = schedule()
    (parcel,) = Rows(plan).add("pose")
    plan.take(0.0)
    plan.settle(parcel, TRY_LATER._replace(retry_after_s=60.0), 0.0)
    assert plan.take(59.9) == []
    assert len(plan.take(60.1)) == 1


def test_after_a_rewind_the_record_in_flight_is_not_read_twice() -> None:
    plan = schedule()
    first, second = Rows(plan).add("pose", 2)
    plan.take(0.0)
    plan.rewind()
    assert plan.hungry() == [(first.stream, 0, PREFETCH)]
    plan.feed(first.stream, [first, second], PREFETCH)
    plan.settle(first, CONFIRMED, 0.0)
    assert plan.take(0.0) == [second]


def test_with_nothing_to_send_there_is_nothing_to_wait_for() -> None:
    plan = schedule()
    assert plan.next_due(0.0) is None
    (parcel,) = Rows(plan).add("pose")
    plan.take(0.0)
    assert plan.next_due(0.0) is None
    plan.settle(parcel, CONFIRMED, 0.0)
    assert plan.next_due(0.0) is None
