"""From outbox to disk: a post that has failed once survives the broker, in order."""

import logging
import random
import shutil
import sqlite3
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker import database
from mavlink_broker.database import DATABASE_FILE
from mavlink_broker.edge.outbox import LONGEST_PAUSE_S, SLOW_AFTER_S, Outbox, Post, Urgency
from mavlink_broker.edge.spool_writer import MAX_BATCH, RETRY_AFTER_S, SpoolWriter
from tests.support.spooled_posts import (
    numbers,
    picture,
    post,
    posts_on_disk,
    spool_in,
    state_vector,
)

LANES = ("mission_report", "alarm", "done")
ROOM = 1 << 20


class Run:
    """One run of the broker, as far as it concerns the spool."""

    def __init__(self, folder: Path, max_bytes: int = ROOM) -> None:
        self.queue = Outbox(random.Random(1))
        self.spool = spool_in(folder, max_bytes)
        self.now = 0.0
        self.writer = SpoolWriter(self.spool, self.queue, threading.Condition())

    def look(self) -> None:
        """Have the writer do one round."""
        self.writer.run_once(self.now)

    def take(self) -> Post | None:
        """Take the next post that is due."""
        self.now += LONGEST_PAUSE_S
        return self.queue.take(self.now)

    def fail(self, *, is_unreachable: bool = True) -> None:
        """Send a post while the edge server is unreachable."""
        one = self.take()
        if one is not None:
            self.queue.failed(one, self.now, is_unreachable=is_unreachable)

    def answer(self) -> Post | None:
        """Send a post that the edge server answers."""
        one = self.take()
        if one is not None:
            self.queue.answered(one)
        return one

    def left(self) -> list[Post]:
        """The posts that wait, in the order in which they are sent."""
        posts = []
        while (one := self.answer()) is not None:
            posts.append(one)
        return posts


@contextmanager
def killed(folder: Path) -> Iterator[Path]:
    """A copy of the disk as a kill -9 leaves it; the old run still uses the original."""
    with tempfile.TemporaryDirectory() as other:
        copy = Path(other) / "broker"
        shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("*-shm"))
        yield copy


ACTS = st.lists(st.sampled_from([*LANES, "fail", "answer", "answer", "look", "kill"]), max_size=25)


@settings(max_examples=60)
@given(ACTS)
def test_every_post_is_sent_once_and_in_order(acts: list[str]) -> None:
    """Each post fails at first, then the writer runs. It may be killed before it sees an answer.

    The edge server stores the first of two posts with the same key.
    """
    sent: dict[str, int] = {}  # Number by key, in the order of sending
    put: list[tuple[str, int]] = []

    def note(one: Post | None) -> None:
        if one is not None:
            sent.setdefault(str(one.idempotency_key), one.body["sequence_number"])

    with tempfile.TemporaryDirectory() as folder:
        run = Run(Path(folder))
        for number, act in enumerate(acts):
            match act:
                case "kill":
                    run.spool.database.close()
                    run = Run(Path(folder))
                case "answer":
                    note(run.answer())
                case "fail":
                    run.fail()
                case "look":
                    run.look()
                case lane:
                    put.append((lane, number))
                    run.queue.put(post(lane, number))
                    run.fail()
                    run.look()
        for one in run.left():
            note(one)
        run.spool.database.close()
    assert len(sent) == len(put)
    for lane in LANES:
        order = [number for key, number in sent.items() if key.startswith(lane)]
        assert order == [number for name, number in put if name == lane]


def test_nothing_is_written_while_the_edge_server_answers(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in range(200):
        run.queue.put(post(number=number))
        run.look()
        run.queue.put(picture(number))
        run.answer()
        run.look()
        run.answer()
        run.look()
    assert run.spool.database.writes == 0
    assert posts_on_disk(tmp_path) == []


def test_a_failed_post_and_those_behind_it_are_stored(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=1))
    run.fail(is_unreachable=False)
    run.queue.put(post(number=2))
    run.queue.put(post("alarm", 3))
    run.look()
    with killed(tmp_path) as copy:
        assert numbers(Run(copy).left()) == [1, 2]


def test_all_lanes_are_stored_while_the_edge_server_is_unreachable(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number, lane in enumerate(LANES):
        run.queue.put(post(lane, number))
    run.fail()
    run.look()
    with killed(tmp_path) as copy:
        assert sorted(numbers(Run(copy).left())) == [0, 1, 2]


def test_an_overdue_answer_counts_as_unreachable(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=1))
    run.queue.put(post(number=2))
    run.queue.put(post("alarm", 3))
    run.take()
    run.now += SLOW_AFTER_S - 0.1
    run.look()
    assert run.spool.database.writes == 0
    run.now += 0.2
    run.look()
    with killed(tmp_path) as copy:
        assert sorted(numbers(Run(copy).left())) == [1, 2, 3]


def test_posts_that_wait_for_a_failing_registration_are_stored(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post("vehicle", 0, urgency=Urgency.REGISTRATION, replaces=True))
    run.queue.put(post(number=1, needs_registration=True))
    run.queue.put(post(number=2, needs_registration=True, vehicle_id=2))
    run.fail(is_unreachable=False)
    run.look()
    with killed(tmp_path) as copy:
        assert numbers(Run(copy).left()) == [1]


def test_state_vectors_and_registrations_are_not_stored(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in range(10):
        run.queue.put(state_vector(number))
    run.queue.put(post("vehicle", 1, urgency=Urgency.REGISTRATION, replaces=True))
    run.fail()
    run.look()
    assert run.spool.database.writes == 0


def test_the_next_run_sends_inherited_posts_first_under_their_keys(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    run.fail()
    run.look()
    with killed(tmp_path) as copy:
        again = Run(copy)
        again.queue.put(post(number=8))
        left = again.left()
    assert numbers(left) == [7, 8]
    assert left[0].idempotency_key == "mission_report-7"
    assert left[0].body == post(number=7).body


def test_an_answered_post_leaves_the_disk(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in range(3):
        run.queue.put(post(number=number))
    run.fail()
    run.look()
    run.answer()
    run.look()
    with killed(tmp_path) as copy:
        assert numbers(Run(copy).left()) == [1, 2]
    run.left()
    run.look()
    assert posts_on_disk(tmp_path) == []


def test_a_vehicle_has_unsent_reports_until_the_inherited_ones_are_answered(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for vehicle_id in (1, 2):
        run.queue.put(post(number=vehicle_id, vehicle_id=vehicle_id))
    run.queue.put(post("alarm", 3, vehicle_id=3, urgency=Urgency.ALARM))
    run.queue.put(picture(4, vehicle_id=4))
    run.fail()
    run.look()
    assert run.queue.vehicles_with_unsent_reports == frozenset(), (
        "the posts of this run do not count"
    )
    with killed(tmp_path) as copy:
        again = Run(copy)
        assert again.queue.vehicles_with_unsent_reports == {1, 2}, (
            "alarms and pictures do not state the progress of a mission"
        )
        again.queue.put(post(number=5, vehicle_id=1))
        again.fail()
        assert again.queue.vehicles_with_unsent_reports == {1, 2}
        again.left()
        assert again.queue.vehicles_with_unsent_reports == frozenset()


def test_an_ending_broker_stores_all_posts_that_wait(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.writer.start()
    run.queue.put(post(number=1))
    run.queue.put(picture(2))
    run.queue.put(state_vector(3))
    run.writer.stop()
    run.spool.database.close()
    assert numbers(Run(tmp_path).left()) == [1, 2]


def test_a_broker_that_ends_while_its_spool_thread_is_restarted_stores_all_posts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = threading.Event()

    def fail(*_: object) -> None:
        failed.set()
        raise RuntimeError("an error of the program")

    run = Run(tmp_path)
    monkeypatch.setattr(SpoolWriter, "run_once", fail)
    run.queue.put(post(number=1))
    run.writer.start()
    run.writer.notify()
    assert failed.wait(30.0)
    run.writer.stop()
    run.spool.database.close()
    assert numbers(Run(tmp_path).left()) == [1]


def test_a_refusing_disk_is_logged_once_and_retried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)

    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 0.0)
    run = Run(tmp_path)
    other = sqlite3.connect(tmp_path / DATABASE_FILE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    for number in range(3):
        run.queue.put(post(number=number))
        run.fail()
        run.look()
    assert caplog.text.count("cannot store reports: database is locked") == 1
    other.close()
    run.look()
    assert len(run.queue) == 3, "they wait in memory"
    run.now += RETRY_AFTER_S
    run.look()
    assert "stores reports again" in caplog.text
    with killed(tmp_path) as copy:
        assert numbers(Run(copy).left()) == [0, 1, 2]


def test_an_evicted_picture_is_stored_again_when_there_is_space(tmp_path: Path) -> None:
    run = Run(tmp_path, 6000)
    run.queue.put(picture(0, 2000))
    run.fail()
    run.look()
    run.queue.put(post(number=1, body={"sequence_number": 1, "text": "x" * 5000}))
    run.look()
    with killed(tmp_path) as copy:
        assert numbers(Run(copy, 6000).left()) == [1]
    one = run.take()
    while one is not None and one.urgency is Urgency.PICTURE:
        run.queue.failed(one, run.now, is_unreachable=True)
        one = run.take()
    assert one is not None
    run.queue.answered(one)
    run.fail()
    run.look()
    run.now += RETRY_AFTER_S
    run.look()
    with killed(tmp_path) as copy:
        assert numbers(Run(copy, 6000).left()) == [0]


def test_without_enough_space_alarms_are_stored_first_and_refusals_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run = Run(tmp_path, 2000)
    for number in range(20):
        run.queue.put(post(number=number))
        run.queue.put(picture(number, 900))
    run.queue.put(post("alarm", 77, urgency=Urgency.ALARM))
    run.fail()
    for _ in range(5):
        run.look()
        run.now += RETRY_AFTER_S
    with killed(tmp_path) as copy:
        left = numbers(Run(copy, 2000).left())
    assert left[0] == 77
    assert left[1:] == list(range(len(left) - 1))
    assert (
        caplog.text.count("cannot store reports") == caplog.text.count("cannot store pictures") == 1
    )


def test_many_posts_are_stored_in_batches(tmp_path: Path) -> None:
    run = Run(tmp_path, 16 * ROOM)
    for number in range(2 * MAX_BATCH + 1):
        run.queue.put(post(number=number))
    run.fail()
    run.look()
    assert len(run.queue.unspooled()) == MAX_BATCH + 1
    run.writer.store_all(run.now)
    with killed(tmp_path) as copy:
        assert numbers(Run(copy).left()) == list(range(2 * MAX_BATCH + 1))


def test_an_ending_broker_stores_what_has_space_and_ends(tmp_path: Path) -> None:
    run = Run(tmp_path, 3000)
    for number in range(MAX_BATCH + 1):
        run.queue.put(picture(number, 300))
    run.queue.put(post(number=1))
    run.writer.store_all(run.now)
    with killed(tmp_path) as copy:
        assert numbers(Run(copy, 3000).left()) == [1, 0, 1, 2]
