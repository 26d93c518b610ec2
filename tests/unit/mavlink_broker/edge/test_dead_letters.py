"""A report that is never taken costs itself: it is kept on disk, shown, and retried by hand."""

import json
import os
import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.cli import dead_letters
from mavlink_broker.edge import outbox
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.dead_letters import DEAD, ORDERS, order, read_all
from mavlink_broker.edge.http import Door
from mavlink_broker.edge.outbox import LONGEST_PAUSE_S, MOST_ATTEMPTS, Post, SendQueue, Urgency
from mavlink_broker.edge.spool import LOCK, Spool
from mavlink_broker.edge.spool_writer import Keeper
from mavlink_broker.edge.work import Verdict
from tests.support.broker_world import World
from tests.support.fake_edge import FakeEdgeServer
from tests.support.spooled_posts import numbers, picture, post, state_vector

ROOM = 1 << 20
KEY = "key"


class Run:
    """One run of the broker, without threads and network."""

    def __init__(self, folder: Path, most_bytes: int = ROOM) -> None:
        self.queue = SendQueue(random.Random(1))
        self.spool = Spool(folder, most_bytes=most_bytes)
        self.keeper = Keeper(self.spool, self.queue, threading.Condition())
        self.now = 0.0
        self.told: list[Post] = []

    def go(self, times: int, poison: int = 7, **how: Any) -> None:
        """Send what is due; the post of one number is never taken."""
        for _ in range(times):
            self.now += LONGEST_PAUSE_S
            while (one := self.queue.take(self.now)) is not None:
                if one.body.get("sequence_number") == poison:
                    failure: dict[str, Any] = {"cut_off": False, "reason": "500"} | how
                    self.queue.failed(one, self.now, **failure)
                else:
                    self.queue.answered(one)
                    self.told.append(one)
            self.keeper.go_round(self.now)

    def kill(self) -> None:
        """Leave the folder to the next run."""
        self.spool.close()


def telemetry(run: Run, times: int, **how: Any) -> None:
    """Have others answered all the time."""
    for number in range(times):
        run.queue.put(post("pose", 1000 + number, urgency=Urgency.RESULT))
        run.go(1, **how)


def test_what_waits_behind_it_is_told_in_order(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in (7, 8, 9):
        run.queue.put(post(number=number))
    telemetry(run, MOST_ATTEMPTS + 2)
    assert [n for n in numbers(run.told) if n < 1000] == [8, 9]
    ((_, letter),) = read_all(tmp_path)
    assert letter.post.body["sequence_number"] == 7
    assert letter.reason == "500"
    assert run.keeper.dead_letters == {1: 1}
    assert len(run.queue) == 0


@pytest.mark.parametrize(
    "how", [{"cut_off": True}, {"cut_off": False, "waits": True}], ids=["away", "refused for now"]
)
def test_while_nobody_is_answered_or_it_is_refused_on_purpose_nothing_is_given_up(
    tmp_path: Path, how: dict[str, bool]
) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    run.go(10 * MOST_ATTEMPTS)
    if "waits" in how:
        telemetry(run, 5 * MOST_ATTEMPTS, **how)
    assert read_all(tmp_path) == []
    assert len(run.queue) == 1


def test_a_connection_that_it_always_breaks_counts_too(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MOST_ATTEMPTS + 2, cut_off=True, reason="reset")
    assert [kept.letter.reason for kept in read_all(tmp_path)] == ["reset"]


def test_it_outlives_the_broker_and_is_not_told_again_by_itself(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in (7, 8):
        run.queue.put(post(number=number))
    run.go(2)
    telemetry(run, MOST_ATTEMPTS + 2)
    run.kill()
    after = Run(tmp_path)
    after.go(3)
    assert after.told == []
    assert after.keeper.dead_letters == {1: 1}
    assert after.queue.owing == frozenset()


def test_killed_between_the_dead_letter_and_the_line_it_came_from_there_is_one(
    tmp_path: Path,
) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    run.go(2)
    words = (tmp_path / "spool.words").read_bytes()
    telemetry(run, MOST_ATTEMPTS + 2)
    run.kill()
    (tmp_path / "spool.words").write_bytes(words)
    after = Run(tmp_path)
    assert len(after.queue) == 0
    assert after.keeper.dead_letters == {1: 1}


def test_a_retry_is_told_once_under_its_own_key_and_is_gone(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MOST_ATTEMPTS + 2)
    ((number, letter),) = read_all(tmp_path)
    order(tmp_path, "retry", [number, 999])
    run.go(2, poison=-1)
    again = [one for one in run.told if one.body["sequence_number"] == 7]
    assert [one.idempotency_key for one in again] == [letter.post.idempotency_key]
    assert read_all(tmp_path) == []
    assert not (tmp_path / ORDERS).exists()
    run.kill()
    after = Run(tmp_path)
    assert len(after.queue) == 0
    assert after.keeper.dead_letters == {}


def test_a_retry_asked_for_while_no_broker_runs_is_done_by_the_next(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MOST_ATTEMPTS + 2)
    run.kill()
    order(tmp_path, "retry", [kept.number for kept in read_all(tmp_path)])
    after = Run(tmp_path)
    after.keeper.go_round(0.0)
    after.kill()  # Killed again before it was told
    last = Run(tmp_path)
    last.go(1, poison=-1)
    assert numbers(last.told) == [7]


def with_dead_letters(folder: Path, count: int = 1) -> tuple[Run, list[int]]:
    """A run whose first posts were given up, and their numbers."""
    run = Run(folder)
    for number in range(count):
        run.queue.put(post(("mission_report", "alarm")[number], 7, idempotency_key=f"key-{number}"))
    telemetry(run, MOST_ATTEMPTS + 2)
    dead = [kept.number for kept in read_all(folder)]
    assert len(dead) == count
    return run, dead


def keys(posts: list[Post]) -> set[str | None]:
    return {one.idempotency_key for one in posts if one.body["sequence_number"] == 7}


def test_orders_that_a_killed_broker_has_read_are_carried_out_by_the_next(tmp_path: Path) -> None:
    run, dead = with_dead_letters(tmp_path)
    order(tmp_path, "retry", dead)
    assert run.spool.dead.take_orders().retry == set(dead)
    run.kill()
    after = Run(tmp_path)
    after.go(2, poison=-1)
    assert keys(after.told) == {"key-0"}
    assert read_all(tmp_path) == []
    assert list(tmp_path.glob("*orders*")) == []


def test_an_order_that_comes_while_others_are_carried_out_is_carried_out_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, dead = with_dead_letters(tmp_path, 2)
    order(tmp_path, "retry", dead[:1])
    genuine = run.spool.dead.remove

    def remove(numbers: Any) -> None:
        monkeypatch.undo()
        order(tmp_path, "retry", dead[1:])
        genuine(numbers)

    monkeypatch.setattr(run.spool.dead, "remove", remove)
    run.go(3, poison=-1)
    assert keys(run.told) == {"key-0", "key-1"}


def test_an_order_into_a_file_that_was_opened_before_it_was_taken_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, dead = with_dead_letters(tmp_path, 2)
    order(tmp_path, "retry", dead[:1])
    genuine = os.open

    def opened(path: Any, *how: Any, **named: Any) -> int:
        descriptor = genuine(path, *how, **named)
        if Path(path).name == ORDERS:
            monkeypatch.undo()
            run.go(1, poison=-1)
        return descriptor

    monkeypatch.setattr(os, "open", opened)
    order(tmp_path, "retry", dead[1:])
    run.go(2, poison=-1)
    assert keys(run.told) == {"key-0", "key-1"}


def test_an_order_behind_a_mebibyte_of_others_and_a_broken_line_is_carried_out(
    tmp_path: Path,
) -> None:
    run, dead = with_dead_letters(tmp_path)
    order(tmp_path, "retry", range(10_000_000, 10_000_000 + 80_000))
    with (tmp_path / ORDERS).open("ab") as file:
        file.write(b"x" * 1000 + b"\n")
    order(tmp_path, "retry", dead)
    run.go(2, poison=-1)
    assert keys(run.told) == {"key-0"}


def test_one_that_is_dropped_is_gone(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MOST_ATTEMPTS + 2)
    order(tmp_path, "drop", [kept.number for kept in read_all(tmp_path)])
    run.go(1)
    assert read_all(tmp_path) == []
    assert run.keeper.dead_letters == {}


def test_without_room_the_oldest_go_and_the_line_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run = Run(tmp_path, 16_000)
    for number in range(8):
        run.queue.put(picture(7, 900, idempotency_key=f"key-{number}"))
    telemetry(run, 9 * MOST_ATTEMPTS)
    kept = [letter.post.idempotency_key for _, letter in read_all(tmp_path)]
    assert kept == [f"key-{number}" for number in range(8)][-len(kept) :]
    assert 1 < len(kept) < 8
    assert "is given up: there is no room" in caplog.text
    assert len(run.queue) == 0


def test_a_state_vector_is_dropped_and_a_registration_lets_its_vehicle_go_on(
    tmp_path: Path,
) -> None:
    run = Run(tmp_path)
    run.queue.put(state_vector(7))
    for number in range(2 * MOST_ATTEMPTS):
        registration = post(
            "vehicle",
            7,
            vehicle_id=3,
            urgency=Urgency.REGISTRATION,
            replaces=True,
            idempotency_key=None,
        )
        run.queue.put(registration)
        run.queue.put(post(number=number + 100, vehicle_id=3, needs_registration=True))
        telemetry(run, 1)
    assert 100 in numbers(run.told)
    assert read_all(tmp_path) == []


@pytest.mark.parametrize("garbage", [b"", b"\0" * 100, b"deadbeef {}\n", b"retry 1\n"])
def test_a_damaged_file_costs_what_is_damaged(tmp_path: Path, garbage: bytes) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MOST_ATTEMPTS + 2)
    run.kill()
    line = (tmp_path / DEAD).read_bytes()
    (tmp_path / DEAD).write_bytes(garbage + (b"\n" if garbage[-1:] not in b"\n" else b"") + line)
    after = Run(tmp_path)
    assert after.keeper.dead_letters == {1: 1}


@pytest.fixture
def server() -> Iterator[FakeEdgeServer]:
    with FakeEdgeServer(0, KEY).running() as running:
        yield running


def until(true: Any) -> None:
    end = time.monotonic() + 30.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_over_http_from_the_first_500_to_the_retry_at_the_terminal(
    server: FakeEdgeServer,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(outbox, "MOST_ATTEMPTS", 3)
    monkeypatch.setattr(outbox, "LONGEST_PAUSE_S", 0.02)
    (tmp_path / "broker.key").write_text(KEY)
    server.judge = lambda _, body: 500 if body.get("sequence_number") == 7 else None
    spool = Spool(tmp_path / "broker", most_bytes=ROOM)
    client = EdgeClient(server.url, tmp_path / "broker.key", lambda: None, spool=spool)
    client.start()
    acceptance = post("mission_report", 7, accepts=41)
    for one in (acceptance, post(number=8)):
        client.post(one)

    def is_given_up() -> bool:
        client.post(post("pose", 1000))
        return client.dead_letters_of(1) == 1

    until(is_given_up)
    assert [b["sequence_number"] for b in server.wait_for("/mission_report/", 1)] == [8]
    until(lambda: client.take_verdicts() == [Verdict(41, holds=False)])
    state = ["--state-dir", str(tmp_path)]
    assert dead_letters.run(["list", "--json", *state], {}) == 0
    (shown,) = json.loads(capsys.readouterr().out)["dead_letters"]
    assert shown["body"]["sequence_number"] == 7
    assert shown["reason"].startswith("HTTP 500")
    server.judge = lambda *_: None
    assert dead_letters.run(["retry", "999", *state], {}) == 1
    assert dead_letters.run(["retry", str(shown["number"]), *state], {}) == 0
    bodies = server.wait_for("/mission_report/", 2, timeout_s=30.0)
    assert [b["sequence_number"] for b in bodies] == [8, 7]
    until(lambda: client.dead_letters_of(1) == 0)
    client.stop(1.0)


def test_an_internal_error_that_always_comes_back_withdraws_the_acceptance_with_its_reason(
    server: FakeEdgeServer,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(outbox, "MOST_ATTEMPTS", 3)
    monkeypatch.setattr(outbox, "LONGEST_PAUSE_S", 0.02)
    (tmp_path / "broker.key").write_text(KEY)
    genuine = Door.request

    def request(self: Door, *args: Any, **named: Any) -> Any:
        if (named.get("body") or {}).get("sequence_number") == 7:
            raise RuntimeError("cannot be put into bytes")
        return genuine(self, *args, **named)

    monkeypatch.setattr(Door, "request", request)
    spool = Spool(tmp_path / "broker", most_bytes=ROOM)
    client = EdgeClient(server.url, tmp_path / "broker.key", lambda: None, spool=spool)
    client.start()
    client.post(post("mission_report", 7, accepts=41))

    def is_withdrawn() -> bool:
        client.post(post("pose", 1000))
        return client.take_verdicts() == [Verdict(41, holds=False)]

    until(is_withdrawn)
    until(lambda: read_all(tmp_path / "broker"))
    client.stop(1.0)
    ((_, letter),) = read_all(tmp_path / "broker")
    assert "cannot be put into bytes" in letter.reason
    assert "thread edge-send" not in caplog.text


def test_without_a_disk_they_are_counted_in_memory_and_bounded() -> None:
    queue = SendQueue(random.Random(1))
    for number in range(2):
        queue.put(post(number=7, idempotency_key=f"key-{number}"))
    now = 0.0
    for number in range(3 * MOST_ATTEMPTS):
        now += LONGEST_PAUSE_S
        queue.put(post("pose", 1000 + number, urgency=Urgency.RESULT))
        while (one := queue.take(now)) is not None:
            if one.lane == "pose":
                queue.answered(one)
            else:
                queue.failed(one, now, cut_off=False)
    assert queue.dead_of(1) == 2
    assert queue.dead_of(2) == 0
    assert len(queue) == 0


def test_they_are_shown_with_their_vehicle() -> None:
    world = World()
    world.add_vehicle(1)
    world.edge.dead_letters = {1: 2}
    world.run(3.0)
    assert "2 reports could not be delivered" in world.edge.bodies("/vehicles/1")[-1]["warning"]


def test_a_folder_without_any_has_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert dead_letters.run(["--state-dir", str(tmp_path)], {}) == 0
    assert capsys.readouterr().out == "0 dead letters\n"
    assert not (tmp_path / "broker" / LOCK).exists()
