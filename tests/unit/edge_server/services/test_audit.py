"""The chain holds: under many writers, against every change, and when its old end is cut."""

import threading
from typing import Any

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DatabaseError

from edge_server.process import housekeeping
from edge_server.services import audit
from edge_server.services.audit import Actor, Trail, use_trail
from edge_server.store.rows import audit as rows
from edge_server.store.rows.audit import Entry
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import NOON, Edge
from tests.unit.edge_server.documents import plan

WRITERS, EACH = 4, 12
DAY_S = 86_400.0


def write(edge: Edge, number: int, at: float = NOON) -> None:
    """One row, of a change that changes nothing else."""
    trail = Trail(Actor("somebody", "operator"), "test", f"thing/{number}", lambda: at)
    with use_trail(trail), edge.context.database.write():
        audit.about(f"thing/{number}")


def fill(edge: Edge, count: int) -> None:
    for number in range(count):
        write(edge, number, NOON + number)


@pytest.mark.first_case
@BOTH_ENGINES
def test_many_writers_make_one_chain(edge: Edge) -> None:
    def work(writer: int) -> None:
        for number in range(EACH):
            write(edge, writer * EACH + number)

    threads = [threading.Thread(target=work, args=(writer,)) for writer in range(WRITERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert audit.verify(edge.context.database) == (WRITERS * EACH, None, None)
    found = {row["object"] for row in audit.export(edge.context.database)}
    assert found == {f"thing/{number}" for number in range(WRITERS * EACH)}


@pytest.mark.first_case
@BOTH_ENGINES
@pytest.mark.parametrize(
    "statement", ["UPDATE audit SET who = 'x' WHERE id = 2", "DELETE FROM audit"]
)
def test_the_database_itself_refuses_to_falsify(edge: Edge, statement: str) -> None:
    fill(edge, 3)
    with pytest.raises(DatabaseError, match="append-only"), edge.context.database.write() as own:
        own.execute(text(statement))
    assert audit.verify(edge.context.database) == (3, None, None)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("statement", "row_id"),
    [
        ("UPDATE audit SET who = 'x' WHERE id = 3", 3),
        ("UPDATE audit SET at = at + 1 WHERE id = 1", 1),
        ("UPDATE audit SET result = '403' WHERE id = 5", 5),
        ("UPDATE audit SET prev_hash = zeroblob(32) WHERE id = 4", 4),
        ("UPDATE audit SET hash = zeroblob(32) WHERE id = 2", 2),
        ("DELETE FROM audit WHERE id = 1", 1),
        ("DELETE FROM audit WHERE id = 3", 3),
        ("DELETE FROM audit WHERE id >= 4", 4),
        ("DELETE FROM audit", 1),
        ("UPDATE audit SET id = id + 10 WHERE id = 5", 5),
    ],
)
def test_whoever_gets_past_that_is_found_out(edge: Edge, statement: str, row_id: int) -> None:
    fill(edge, 5)
    with edge.context.database.write() as own:
        for trigger in ("audit_never_changes", "audit_stays"):
            own.execute(text(f"DROP TRIGGER {trigger}"))
        own.execute(text(statement))
    result = audit.verify(edge.context.database)
    assert result.fault is not None
    assert result.row_id == row_id


@pytest.mark.thorough
def test_a_change_that_fails_leaves_no_row(edge: Edge) -> None:
    trail = Trail(Actor("somebody", "operator"), "test", "thing", lambda: NOON)
    with pytest.raises(RuntimeError), use_trail(trail), edge.context.database.write():
        raise RuntimeError
    assert edge.count("audit") == 0
    assert not trail.is_recorded


@pytest.mark.first_case
@BOTH_ENGINES
def test_retention_cuts_the_old_end_and_the_rest_can_be_verified(edge: Edge) -> None:
    fill(edge, 5)
    edge.clock.now = NOON + edge.config.retain_audit_days * DAY_S + 2.5
    housekeeping.delete_old_records(edge.context)
    found = list(audit.export(edge.context.database))
    assert [row["id"] for row in found] == [4, 5, 6]
    assert found[-1]["action"] == "retention.audit"
    assert audit.verify(edge.context.database) == (3, None, None)
    edge.clock.pass_s(2 * edge.config.retain_audit_days * DAY_S)
    housekeeping.delete_old_records(edge.context)
    assert audit.verify(edge.context.database) == (1, None, None)


def test_old_plans_go_and_live_ones_stay(edge: Edge) -> None:
    edge.post_plan(plan())
    edge.clock.pass_s(edge.config.retain_plans_days * DAY_S)
    edge.post_plan(plan())
    housekeeping.delete_old_records(edge.context)
    assert [found["id"] for found in edge.get("/plans/")] == [1, 2]
    edge.clock.pass_s(1)
    housekeeping.delete_old_records(edge.context)
    assert [found["id"] for found in edge.get("/plans/")] == [2]


def test_what_no_database_can_hold_is_still_told(edge: Edge) -> None:
    hostile: list[Any] = ["\0", "\ud800", "x" * 1000, "Ünïcödé ☃", '"\n{}']
    with edge.context.database.write() as own:
        for who in hostile:
            rows.append(own, Entry(NOON + 0.12345, who, "admin", "", "", "", "a", who, "done"))
    assert audit.verify(edge.context.database) == (len(hostile), None, None)
