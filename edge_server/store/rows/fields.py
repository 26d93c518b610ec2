"""Fields as rows."""

import json
from typing import Any, NamedTuple

from sqlalchemy import Connection, delete, insert, select, update

from edge_server.store.connection.database import new_id, to_json
from edge_server.store.rows.tables import field


class StoredField(NamedTuple):
    """A field's document and its times."""

    id: int
    body: dict[str, Any]
    received_at: float
    updated_at: float


def add(connection: Connection, body: dict[str, Any], now: float) -> int:
    """Store a field; returns its id."""
    values = {"body": to_json(body), "received_at": now, "updated_at": now}
    return new_id(connection.execute(insert(field).values(values)))


def get(connection: Connection, identifier: int) -> StoredField | None:
    """Find a field."""
    row = connection.execute(select(field).where(field.c.id == identifier)).one_or_none()
    return _stored(row) if row else None


def page(connection: Connection, *, after_id: int, limit: int, since_s: float) -> list[StoredField]:
    """List fields, oldest first: those received from `since_s`."""
    query = select(field).where(field.c.id > after_id, field.c.received_at >= since_s)
    return [_stored(row) for row in connection.execute(query.order_by(field.c.id).limit(limit))]


_HAS_NO_FLY_AREAS = field.c.body.like('%"exclusions":[[%')
"""Documents are written compactly, so that others need not be read."""


def has_no_fly_area(connection: Connection) -> bool:
    """Whether any field's document has no-fly areas."""
    return (
        connection.execute(select(field.c.id).where(_HAS_NO_FLY_AREAS).limit(1)).first() is not None
    )


def with_no_fly_areas(connection: Connection) -> list[StoredField]:
    """List the fields whose documents have no-fly areas, oldest first."""
    query = select(field).where(_HAS_NO_FLY_AREAS).order_by(field.c.id)
    return [_stored(row) for row in connection.execute(query)]


def of_moment(
    connection: Connection, first_id: int, received_at: float, limit: int
) -> list[StoredField]:
    """List what was received in one request: its first id, its moment, and how many there were."""
    query = select(field).where(field.c.id >= first_id, field.c.received_at == received_at)
    return [_stored(row) for row in connection.execute(query.order_by(field.c.id).limit(limit))]


def replace(connection: Connection, identifier: int, body: dict[str, Any], now: float) -> None:
    """Overwrite a field's document."""
    connection.execute(
        update(field).where(field.c.id == identifier).values(body=to_json(body), updated_at=now)
    )


def remove(connection: Connection, identifier: int) -> bool:
    """Delete a field; returns whether there was one."""
    return connection.execute(delete(field).where(field.c.id == identifier)).rowcount > 0


def _stored(row: Any) -> StoredField:
    return StoredField(row.id, json.loads(row.body), row.received_at, row.updated_at)
