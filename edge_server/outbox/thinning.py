"""Chooses the records to drop, oldest first; it only reads, so it delays no writer.

Each call takes a bounded number of rows. A bookmark says how far the backlog has been examined:
records that stay are not examined twice. Only the fields that a gap declares are read, never the
payload: a thousand pictures are hundreds of megabytes.
"""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import JSON, ColumnElement, Connection, Integer, Select, cast, func, select

from edge_server.outbox import budget
from edge_server.outbox.budget import Sample
from edge_server.outbox.gaps import KIND, DroppedRecord
from edge_server.outbox.queue import State, Stream
from edge_server.store.rows.tables import outbox, telemetry


class Pass(NamedTuple):
    """Result of one call: what to drop, where to continue, whether the backlog ends."""

    to_drop: list[DroppedRecord]
    bookmark: int
    at_end: bool


Intervals = dict[Stream, float | None]
"""The interval of the last record that was kept, by stream."""


def to_thin(connection: Connection, bookmark: int, limit: int, intervals: Intervals) -> Pass:
    """Thin the next rows of the backlog to one record per stream and interval."""
    rows = _rows(connection, _backlog(connection, budget.THINNED, bookmark, limit))
    streams: dict[Stream, list[tuple[int, DroppedRecord]]] = {}
    for row, record in rows:
        streams.setdefault(record.stream, []).append((row, record))
    to_drop: list[DroppedRecord] = []
    for stream, found in streams.items():
        samples = [Sample(row, _recorded_at(record)) for row, record in found]
        dropped, intervals[stream] = budget.superfluous(samples, intervals.get(stream))
        rows_to_drop = set(dropped)
        to_drop += [record for row, record in found if row in rows_to_drop]
    return Pass(to_drop, rows[-1][0] if rows else bookmark, len(rows) < limit)


def oldest(connection: Connection, limit: int) -> list[DroppedRecord]:
    """Find the oldest records of the kinds that may be dropped."""
    return [
        record for _, record in _rows(connection, _backlog(connection, budget.DROPPED, 0, limit))
    ]


def aged(connection: Connection, kind: str, before: float, limit: int) -> list[DroppedRecord]:
    """Find the oldest records of a kind that were received before a time."""
    of_kind = _query(connection).where(telemetry.c.kind == kind)
    found = _rows(connection, of_kind.order_by(telemetry.c.id).limit(limit))
    return [record for _, record in found if record.received_at < before]


def excess_dead_letters(
    connection: Connection, budget_bytes: int, limit: int
) -> list[DroppedRecord]:
    """Find the oldest dead letters while all of them take more than their budget."""
    dead = (outbox.c.state == State.DEAD.value) & (outbox.c.kind != KIND)
    used = connection.execute(
        select(func.coalesce(func.sum(telemetry.c.size_bytes), 0))
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(dead)
    ).scalar_one()
    excess = used - budget_bytes
    to_drop: list[DroppedRecord] = []
    for _, record in _rows(
        connection, _query(connection).where(dead).order_by(outbox.c.id).limit(limit)
    ):
        if excess <= 0:
            break
        excess -= record.size_bytes
        to_drop.append(record)
    return to_drop


def _query(connection: Connection) -> Select[Any]:
    return select(
        outbox.c.id,
        telemetry.c.id,
        telemetry.c.message_id,
        telemetry.c.vehicle_id,
        telemetry.c.kind,
        cast(_member(connection, "sequence_number"), Integer),
        _member(connection, "recorded_at"),
        telemetry.c.received_at,
        telemetry.c.size_bytes,
    ).join(outbox, outbox.c.record_id == telemetry.c.id)


def _member(connection: Connection, name: str) -> ColumnElement[Any]:
    """A member of a payload, as the database extracts it."""
    if connection.dialect.name == "sqlite":
        return func.json_extract(telemetry.c.payload, f"$.{name}")
    member: ColumnElement[Any] = cast(telemetry.c.payload, JSON)[name].as_string()
    return member


def _backlog(
    connection: Connection, kinds: Sequence[str], bookmark: int, limit: int
) -> Select[Any]:
    """The oldest rows after a bookmark, in the order of their ids."""
    return (
        _query(connection)
        .where(
            outbox.c.id > bookmark, outbox.c.state == State.QUEUED.value, outbox.c.kind.in_(kinds)
        )
        .order_by(outbox.c.id)
        .limit(limit)
    )


def _rows(connection: Connection, query: Select[Any]) -> list[tuple[int, DroppedRecord]]:
    return [
        (row[0], DroppedRecord(row[1], row[2], Stream(row[3], row[4]), *row[5:]))
        for row in connection.execute(query)
    ]


def _recorded_at(record: DroppedRecord) -> float:
    """Return `recorded_at` of a record [s since 1970], or when it was received if it has none."""
    if not isinstance(record.recorded_at, str):
        return record.received_at
    try:
        return datetime.fromisoformat(record.recorded_at).timestamp()
    except (ValueError, OverflowError):
        return record.received_at
