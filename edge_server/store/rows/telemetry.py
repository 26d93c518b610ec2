"""Reports of vehicles as rows: one row per report, any kind."""

import json
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, delete, insert, select, update

from edge_server.store.connection.database import new_id, one_by_one
from edge_server.store.rows.tables import telemetry


class Record(NamedTuple):
    """One stored report; `payload` is the JSON for the cloud."""

    id: int
    message_id: str
    kind: str
    vehicle_id: int
    payload: str
    received_at: float

    def body(self) -> dict[str, Any]:
        """Return the payload as an object."""
        body: dict[str, Any] = json.loads(self.payload)
        return body


class Draft(NamedTuple):
    """A report to be stored, without an id yet."""

    message_id: str
    kind: str
    vehicle_id: int
    payload: str
    received_at: float


_ADD: Final = insert(telemetry)
_ADD_ALL: Final = insert(telemetry).returning(telemetry.c.id, sort_by_parameter_order=True)


def add(
    connection: Connection,
    *,
    kind: str,
    vehicle_id: int,
    message_id: str,
    payload: str,
    received_at: float,
) -> int:
    """Store a report; returns its id."""
    result = connection.execute(
        _ADD,
        {
            "kind": kind,
            "vehicle_id": vehicle_id,
            "message_id": message_id,
            "payload": payload,
            "received_at": received_at,
            "size_bytes": len(payload),
        },
    )
    return new_id(result)


def add_all(connection: Connection, drafts: Sequence[Draft]) -> list[int]:
    """Store many reports; returns their ids, which increase in their order."""
    rows = [{**draft._asdict(), "size_bytes": len(draft.payload)} for draft in drafts]
    return list(connection.execute(_ADD_ALL, rows).scalars())


def get(
    connection: Connection, kind: str, record_id: int, *, to_change: bool = False
) -> Record | None:
    """Find one report of a kind; `to_change` locks it until the end of the transaction."""
    query = select(telemetry).where(telemetry.c.id == record_id, telemetry.c.kind == kind)
    if to_change:
        query = query.with_for_update()
    row = connection.execute(query).one_or_none()
    return _record(row) if row else None


def page(  # each narrows the list
    connection: Connection,
    kind: str,
    *,
    after_id: int,
    limit: int,
    vehicle_id: int | None,
    since_s: float,
) -> Iterator[Record]:
    """Return reports of a kind received from `since_s` one by one, oldest first.

    They are read while the transaction lasts: of pictures, one after the other is in memory.
    """
    query = select(telemetry).where(
        telemetry.c.kind == kind, telemetry.c.id > after_id, telemetry.c.received_at >= since_s
    )
    if vehicle_id is not None:
        query = query.where(telemetry.c.vehicle_id == vehicle_id)
    return map(_record, one_by_one(connection, query.order_by(telemetry.c.id).limit(limit)))


def replace(connection: Connection, record_id: int, *, message_id: str, payload: str) -> None:
    """Replace the content of a report, which is a new message for the cloud."""
    connection.execute(
        update(telemetry)
        .where(telemetry.c.id == record_id)
        .values(message_id=message_id, payload=payload, size_bytes=len(payload))
    )


def remove(connection: Connection, kind: str, record_id: int) -> bool:
    """Delete a report and its outbox row; returns whether there was one."""
    result = connection.execute(
        delete(telemetry).where(telemetry.c.id == record_id, telemetry.c.kind == kind)
    )
    return result.rowcount > 0


def _record(row: Any) -> Record:
    return Record(row.id, row.message_id, row.kind, row.vehicle_id, row.payload, row.received_at)
