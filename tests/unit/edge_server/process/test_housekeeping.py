"""Periodic tasks."""

import errno
import sqlite3
import threading
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import text

from edge_server.process import housekeeping
from edge_server.services import post_idempotency
from edge_server.store.connection.database import Database
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, plan, telemetry


def test_old_idempotency_keys_are_deleted_and_new_ones_are_not(edge: Edge) -> None:
    edge.report("pose", telemetry("pose"), key="old")
    edge.clock.pass_s(post_idempotency.KEPT_S - 1)
    edge.report("pose", telemetry("pose", 1), key="young")
    edge.clock.pass_s(2)
    housekeeping.clean_up(edge.context)
    with edge.context.database.read() as connection:
        left = connection.execute(text("SELECT key FROM idempotency")).scalars().all()
    assert left == ["young"]


def test_answered_requests_are_deleted_and_the_cursor_goes_on(edge: Edge) -> None:
    for number in range(3):
        edge.post("/latest_state_vector/", {"sequence_number": number}, "operator")
    newest = edge.work()[-1]["id"]
    edge.clock.pass_s(7200)
    assert edge.work() == []
    housekeeping.delete_requests(edge.context)
    assert edge.count("work") == 1
    assert edge.get(f"/broker/commands?after={newest}", "broker")["cursor"] == newest


def test_old_events_are_deleted_and_new_ones_are_not(edge: Edge) -> None:
    armed = {"link_state": "connected", "armed": True}
    edge.ask("PUT", "/vehicles/1", "broker", json=armed)
    edge.post("/events/", event(), "operator")
    edge.clock.pass_s(edge.config.retain_plans_days * housekeeping.DAY_S - 1)
    edge.post("/events/", event(), "operator")
    edge.clock.pass_s(2)
    housekeeping.clean_up(edge.context)
    assert [one["id"] for one in edge.get("/events/")] == [2]


def test_a_clock_that_was_set_forward_before_a_start_makes_no_key_old(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A repeated record would be stored twice, and an event would be forgotten."""
    edge.ask("PUT", "/vehicles/1", "broker", json={"link_state": "connected", "armed": True})
    edge.post("/events/", event(), "operator")
    first: Any = edge.report("pose", telemetry("pose"), key="k1").json
    edge.clock.pass_s(400 * housekeeping.DAY_S)
    monkeypatch.setattr(housekeeping, "EXPIRY_S", 0.01)
    stopping = threading.Event()
    has_cleaned = threading.Event()
    monkeypatch.setattr(edge.context.space, "drop_aged", lambda _: has_cleaned.set())
    thread = threading.Thread(target=housekeeping.run, args=(edge.context, stopping))
    thread.start()
    assert has_cleaned.wait(10.0)
    stopping.set()
    thread.join()
    again: Any = edge.report("pose", telemetry("pose"), key="k1").json
    assert again["message_id"] == first["message_id"]
    assert edge.count("telemetry") == 1
    assert [one["id"] for one in edge.get("/events/")] == [1]


@pytest.mark.thorough
def test_a_mission_expires_without_a_request(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.clock.pass_s(edge.config.plan_lifetime_s + 1)
    stopping = threading.Event()
    thread = threading.Thread(target=housekeeping.run, args=(edge.context, stopping))
    thread.start()
    while edge.count("telemetry") == 0:
        assert thread.is_alive()
    stopping.set()
    thread.join()
    with edge.context.database.read() as connection:
        status = connection.execute(text("SELECT status_id FROM work")).scalar_one()
    assert status == 5


def test_room_is_reserved_from_the_start(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(housekeeping, "EXPIRY_S", 3600.0)
    stopping = threading.Event()
    thread = threading.Thread(target=housekeeping.run, args=(edge.context, stopping))
    thread.start()
    while not edge.config.ballast_path.exists():
        assert thread.is_alive()
    stopping.set()
    thread.join()


def no_disk(_database: Database) -> None:
    raise OSError(errno.EIO, "the disk does not answer")


def no_room(database: Database) -> None:
    """Fail in the upkeep of the file, as it does on a full disk."""

    def grow(file: sqlite3.Connection) -> None:
        file.execute("PRAGMA max_page_count=1")
        file.execute("CREATE TABLE more AS SELECT randomblob(1000000) AS value")

    database.tend(grow)


def no_database(database: Database) -> None:
    """Fail in the upkeep of a file that is broken."""
    database.tend(raise_malformed)


def raise_malformed(_file: sqlite3.Connection) -> None:
    raise sqlite3.DatabaseError("database disk image is malformed")


@pytest.mark.first_case
@pytest.mark.parametrize("fail", [no_disk, no_room, no_database])
def test_a_failing_disk_does_not_end_the_housekeeping(
    edge: Edge, monkeypatch: pytest.MonkeyPatch, fail: Callable[[Database], None]
) -> None:
    turns = threading.Semaphore(0)

    def keep(_monotonic: float) -> None:
        turns.release()
        fail(edge.context.database)
        pytest.fail("the disk has not failed")

    monkeypatch.setattr(housekeeping, "EXPIRY_S", 0.001)
    monkeypatch.setattr(edge.context.space, "maintain", keep)
    stopping = threading.Event()
    thread = threading.Thread(target=housekeeping.run, args=(edge.context, stopping))
    thread.start()
    try:
        assert all(turns.acquire(timeout=20.0) for _ in range(3))
    finally:
        stopping.set()
        thread.join(20.0)
    assert not thread.is_alive()
