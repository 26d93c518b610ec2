"""Events as rows; the state of an event is in its row of `store/rows/work.py`."""

import json
from typing import Any, NamedTuple

from sqlalchemy import Connection, Select, delete, insert, select, update

from edge_server.store.connection.database import new_id
from edge_server.store.rows.tables import event, work


class StoredEvent(NamedTuple):
    """An event and its work."""

    id: int
    work_id: int
    vehicle_id: int
    body: dict[str, Any]
    state: str
    status_id: int
    message: str | None
    received_at: float
    expires_at: float


def add(connection: Connection, *, work_id: int, received_at: float) -> int:
    """Store an event whose work is queued; returns its id."""
    values = {"work": work_id, "received_at": received_at}
    return new_id(connection.execute(insert(event).values(values)))


def set_work(connection: Connection, identifier: int, work_id: int) -> None:
    """Connect an event to other work, after which the old work can be deleted."""
    connection.execute(update(event).where(event.c.id == identifier).values(work=work_id))


def get(connection: Connection, identifier: int) -> StoredEvent | None:
    """Find an event."""
    row = connection.execute(_query().where(event.c.id == identifier)).one_or_none()
    return _stored(row) if row else None


def received_at(connection: Connection, work_id: int) -> float | None:
    """Return when the event of a piece of work was received [s]; None if there is none."""
    query = select(event.c.received_at).where(event.c.work == work_id)
    return connection.execute(query).scalar_one_or_none()


def page(
    connection: Connection, *, after_id: int, limit: int, since_s: float, vehicle_id: int | None
) -> list[StoredEvent]:
    """List events, oldest first: those received from `since_s`, of one vehicle or of all."""
    query = _query().where(event.c.id > after_id, event.c.received_at >= since_s)
    if vehicle_id is not None:
        query = query.where(work.c.vehicle_id == vehicle_id)
    return [_stored(row) for row in connection.execute(query.order_by(event.c.id).limit(limit))]


def remove(connection: Connection, identifier: int) -> None:
    """Delete an event; its work is another row."""
    connection.execute(delete(event).where(event.c.id == identifier))


def _query() -> Select[Any]:
    return select(
        event.c.id,
        work.c.id.label("work_id"),
        work.c.vehicle_id,
        work.c.body,
        work.c.state,
        work.c.status_id,
        work.c.message,
        event.c.received_at,
        work.c.expires_at,
    ).join(work, event.c.work == work.c.id)


def _stored(row: Any) -> StoredEvent:
    return StoredEvent(
        row.id,
        row.work_id,
        row.vehicle_id,
        json.loads(row.body),
        row.state,
        row.status_id,
        row.message,
        row.received_at,
        row.expires_at,
    )
