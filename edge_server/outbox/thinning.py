"""Picks what goes when there is too much, oldest first; reads only, so it holds no writer up.

Each call takes a bounded number of rows. A bookmark says how far the backlog has been looked
through: what stays is not looked at twice. Of a record only what a gap says of it is read, never
its payload: a thousand pictures are hundreds of megabytes.
"""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Final, NamedTuple

from sqlalchemy import JSON, ColumnElement, Connection, Integer, Select, cast, func, select

from edge_server.outbox import budget
from edge_server.outbox.budget import Sample
from edge_server.outbox.gaps import KIND, Lost
from edge_server.outbox.queue import Stream
from edge_server.store.tables import outbox, telemetry

QUEUED: Final = "queued"
DEAD: Final = "dead"


class Pass(NamedTuple):
    """What one call has found: what goes, where to go on, whether that is the end."""

    going: list[Lost]
    bookmark: int
    at_end: bool


Intervals = dict[Stream, float | None]
"""The interval of the last record that stayed, by stream."""


def to_thin(connection: Connection, bookmark: int, limit: int, intervals: Intervals) -> Pass:
    """Thin the next rows of the backlog to one record per stream and interval."""
    rows = _rows(connection, _backlog(connection, budget.THINNED, bookmark, limit))
    streams: dict[Stream, list[tuple[int, Lost]]] = {}
    for row, lost in rows:
        streams.setdefault(lost.stream, []).append((row, lost))
    going: list[Lost] = []
    for stream, found in streams.items():
        samples = [Sample(row, _taken_at(lost)) for row, lost in found]
        out, intervals[stream] = budget.superfluous(samples, intervals.get(stream))
        gone = set(out)
        going += [lost for row, lost in found if row in gone]
    return Pass(going, rows[-1][0] if rows else bookmark, len(rows) < limit)


def oldest(connection: Connection, limit: int) -> list[Lost]:
    """Find the oldest records that may be missed."""
    return [lost for _, lost in _rows(connection, _backlog(connection, budget.DROPPED, 0, limit))]


def aged(connection: Connection, kind: str, before: float, limit: int) -> list[Lost]:
    """Find those of the oldest records of a kind that were received before a time."""
    of_kind = _query(connection).where(telemetry.c.kind == kind)
    found = _rows(connection, of_kind.order_by(telemetry.c.id).limit(limit))
    return [lost for _, lost in found if lost.received_at < before]


def excess_dead_letters(connection: Connection, budget_bytes: int, limit: int) -> list[Lost]:
    """Find the oldest dead letters while all of them take more than their budget."""
    dead = (outbox.c.state == DEAD) & (outbox.c.kind != KIND)
    used = connection.execute(
        select(func.coalesce(func.sum(telemetry.c.size_bytes), 0))
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(dead)
    ).scalar_one()
    excess = used - budget_bytes
    going: list[Lost] = []
    for _, lost in _rows(
        connection, _query(connection).where(dead).order_by(outbox.c.id).limit(limit)
    ):
        if excess <= 0:
            break
        excess -= lost.size_bytes
        going.append(lost)
    return going


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
    """A member of a payload, which the engine reads out of it."""
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
        .where(outbox.c.id > bookmark, outbox.c.state == QUEUED, outbox.c.kind.in_(kinds))
        .order_by(outbox.c.id)
        .limit(limit)
    )


def _rows(connection: Connection, query: Select[Any]) -> list[tuple[int, Lost]]:
    return [
        (row[0], Lost(row[1], row[2], Stream(row[3], row[4]), *row[5:]))
        for row in connection.execute(query)
    ]


def _taken_at(lost: Lost) -> float:
    """When a record was taken: as its vehicle says, else when it was received."""
    if not isinstance(lost.recorded_at, str):
        return lost.received_at
    try:
        return datetime.fromisoformat(lost.recorded_at).timestamp()
    except (ValueError, OverflowError):
        return lost.received_at
