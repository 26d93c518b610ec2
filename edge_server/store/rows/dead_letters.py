"""Records that the cloud has rejected, as rows; they stay until they are retried or discarded."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from sqlalchemy import Connection, Select, func, select

from edge_server.store.connection.database import one_by_one
from edge_server.store.rows.tables import outbox, telemetry
from edge_server.store.rows.telemetry import Record


class DeadLetter(NamedTuple):
    """A rejected record, the number of attempts, the reason, and when it was rejected."""

    record: Record
    attempts: int
    reason: str
    rejected_at: float | None


def _query() -> Select[Any]:
    return (
        select(telemetry, outbox.c.attempts, outbox.c.last_error, outbox.c.rejected_at)
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(outbox.c.state == "dead")
    )


def find(connection: Connection, record_id: int, *, to_change: bool = False) -> DeadLetter | None:
    """Find one by its record's id; `to_change` locks it until the end of the transaction."""
    query = _query().where(telemetry.c.id == record_id)
    if to_change:
        query = query.with_for_update()
    row = connection.execute(query).one_or_none()
    return _letter(row) if row else None


def page(
    connection: Connection, *, after_id: int, limit: int, kind: str | None, vehicle_id: int | None
) -> Iterator[DeadLetter]:
    """Return dead letters one by one, oldest record first, while the transaction lasts."""
    query = _narrowed(_query(), after_id, kind, vehicle_id)
    return map(_letter, one_by_one(connection, query.limit(limit)))


def ids(
    connection: Connection, *, after_id: int, limit: int, kind: str | None, vehicle_id: int | None
) -> list[int]:
    """List the ids of dead letters and lock them until the end of the transaction."""
    query = (
        select(telemetry.c.id)
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(outbox.c.state == "dead")
        .with_for_update()
    )
    query = _narrowed(query, after_id, kind, vehicle_id)
    return list(connection.execute(query.limit(limit)).scalars())


def newest(connection: Connection) -> int:
    """Return the largest id of a dead letter, 0 if there is none."""
    query = select(func.max(outbox.c.record_id)).where(outbox.c.state == "dead")
    return connection.execute(query).scalar_one() or 0


def _narrowed(
    query: Select[Any], after_id: int, kind: str | None, vehicle_id: int | None
) -> Select[Any]:
    query = query.where(telemetry.c.id > after_id)
    if kind is not None:
        query = query.where(telemetry.c.kind == kind)
    if vehicle_id is not None:
        query = query.where(telemetry.c.vehicle_id == vehicle_id)
    return query.order_by(telemetry.c.id)


def _letter(row: Any) -> DeadLetter:
    record = Record(row.id, row.message_id, row.kind, row.vehicle_id, row.payload, row.received_at)
    return DeadLetter(record, row.attempts, row.last_error, row.rejected_at)
