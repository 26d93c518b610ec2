"""Between queue and disk: what has failed once outlives the broker, in order, under its key."""

import errno
import logging
import os
import random
import shutil
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_broker.edge.outbox import LONGEST_PAUSE_S, SLOW_AFTER_S, Post, SendQueue, Urgency
from mavlink_broker.edge.spool import LOCK, WORDS, Spool
from mavlink_broker.edge.spool_writer import MOST_AT_ONCE, TRY_AGAIN_S, Keeper
from tests.support.spooled_posts import numbers, picture, post, state_vector

LANES = ("mission_report", "alarm", "done")
ROOM = 1 << 20


class Run:
    """One run of the broker, as far as it concerns the spool."""

    def __init__(self, folder: Path, most_bytes: int = ROOM) -> None:
        self.queue = SendQueue(random.Random(1))
        self.spool = Spool(folder, most_bytes=most_bytes)
        self.now = 0.0
        self.keeper = Keeper(self.spool, self.queue, threading.Condition())

    def look(self) -> None:
        """Let the keeper do what there is to do."""
        self.keeper.go_round(self.now)

    def take(self) -> Post | None:
        """Begin to send what is due."""
        self.now += LONGEST_PAUSE_S
        return self.queue.take(self.now)

    def fail(self, *, cut_off: bool = True) -> None:
        """Try to tell something to an edge server that is not there."""
        one = self.take()
        if one is not None:
            self.queue.failed(one, self.now, cut_off=cut_off)

    def answer(self) -> Post | None:
        """Tell something to an edge server that is there."""
        one = self.take()
        if one is not None:
            self.queue.answered(one)
        return one

    def left(self) -> list[Post]:
        """What waits, in the order in which it is told."""
        posts = []
        while (one := self.answer()) is not None:
            posts.append(one)
        return posts


@contextmanager
def killed(folder: Path) -> Iterator[Path]:
    """The disk as a kill -9 leaves it, in another place: the old run still breathes here."""
    with tempfile.TemporaryDirectory() as other:
        grave = Path(other) / "broker"
        shutil.copytree(folder, grave, ignore=shutil.ignore_patterns(LOCK))
        yield grave


ACTS = st.lists(st.sampled_from([*LANES, "fail", "answer", "answer", "look", "kill"]), max_size=25)


@settings(max_examples=60)
@given(ACTS)
def test_every_word_is_told_once_and_in_order_whatever_happens(acts: list[str]) -> None:
    """What comes fails at first, and the keeper looks. It may be killed before it sees an answer.

    The edge server keeps the first of two that have the same key.
    """
    told: dict[str, int] = {}  # Number by key, in the order of telling
    put: list[tuple[str, int]] = []

    def tell(one: Post | None) -> None:
        if one is not None:
            told.setdefault(str(one.idempotency_key), one.body["sequence_number"])

    with tempfile.TemporaryDirectory() as folder:
        run = Run(Path(folder))
        for number, act in enumerate(acts):
            match act:
                case "kill":
                    run.spool.close()
                    run = Run(Path(folder))
                case "answer":
                    tell(run.answer())
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
            tell(one)
        run.spool.close()
    assert len(told) == len(put)
    for lane in LANES:
        order = [number for key, number in told.items() if key.startswith(lane)]
        assert order == [number for name, number in put if name == lane]


def test_while_the_edge_server_answers_nothing_is_written(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in range(200):
        run.queue.put(post(number=number))
        run.look()
        run.queue.put(picture(number))
        run.answer()
        run.look()
        run.answer()
        run.look()
    assert run.spool.writes == 0
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]


def test_what_has_failed_is_kept_and_so_is_what_waits_behind_it(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=1))
    run.fail(cut_off=False)
    run.queue.put(post(number=2))
    run.queue.put(post("alarm", 3))
    run.look()
    with killed(tmp_path) as grave:
        assert numbers(Run(grave).left()) == [1, 2]


def test_an_edge_server_that_is_not_there_is_there_for_nobody(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number, lane in enumerate(LANES):
        run.queue.put(post(lane, number))
    run.fail()
    run.look()
    with killed(tmp_path) as grave:
        assert sorted(numbers(Run(grave).left())) == [0, 1, 2]


def test_an_answer_that_is_overdue_is_none(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=1))
    run.queue.put(post(number=2))
    run.queue.put(post("alarm", 3))
    run.take()
    run.now += SLOW_AFTER_S - 0.1
    run.look()
    assert run.spool.writes == 0
    run.now += 0.2
    run.look()
    with killed(tmp_path) as grave:
        assert sorted(numbers(Run(grave).left())) == [1, 2, 3]


def test_what_waits_for_a_registration_that_fails_is_kept(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post("vehicle", 0, urgency=Urgency.REGISTRATION, replaces=True))
    run.queue.put(post(number=1, needs_registration=True))
    run.queue.put(post(number=2, needs_registration=True, vehicle_id=2))
    run.fail(cut_off=False)
    run.look()
    with killed(tmp_path) as grave:
        assert numbers(Run(grave).left()) == [1]


def test_state_vectors_and_descriptions_are_not_kept(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in range(10):
        run.queue.put(state_vector(number))
    run.queue.put(post("vehicle", 1, urgency=Urgency.REGISTRATION, replaces=True))
    run.fail()
    run.look()
    assert run.spool.writes == 0


def test_the_next_run_tells_what_was_left_first_and_under_its_keys(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    run.fail()
    run.look()
    with killed(tmp_path) as grave:
        again = Run(grave)
        again.queue.put(post(number=8))
        left = again.left()
    assert numbers(left) == [7, 8]
    assert left[0].idempotency_key == "mission_report-7"
    assert left[0].body == post(number=7).body


def test_what_was_answered_leaves_the_disk(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in range(3):
        run.queue.put(post(number=number))
    run.fail()
    run.look()
    run.answer()
    run.look()
    with killed(tmp_path) as grave:
        assert numbers(Run(grave).left()) == [1, 2]
    run.left()
    run.look()
    assert (tmp_path / WORDS).read_bytes() == b""


def test_a_vehicle_owes_until_what_was_left_of_it_has_its_answer(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for vehicle_id in (1, 2):
        run.queue.put(post(number=vehicle_id, vehicle_id=vehicle_id))
    run.queue.put(post("alarm", 3, vehicle_id=3, urgency=Urgency.ALARM))
    run.queue.put(picture(4, vehicle_id=4))
    run.fail()
    run.look()
    assert run.queue.owing == frozenset(), "this run knows what it has said"
    with killed(tmp_path) as grave:
        again = Run(grave)
        assert again.queue.owing == {1, 2}, "neither alarms nor pictures say how far a mission is"
        again.queue.put(post(number=5, vehicle_id=1))
        again.fail()
        assert again.queue.owing == {1, 2}
        again.left()
        assert again.queue.owing == frozenset()


def test_an_ending_broker_keeps_everything_that_waits(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.keeper.start()
    run.queue.put(post(number=1))
    run.queue.put(picture(2))
    run.queue.put(state_vector(3))
    run.keeper.stop()
    assert numbers(Run(tmp_path).left()) == [1, 2]


def test_a_broker_that_ends_while_its_spool_pauses_behind_a_failure_keeps_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = threading.Event()

    def fail(*_: object) -> None:
        failed.set()
        raise RuntimeError("an error of the program")

    run = Run(tmp_path)
    monkeypatch.setattr(Keeper, "go_round", fail)
    run.queue.put(post(number=1))
    run.keeper.start()
    run.keeper.nudge()
    assert failed.wait(30.0)
    run.keeper.stop()
    assert numbers(Run(tmp_path).left()) == [1]


def test_a_disk_that_refuses_is_told_once_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    run = Run(tmp_path)
    write = os.write
    monkeypatch.setattr(os, "write", full)
    for number in range(3):
        run.queue.put(post(number=number))
        run.fail()
        run.look()
    assert caplog.text.count("No space left") == 1
    monkeypatch.setattr(os, "write", write)
    run.look()
    assert len(run.queue) == 3, "they wait in memory, as ever"
    run.now += TRY_AGAIN_S
    run.look()
    assert "takes words again" in caplog.text
    with killed(tmp_path) as grave:
        assert numbers(Run(grave).left()) == [0, 1, 2]


def test_a_picture_that_gave_way_is_kept_when_there_is_room_again(tmp_path: Path) -> None:
    run = Run(tmp_path, 6000)
    run.queue.put(picture(0, 2000))
    run.fail()
    run.look()
    run.queue.put(post(number=1, body={"sequence_number": 1, "text": "x" * 5000}))
    run.look()
    with killed(tmp_path) as grave:
        assert numbers(Run(grave, 6000).left()) == [1]
    one = run.take()
    while one is not None and one.urgency is Urgency.PICTURE:
        run.queue.failed(one, run.now, cut_off=True)
        one = run.take()
    assert one is not None
    run.queue.answered(one)
    run.fail()
    run.look()
    run.now += TRY_AGAIN_S
    run.look()
    with killed(tmp_path) as grave:
        assert numbers(Run(grave, 6000).left()) == [0]


def test_when_not_all_has_room_alarms_are_kept_and_refusals_told_once(
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
        run.now += TRY_AGAIN_S
    with killed(tmp_path) as grave:
        left = numbers(Run(grave, 2000).left())
    assert left[0] == 77
    assert left[1:] == list(range(len(left) - 1))
    assert caplog.text.count("no more words") == caplog.text.count("no more pictures") == 1


def test_much_is_kept_bit_by_bit(tmp_path: Path) -> None:
    run = Run(tmp_path, 16 * ROOM)
    for number in range(2 * MOST_AT_ONCE + 1):
        run.queue.put(post(number=number))
    run.fail()
    run.look()
    assert len(run.queue.unkept()) == MOST_AT_ONCE + 1
    run.keeper.keep_everything(run.now)
    with killed(tmp_path) as grave:
        assert numbers(Run(grave).left()) == list(range(2 * MOST_AT_ONCE + 1))


def test_an_ending_broker_keeps_what_has_room_and_ends(tmp_path: Path) -> None:
    run = Run(tmp_path, 3000)
    for number in range(MOST_AT_ONCE + 1):
        run.queue.put(picture(number, 300))
    run.queue.put(post(number=1))
    run.keeper.keep_everything(run.now)
    with killed(tmp_path) as grave:
        assert numbers(Run(grave, 3000).left()) == [1, 0, 1, 2]
