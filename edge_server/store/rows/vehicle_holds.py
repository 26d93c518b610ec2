"""Vehicles whose queue waits until an operator releases it."""

from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, bindparam, delete, select

from edge_server.store.connection.database import insert_new
from edge_server.store.rows.tables import vehicle_hold


class VehicleHold(NamedTuple):
    """Why a vehicle's queue waits, since when [epoch seconds], and after which mission."""

    vehicle_id: int
    reason: str
    since: float
    mission_id: int | None = None
    plan_id: str | None = None


def place(connection: Connection, hold: VehicleHold) -> None:
    """Hold a vehicle; one that is held already keeps its first reason."""
    insert_new(connection, vehicle_hold, [hold._asdict()])


_GET: Final = select(vehicle_hold).where(vehicle_hold.c.vehicle_id == bindparam("vehicle_id"))


def get(connection: Connection, vehicle_id: int) -> VehicleHold | None:
    """Find the hold of a vehicle."""
    row = connection.execute(_GET, {"vehicle_id": vehicle_id}).one_or_none()
    return _hold(row) if row else None


def everyone(connection: Connection) -> dict[int, VehicleHold]:
    """Return all holds by vehicle."""
    return {row.vehicle_id: _hold(row) for row in connection.execute(select(vehicle_hold))}


def remove(connection: Connection, vehicle_id: int) -> None:
    """Release a vehicle."""
    connection.execute(delete(vehicle_hold).where(vehicle_hold.c.vehicle_id == vehicle_id))


def _hold(row: Any) -> VehicleHold:
    return VehicleHold(row.vehicle_id, row.reason, row.since, row.mission_id, row.plan_id)
