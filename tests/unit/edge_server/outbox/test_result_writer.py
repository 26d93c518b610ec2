"""Answers are written in groups, kept when they cannot be, and find room on a full disk."""

import sqlite3
import threading
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from edge_server.config import Config
from edge_server.outbox import queue
from edge_server.outbox.answers import Outcome, Result
from edge_server.outbox.queue import OutboxRecord, Stream, Trigger
from edge_server.outbox.relay import RelayError
from edge_server.outbox.result_writer import (
    GROUP,
    GROUP_WAIT_S,
    HOUSEKEEPING_S,
    MAXIMUM_PENDING,
    RETRY_S,
    TOMBSTONES_KEPT_S,
    RecordResult,
    ResultWriter,
)
from edge_server.outbox.steady_clock import STEADY_S
from edge_server.process import relay
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine
from edge_server.store.files import ballast, integrity
from edge_server.store.rows import telemetry
from tests.support.databases import count_outbox, empty_sqlite

POSES = Stream(1, "pose")
CONFIRMED = Result(Outcome.CONFIRMED, "200", 200)


@pytest.fixture
def database(tmp_path: Path) -> Database:
    """An empty database."""
    return Database(open_engine(empty_sqlite(tmp_path / "edge.sqlite3")))


def records(database: Database, number: int) -> list[OutboxRecord]:
    """Records that are due."""
    with database.write() as connection:
        for each in range(number):
            record_id = telemetry.add(
                connection,
                kind="pose",
                vehicle_id=1,
                message_id=f"{each:026d}",
                payload="{}",
                received_at=0.0,
            )
            queue.enqueue(connection, record_id, POSES)
        return queue.read_queued(connection, POSES, 0, number)


def waiting(database: Database) -> int:
    with database.read() as connection:
        return count_outbox(connection)


def confirmed(record: OutboxRecord) -> RecordResult:
    return RecordResult(record, Trigger.CONFIRMED, CONFIRMED)


@pytest.mark.parametrize("is_set_forward", [True, False])
def test_tombstones_are_deleted_by_a_clock_that_has_run_steadily(
    database: Database, is_set_forward: bool
) -> None:
    """By a clock that was set forward, a repeated record would be delivered twice."""
    (record,) = records(database, 1)
    writer = ResultWriter(database)
    writer.add(confirmed(record), 0.0)
    writer.write(0.0, 0.0)
    late = TOMBSTONES_KEPT_S + 2.0
    now = HOUSEKEEPING_S + 1.0 if is_set_forward else late
    writer.write(now, late)
    assert tombstones(database) == is_set_forward
    writer.write(now + STEADY_S, late + STEADY_S)
    assert tombstones(database) == 0


def tombstones(database: Database) -> int:
    with database.read() as connection:
        return int(connection.execute(text("SELECT count(*) FROM tombstone")).scalar_one())


def test_a_group_is_written_when_it_is_large_or_old_or_nothing_else_happens(
    database: Database,
) -> None:
    writer = ResultWriter(database)
    writer.write(0.0, 0.0)
    assert not writer.is_due(1.0, idle=True)
    (first, *rest) = records(database, GROUP)
    writer.add(confirmed(first), 1.0)
    assert not writer.is_due(1.0, idle=False)
    assert writer.is_due(1.0, idle=True)
    assert writer.is_due(1.0 + GROUP_WAIT_S, idle=False)
    for record in rest:
        writer.add(confirmed(record), 1.0)
    assert writer.is_due(1.0, idle=False)
    writer.write(1.0, 0.0)
    assert waiting(database) == 0
    assert not writer.is_due(1.0, idle=True)


def refuse(name: str) -> OperationalError:
    error = sqlite3.OperationalError("not now")
    error.sqlite_errorname = name
    return OperationalError("", {}, error)


def test_what_cannot_be_written_is_kept_and_tried_again(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = ResultWriter(database)
    (record,) = records(database, 1)
    writer.add(confirmed(record), 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(
            queue, "delete_delivered", lambda *_: (_ for _ in ()).throw(refuse("SQLITE_BUSY"))
        )
        writer.write(0.0, 0.0)
    assert waiting(database) == 1
    assert not writer.is_due(RETRY_S / 2, idle=True)
    assert writer.is_due(RETRY_S, idle=True)
    writer.write(RETRY_S, 0.0)
    assert waiting(database) == 0


def test_on_a_full_disk_the_ballast_is_given_up_and_it_goes_on_at_once(
    database: Database, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    held = tmp_path / "ballast"
    assert ballast.hold(held)
    writer = ResultWriter(database, held)
    (record,) = records(database, 1)
    writer.add(confirmed(record), 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(
            queue, "delete_delivered", lambda *_: (_ for _ in ()).throw(refuse("SQLITE_FULL"))
        )
        writer.write(0.0, 0.0)
        assert not held.exists()
        assert writer.is_due(0.0, idle=True)
        writer.write(0.0, 0.0)
        assert not writer.is_due(0.0, idle=True)
    writer.write(RETRY_S, 0.0)
    assert waiting(database) == 0


@pytest.mark.thorough
def test_after_a_full_disk_it_deletes_in_small_groups_and_then_in_large_ones_again(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the number for which there is room, all of it is written in the end."""
    writer, settle, sizes = ResultWriter(database), queue.delete_delivered, []
    room = 3

    def settle_few(connection: Any, delivered: Any, at: float) -> list[OutboxRecord]:
        sizes.append(len(delivered))
        if len(delivered) > room:
            raise refuse("SQLITE_FULL")
        return settle(connection, delivered, at)

    monkeypatch.setattr(queue, "delete_delivered", settle_few)
    for record in records(database, GROUP + 5):
        writer.add(confirmed(record), 0.0)
    for turn in range(200):
        writer.write(float(turn), 0.0)
        if not waiting(database):
            break
    assert waiting(database) == 0
    assert sizes[0] == GROUP
    assert max(size for size in sizes[5:]) < GROUP / 8


def test_it_says_when_nothing_more_should_be_sent(database: Database) -> None:
    writer = ResultWriter(database)
    for record in records(database, MAXIMUM_PENDING):
        assert not writer.is_full
        writer.add(confirmed(record), 0.0)
    assert writer.is_full


def test_what_was_held_back_is_no_try(database: Database) -> None:
    writer = ResultWriter(database)
    (record,) = records(database, 1)
    for outcome in (Outcome.HELD_BACK, Outcome.TRY_LATER):
        writer.add(RecordResult(record, Trigger.PUT_OFF, Result(outcome, outcome)), 0.0)
        writer.write(0.0, 0.0)
    with database.read() as connection:
        (now,) = queue.read_queued(connection, POSES, 0, 10)
    assert now.attempts == 1


def test_a_relay_that_finds_its_file_broken_while_it_makes_room_leaves_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Config(state_dir=tmp_path)
    config.edge_dir.mkdir()
    config.database_path.write_bytes(b"no database at all" * 1000)

    class MakesRoom:
        """A relay whose disk is full."""

        def __init__(self, database: Database) -> None:
            self.run = ResultWriter(database).make_room

    monkeypatch.setattr(relay, "build", lambda _config, database, _note: MakesRoom(database))
    monkeypatch.setattr(relay, "_stop_with", lambda *_: None)
    with pytest.raises(RelayError, match="broken"):
        relay._relay_once(config, threading.Event(), lambda: None)
    assert integrity.noted_fault(config.database_path) == "file is not a database"
