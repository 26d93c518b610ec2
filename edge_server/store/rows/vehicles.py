"""The registry of vehicles, and when a broker last made a request about each."""

import json
from collections.abc import Iterable
from typing import Any, NamedTuple

from sqlalchemy import Connection, delete, select, update

from edge_server.store.connection.database import put_row, to_json
from edge_server.store.rows.tables import broker_contact, vehicle


class StoredVehicle(NamedTuple):
    """A registered vehicle and its last reported state."""

    vehicle_id: int
    state: dict[str, Any]
    registered_at: float
    updated_at: float


def get(connection: Connection, vehicle_id: int) -> StoredVehicle | None:
    """Find a vehicle."""
    row = connection.execute(
        select(vehicle).where(vehicle.c.vehicle_id == vehicle_id)
    ).one_or_none()
    return _stored(row) if row else None


def everyone(connection: Connection) -> list[StoredVehicle]:
    """List all vehicles by id."""
    rows = connection.execute(select(vehicle).order_by(vehicle.c.vehicle_id))
    return [_stored(row) for row in rows]


def known(connection: Connection, vehicle_ids: set[int]) -> set[int]:
    """Return which of these are registered."""
    rows = connection.execute(
        select(vehicle.c.vehicle_id).where(vehicle.c.vehicle_id.in_(vehicle_ids))
    )
    return set(rows.scalars())


def put(connection: Connection, vehicle_id: int, state: dict[str, Any], now: float) -> None:
    """Register a vehicle or replace its state."""
    row = {
        "vehicle_id": vehicle_id,
        "state": to_json(state),
        "registered_at": now,
        "updated_at": now,
    }
    put_row(connection, vehicle, row, changed=("state", "updated_at"))


def remove(connection: Connection, vehicle_id: int) -> None:
    """Delete a vehicle."""
    connection.execute(delete(vehicle).where(vehicle.c.vehicle_id == vehicle_id))
    connection.execute(delete(broker_contact).where(broker_contact.c.vehicle_id == vehicle_id))


def note_contact(
    connection: Connection, broker: str, vehicle_ids: Iterable[int], now: float
) -> None:
    """Store that a broker has made a request about these vehicles."""
    for vehicle_id in sorted(vehicle_ids):
        row = {"vehicle_id": vehicle_id, "broker": broker, "at": now}
        put_row(connection, broker_contact, row, changed=("broker", "at"))


def note_poll(connection: Connection, broker: str, now: float) -> None:
    """Store that a broker has polled for work, for all vehicles of which it is the last contact."""
    connection.execute(
        update(broker_contact).where(broker_contact.c.broker == broker).values(at=now)
    )


def last_contact(connection: Connection, vehicle_id: int) -> float | None:
    """When a broker last made a request about a vehicle [epoch seconds]; None if unknown."""
    found: float | None = connection.execute(
        select(broker_contact.c.at).where(broker_contact.c.vehicle_id == vehicle_id)
    ).scalar_one_or_none()
    return found


def _stored(row: Any) -> StoredVehicle:
    return StoredVehicle(row.vehicle_id, json.loads(row.state), row.registered_at, row.updated_at)
