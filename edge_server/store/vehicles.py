"""The registry of vehicles."""

import json
from typing import Any, NamedTuple

from sqlalchemy import Connection, delete, select

from edge_server.store.database import put_row, to_json
from edge_server.store.tables import vehicle


class StoredVehicle(NamedTuple):
    """A registered vehicle and what was last said of it."""

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
    """Which of these are registered."""
    rows = connection.execute(
        select(vehicle.c.vehicle_id).where(vehicle.c.vehicle_id.in_(vehicle_ids))
    )
    return set(rows.scalars())


def put(connection: Connection, vehicle_id: int, state: dict[str, Any], now: float) -> None:
    """Register a vehicle or replace what is said of it."""
    row = {
        "vehicle_id": vehicle_id,
        "state": to_json(state),
        "registered_at": now,
        "updated_at": now,
    }
    put_row(connection, vehicle, row, changed=("state", "updated_at"))


def remove(connection: Connection, vehicle_id: int) -> None:
    """Forget a vehicle."""
    connection.execute(delete(vehicle).where(vehicle.c.vehicle_id == vehicle_id))


def _stored(row: Any) -> StoredVehicle:
    return StoredVehicle(row.vehicle_id, json.loads(row.state), row.registered_at, row.updated_at)
