"""A report that is never accepted is stored as a dead letter, shown, and retried by hand."""

import json
import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.cli import dead_letters
from mavlink_broker.database import add_requests, read_rows
from mavlink_broker.edge import outbox
from mavlink_broker.edge.bounded_http import EdgeConnection
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.outbox import (
    LONGEST_PAUSE_S,
    MAX_ATTEMPTS,
    DeadLetter,
    Outbox,
    Post,
    Urgency,
)
from mavlink_broker.edge.spool import read_dead_letters
from mavlink_broker.edge.spool_writer import SpoolWriter
from mavlink_broker.edge.wire import AcceptanceResult
from tests.support.broker_world import World
from tests.support.fake_edge import FakeEdgeServer
from tests.support.spooled_posts import (
    numbers,
    picture,
    post,
    posts_on_disk,
    spool_in,
    state_vector,
)

ROOM = 1 << 20
KEY = "key"


class Run:
    """One run of the broker, without threads and network."""

    def __init__(self, folder: Path, max_bytes: int = ROOM) -> None:
        self.queue = Outbox(random.Random(1))
        self.spool = spool_in(folder, max_bytes)
        self.writer = SpoolWriter(self.spool, self.queue, threading.Condition())
        self.now = 0.0
        self.sent: list[Post] = []

    def go(self, times: int, poison: int = 7, **how: Any) -> None:
        """Send posts that are due; the one with the number `poison` always fails."""
        for _ in range(times):
            self.now += LONGEST_PAUSE_S
            while (one := self.queue.take(self.now)) is not None:
                if one.body.get("sequence_number") == poison:
                    failure: dict[str, Any] = {"is_unreachable": False, "reason": "500"} | how
                    self.queue.failed(one, self.now, **failure)
                else:
                    self.queue.answered(one)
                    self.sent.append(one)
            self.writer.run_once(self.now)

    def kill(self) -> None:
        """Leave the folder to the next run."""
        self.spool.database.close()


def telemetry(run: Run, times: int, **how: Any) -> None:
    """Have other posts answered meanwhile."""
    for number in range(times):
        run.queue.put(post("pose", 1000 + number, urgency=Urgency.RESULT))
        run.go(1, **how)


def test_posts_behind_a_dead_letter_are_sent_in_order(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in (7, 8, 9):
        run.queue.put(post(number=number))
    telemetry(run, MAX_ATTEMPTS + 2)
    assert [n for n in numbers(run.sent) if n < 1000] == [8, 9]
    ((_, letter),) = read_dead_letters(tmp_path)
    assert letter.post.body["sequence_number"] == 7
    assert letter.reason == "500"
    assert run.writer.dead_letters == {1: 1}
    assert len(run.queue) == 0


@pytest.mark.parametrize(
    "how",
    [{"is_unreachable": True}, {"is_unreachable": False, "is_temporary": True}],
    ids=["away", "refused for now"],
)
def test_no_post_is_given_up_while_the_server_is_unreachable_or_refuses_temporarily(
    tmp_path: Path, how: dict[str, bool]
) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    run.go(10 * MAX_ATTEMPTS)
    if "is_temporary" in how:
        telemetry(run, 5 * MAX_ATTEMPTS, **how)
    assert read_dead_letters(tmp_path) == []
    assert len(run.queue) == 1


def test_connections_broken_by_one_post_alone_count_as_its_failures(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MAX_ATTEMPTS + 2, is_unreachable=True, reason="reset")
    assert [kept.letter.reason for kept in read_dead_letters(tmp_path)] == ["reset"]


def test_a_dead_letter_survives_the_broker_and_is_not_sent_by_itself(tmp_path: Path) -> None:
    run = Run(tmp_path)
    for number in (7, 8):
        run.queue.put(post(number=number))
    run.go(2)
    telemetry(run, MAX_ATTEMPTS + 2)
    run.kill()
    after = Run(tmp_path)
    after.go(3)
    assert after.sent == []
    assert after.writer.dead_letters == {1: 1}
    assert after.queue.vehicles_with_unsent_reports == frozenset()


def test_a_broker_killed_before_the_post_is_released_leaves_one_dead_letter(
    tmp_path: Path,
) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    run.go(2)
    (report,) = posts_on_disk(tmp_path)
    telemetry(run, MAX_ATTEMPTS + 2)
    ((number, _),) = read_dead_letters(tmp_path)
    with run.spool.database.change() as rows:
        rows.execute("INSERT INTO posts VALUES (?, 0, ?)", (number, report))
    run.kill()
    after = Run(tmp_path)
    assert len(after.queue) == 0
    assert after.writer.dead_letters == {1: 1}
    after.queue.put(post(number=8))
    after.go(1)
    assert posts_on_disk(tmp_path) == []


def test_a_retry_is_sent_once_under_its_key_and_removes_the_dead_letter(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MAX_ATTEMPTS + 2)
    ((number, letter),) = read_dead_letters(tmp_path)
    add_requests(tmp_path, "retry", [number, 999])
    run.go(2, poison=-1)
    again = [one for one in run.sent if one.body["sequence_number"] == 7]
    assert [one.idempotency_key for one in again] == [letter.post.idempotency_key]
    assert read_dead_letters(tmp_path) == []
    assert requests_in(tmp_path) == []
    run.kill()
    after = Run(tmp_path)
    assert len(after.queue) == 0
    assert after.writer.dead_letters == {}


def test_a_report_that_a_person_has_sent_again_holds_back_no_work(tmp_path: Path) -> None:
    """It may fail again; the missions of its vehicle have gone on without it before."""
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MAX_ATTEMPTS + 2)
    ((number, _),) = read_dead_letters(tmp_path)
    add_requests(tmp_path, "retry", [number])
    run.writer.run_once(0.0)
    assert len(run.queue) == 1
    assert run.queue.vehicles_with_unsent_reports == frozenset()
    run.kill()
    after = Run(tmp_path)
    assert len(after.queue) == 1
    assert after.queue.vehicles_with_unsent_reports == frozenset()


def test_a_retry_requested_while_no_broker_runs_is_done_by_the_next(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MAX_ATTEMPTS + 2)
    run.kill()
    add_requests(tmp_path, "retry", [kept.number for kept in read_dead_letters(tmp_path)])
    after = Run(tmp_path)
    after.writer.run_once(0.0)
    after.kill()  # Killed again before it was sent
    last = Run(tmp_path)
    last.go(1, poison=-1)
    assert numbers(last.sent) == [7]


def with_dead_letters(folder: Path, count: int = 1) -> tuple[Run, list[int]]:
    """A run whose first posts were given up, and their numbers."""
    run = Run(folder)
    for number in range(count):
        run.queue.put(post(("mission_report", "alarm")[number], 7, idempotency_key=f"key-{number}"))
    telemetry(run, MAX_ATTEMPTS + 2)
    dead = [kept.number for kept in read_dead_letters(folder)]
    assert len(dead) == count
    return run, dead


def requests_in(folder: Path) -> list[tuple[Any, ...]]:
    return read_rows(folder, "SELECT * FROM requests")


def keys(posts: list[Post]) -> set[str | None]:
    return {one.idempotency_key for one in posts if one.body["sequence_number"] == 7}


def test_actions_that_a_killed_broker_has_taken_are_carried_out_by_the_next(tmp_path: Path) -> None:
    run, dead = with_dead_letters(tmp_path)
    add_requests(tmp_path, "retry", dead)
    assert run.spool.dead_letters.take_actions().retry == set(dead)
    run.kill()
    after = Run(tmp_path)
    after.go(2, poison=-1)
    assert keys(after.sent) == {"key-0"}
    assert read_dead_letters(tmp_path) == []
    assert requests_in(tmp_path) == []


def test_an_action_requested_while_others_are_carried_out_comes_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, dead = with_dead_letters(tmp_path, 2)
    add_requests(tmp_path, "retry", dead[:1])
    genuine = run.spool.dead_letters.remove

    def remove(numbers: Any) -> None:
        monkeypatch.undo()
        add_requests(tmp_path, "retry", dead[1:])
        genuine(numbers)

    monkeypatch.setattr(run.spool.dead_letters, "remove", remove)
    run.go(3, poison=-1)
    assert keys(run.sent) == {"key-0", "key-1"}


def test_a_dropped_dead_letter_is_removed(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.queue.put(post(number=7))
    telemetry(run, MAX_ATTEMPTS + 2)
    add_requests(tmp_path, "drop", [kept.number for kept in read_dead_letters(tmp_path)])
    run.go(1)
    assert read_dead_letters(tmp_path) == []
    assert run.writer.dead_letters == {}


def test_without_space_the_oldest_dead_letters_are_removed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run = Run(tmp_path, 16_000)
    for number in range(8):
        run.queue.put(picture(7, 900, idempotency_key=f"key-{number}"))
    telemetry(run, 14 * MAX_ATTEMPTS)  # One post in four is not the most urgent
    kept = [letter.post.idempotency_key for _, letter in read_dead_letters(tmp_path)]
    assert kept == [f"key-{number}" for number in range(8)][-len(kept) :]
    assert 1 < len(kept) < 8
    assert "is removed: there is no space" in caplog.text
    assert len(run.queue) == 0


def test_a_failing_state_vector_is_dropped_and_a_failing_registration_blocks_no_report(
    tmp_path: Path,
) -> None:
    run = Run(tmp_path)
    run.queue.put(state_vector(7))
    for number in range(2 * MAX_ATTEMPTS):
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
    assert 100 in numbers(run.sent)
    assert read_dead_letters(tmp_path) == []


@pytest.mark.parametrize("garbage", [b"", b"\0" * 100, b"deadbeef {}"])
def test_a_damaged_row_costs_itself_alone(tmp_path: Path, garbage: bytes) -> None:
    run, (number,) = with_dead_letters(tmp_path)
    with run.spool.database.change() as rows:
        rows.execute("INSERT INTO dead_letters VALUES (?, ?)", (number + 1, garbage))
    run.kill()
    after = Run(tmp_path)
    assert after.writer.dead_letters == {1: 1}
    assert read_rows(tmp_path, "SELECT source, data FROM damaged") == [("dead_letters", garbage)]


@pytest.fixture
def server() -> Iterator[FakeEdgeServer]:
    with FakeEdgeServer(0, KEY).running() as running:
        yield running


def until(true: Any) -> None:
    end = time.monotonic() + 30.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.thorough
def test_a_dead_letter_over_http_from_the_first_500_to_the_retry_at_the_terminal(
    server: FakeEdgeServer,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(outbox, "MAX_ATTEMPTS", 3)
    monkeypatch.setattr(outbox, "LONGEST_PAUSE_S", 0.02)
    (tmp_path / "broker.key").write_text(KEY)
    server.judge = lambda _, body: 500 if body.get("sequence_number") == 7 else None
    spool = spool_in(tmp_path / "broker")
    client = EdgeClient(server.url, tmp_path / "broker.key", lambda: None, spool=spool)
    client.start()
    for number in (7, 8):
        client.post(post(number=number))

    def is_given_up() -> bool:
        client.post(post("pose", 1000))
        return client.dead_letters_of(1) == 1

    until(is_given_up)
    until(lambda: read_dead_letters(tmp_path / "broker"))
    assert [b["sequence_number"] for b in server.wait_for("/mission_report/", 1)] == [8]
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


ACCEPTED = {"status": "accepted"}


def acceptance(**changed: Any) -> Post:
    """The acceptance of work 41."""
    path = "/broker/commands/41/ack"
    return post(path=path, body=ACCEPTED, idempotency_key=None, accepted_work_id=41, **changed)


@pytest.mark.parametrize("status", [500, 422], ids=["given up", "refused for good"])
def test_an_acceptance_that_fails_is_no_dead_letter_and_its_mission_must_be_reported(
    server: FakeEdgeServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    monkeypatch.setattr(outbox, "MAX_ATTEMPTS", 3)
    monkeypatch.setattr(outbox, "LONGEST_PAUSE_S", 0.02)
    (tmp_path / "broker.key").write_text(KEY)
    server.judge = lambda path, _: status if path.endswith("/ack") else None
    spool = spool_in(tmp_path / "broker")
    client = EdgeClient(server.url, tmp_path / "broker.key", lambda: None, spool=spool)
    client.start()
    client.post(acceptance())
    results: list[AcceptanceResult] = []

    def has_result() -> bool:
        client.post(post("pose", 1000))
        results.extend(client.take_acceptance_results())
        return bool(results)

    until(has_result)
    client.stop(5.0)
    (result,) = results
    assert (result.work_id, result.is_confirmed, result.has_failed) == (41, False, True)
    assert f"did not confirm the acceptance: HTTP {status}" in result.reason
    assert read_dead_letters(tmp_path / "broker") == []
    assert client.dead_letters_of(1) == 0
    assert posts_on_disk(tmp_path / "broker") == []


def test_an_acceptance_that_an_earlier_version_has_stored_is_removed_by_a_retry(
    tmp_path: Path,
) -> None:
    run = Run(tmp_path)
    run.spool.dead_letters.add(1, DeadLetter(acceptance(), "HTTP 500"))
    add_requests(tmp_path, "retry", [1])
    run.go(2)
    assert run.sent == []
    assert read_dead_letters(tmp_path) == []


def test_a_repeated_internal_error_fails_the_acceptance_with_its_reason(
    server: FakeEdgeServer,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(outbox, "MAX_ATTEMPTS", 3)
    monkeypatch.setattr(outbox, "LONGEST_PAUSE_S", 0.02)
    (tmp_path / "broker.key").write_text(KEY)
    genuine = EdgeConnection.request

    def request(self: EdgeConnection, *args: Any, **named: Any) -> Any:
        if named.get("body") == ACCEPTED:
            raise RuntimeError("cannot be put into bytes")
        return genuine(self, *args, **named)

    monkeypatch.setattr(EdgeConnection, "request", request)
    spool = spool_in(tmp_path / "broker")
    client = EdgeClient(server.url, tmp_path / "broker.key", lambda: None, spool=spool)
    client.start()
    client.post(acceptance())

    def has_failed() -> bool:
        client.post(post("pose", 1000))
        return any(
            result.has_failed and "cannot be put into bytes" in result.reason
            for result in client.take_acceptance_results()
        )

    until(has_failed)
    client.stop(1.0)
    assert read_dead_letters(tmp_path / "broker") == []
    assert "thread edge-send" not in caplog.text


def test_without_a_spool_dead_letters_are_counted_in_memory() -> None:
    queue = Outbox(random.Random(1))
    for number in range(2):
        queue.put(post(number=7, idempotency_key=f"key-{number}"))
    now = 0.0
    for number in range(3 * MAX_ATTEMPTS):
        now += LONGEST_PAUSE_S
        queue.put(post("pose", 1000 + number, urgency=Urgency.RESULT))
        while (one := queue.take(now)) is not None:
            if one.lane == "pose":
                queue.answered(one)
            else:
                queue.failed(one, now, is_unreachable=False)
    assert queue.dead_letters_of(1) == 2
    assert queue.dead_letters_of(2) == 0
    assert len(queue) == 0


def test_dead_letters_are_shown_with_their_vehicle() -> None:
    world = World()
    world.add_vehicle(1)
    world.edge.dead_letters = {1: 2}
    world.run(3.0)
    assert "2 reports could not be delivered" in world.edge.bodies("/vehicles/1")[-1]["warning"]


def test_a_folder_without_a_file_has_no_dead_letters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert dead_letters.run(["--state-dir", str(tmp_path)], {}) == 0
    assert capsys.readouterr().out == "0 dead letters\n"
    assert not (tmp_path / "broker").exists()
