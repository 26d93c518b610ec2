"""Picks what goes when there is too much, oldest first, on the caller's transaction.

Each call takes a bounded number of rows, so that no writer waits long. A bookmark says how far the
backlog has been looked through: what stays is not looked at twice.
"""

import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, Select, func, select

from edge_server.outbox import budget, gaps
from edge_server.outbox.budget import Sample
from edge_server.outbox.gaps import Lost, Reason
from edge_server.outbox.queue import Stream
from edge_server.store.tables import outbox, telemetry

QUEUED: Final = "queued"
DEAD: Final = "dead"


class Pass(NamedTuple):
    """What one call has done: how many went by kind, where to go on, whether that is the end."""

    dropped: dict[str, int]
    bookmark: int
    at_end: bool


Intervals = dict[Stream, float | None]
"""The interval of the last record that stayed, by stream."""


def thin(
    connection: Connection, bookmark: int, limit: int, intervals: Intervals, now: float
) -> Pass:
    """Thin the next rows of the backlog to one record per stream and interval."""
    rows = _rows(connection, _backlog(budget.THINNED, bookmark, limit))
    streams: dict[Stream, list[tuple[int, Lost]]] = {}
    for row, lost in rows:
        streams.setdefault(lost.stream, []).append((row, lost))
    going: list[Lost] = []
    for stream, found in streams.items():
        samples = [Sample(row, _taken_at(lost)) for row, lost in found]
        out, intervals[stream] = budget.superfluous(samples, intervals.get(stream))
        gone = set(out)
        going += [lost for row, lost in found if row in gone]
    dropped = gaps.drop(connection, going, Reason.THINNED, now)
    return Pass(dropped, rows[-1][0] if rows else bookmark, len(rows) < limit)


def drop_oldest(connection: Connection, limit: int, now: float) -> dict[str, int]:
    """Drop the oldest records that may be missed."""
    rows = _rows(connection, _backlog(budget.DROPPED, 0, limit))
    return gaps.drop(connection, [lost for _, lost in rows], Reason.BUDGET, now)


def drop_aged(
    connection: Connection, kind: str, before: float, limit: int, now: float
) -> dict[str, int]:
    """Drop those of the oldest records of a kind that were received before a time."""
    oldest = _query().where(telemetry.c.kind == kind).order_by(telemetry.c.id).limit(limit)
    going = [lost for _, lost in _rows(connection, oldest) if lost.received_at < before]
    return gaps.drop(connection, going, Reason.AGE, now)


def drop_dead_letters(
    connection: Connection, budget_bytes: int, limit: int, now: float
) -> dict[str, int]:
    """Drop the oldest dead letters while all of them take more than their budget."""
    dead = (outbox.c.state == DEAD) & (outbox.c.kind != gaps.KIND)
    used = connection.execute(
        select(func.coalesce(func.sum(telemetry.c.size_bytes), 0))
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(dead)
    ).scalar_one()
    excess = used - budget_bytes
    if excess <= 0:
        return {}
    going: list[Lost] = []
    for _, lost in _rows(connection, _query().where(dead).order_by(outbox.c.id).limit(limit)):
        if excess <= 0:
            break
        excess -= len(lost.payload)
        going.append(lost)
    return gaps.drop(connection, going, Reason.DEAD_LETTERS, now)


def _query() -> Select[Any]:
    return select(
        outbox.c.id,
        telemetry.c.id,
        telemetry.c.message_id,
        telemetry.c.vehicle_id,
        telemetry.c.kind,
        telemetry.c.payload,
        telemetry.c.received_at,
    ).join(outbox, outbox.c.record_id == telemetry.c.id)


def _backlog(kinds: Sequence[str], bookmark: int, limit: int) -> Select[Any]:
    """The oldest rows after a bookmark, in the order of their ids."""
    return (
        _query()
        .where(outbox.c.id > bookmark, outbox.c.state == QUEUED, outbox.c.kind.in_(kinds))
        .order_by(outbox.c.id)
        .limit(limit)
    )


def _rows(connection: Connection, query: Select[Any]) -> list[tuple[int, Lost]]:
    return [
        (row[0], Lost(row[1], row[2], Stream(row[3], row[4]), row[5], row[6]))
        for row in connection.execute(query)
    ]


def _taken_at(lost: Lost) -> float:
    """When a record was taken: as its vehicle says, else when it was received."""
    said = json.loads(lost.payload).get("recorded_at")
    if not isinstance(said, str):
        return lost.received_at
    try:
        return datetime.fromisoformat(said).timestamp()
    except ValueError:
        return lost.received_at
