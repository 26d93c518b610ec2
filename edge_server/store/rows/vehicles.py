"""The registry of vehicles, and which broker last made a request about each."""

import json
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, bindparam, delete, select, update

from edge_server.store.connection.database import put_row, to_json
from edge_server.store.rows.tables import broker_contact, vehicle

SERVED_S: Final = 60.0
"""A broker serves a vehicle until it has made no request for so long; it polls every 20 s."""
URGENT_SERVED_S: Final = 20.0
"""The same while an order that stops the flight waits. A poll that waits is noted every 15 s."""
CUT_OFF_S: Final = 5.0
"""The rest of `URGENT_SERVED_S` for a broker whose poll was cut off, which may poll again."""


class StoredVehicle(NamedTuple):
    """A registered vehicle and its last reported state."""

    vehicle_id: int
    state: dict[str, Any]
    registered_at: float
    updated_at: float


_GET: Final = select(vehicle).where(vehicle.c.vehicle_id == bindparam("vehicle_id"))


def get(connection: Connection, vehicle_id: int) -> StoredVehicle | None:
    """Find a vehicle."""
    row = connection.execute(_GET, {"vehicle_id": vehicle_id}).one_or_none()
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


class Contact(NamedTuple):
    """The broker that serves a vehicle, and another one that made a request about it."""

    broker: str
    at: float
    other: str | None = None
    other_at: float | None = None

    def brokers(self, now: float) -> list[str]:
        """Brokers that made a request about it within `SERVED_S`; the first one serves it."""
        times = ((self.broker, self.at), (self.other, self.other_at))
        return [name for name, at in times if name and at is not None and _is_recent(at, now)]

    def serves(self, broker: str, now: float, within_s: float = SERVED_S) -> bool:
        """Whether a broker serves the vehicle, or may begin to: no other one serves it.

        The other one serves it until it has made no request for `within_s`.
        """
        return _is_same(self.broker, broker) or not _is_recent(self.at, now, within_s)


def identity(owner: str, instance: str) -> str:
    """Name a broker by its access key and its instance; some brokers give no instance."""
    return f"{owner} {instance}" if instance else owner


def _is_recent(at: float, now: float, within_s: float = SERVED_S) -> bool:
    return abs(now - at) < within_s


def _is_same(one: str, other: str) -> bool:
    """Whether two names can be of one broker: one of them may be without its instance."""
    (key, _, instance), (other_key, _, other_instance) = one.partition(" "), other.partition(" ")
    return key == other_key and (instance == other_instance or not (instance and other_instance))


def note_contact(
    connection: Connection,
    broker: str,
    vehicle_ids: Iterable[int],
    now: float,
    within_s: float = SERVED_S,
) -> list[int]:
    """Store that a broker has made a request about these vehicles.

    It serves those whose other broker has made none for `within_s`.
    Returns those that another broker serves, if that was not known yet.
    """
    contested = []
    for vehicle_id in sorted(vehicle_ids):
        known = contact(connection, vehicle_id)
        new = Contact(broker, now)
        if known is not None and known.serves(broker, now, within_s):
            is_same = _is_same(known.broker, broker)
            name = max(known.broker, broker, key=len) if is_same else broker
            others = (known.other, known.other_at) if is_same else (None, None)
            new = Contact(name, now, *others)
        elif known is not None:
            new = known._replace(other=broker, other_at=now)
            if known.other is None or broker not in known.brokers(now):
                contested.append(vehicle_id)
        row = {"vehicle_id": vehicle_id, **new._asdict()}
        put_row(connection, broker_contact, row, changed=Contact._fields)
    return contested


def note_poll(connection: Connection, broker: str, now: float) -> None:
    """Store that a broker has polled for work, for all vehicles that it serves."""
    connection.execute(
        update(broker_contact).where(broker_contact.c.broker == broker).values(at=now)
    )


def note_cut_off(connection: Connection, broker: str, now: float) -> None:
    """Store that a broker's poll was cut off: `URGENT_SERVED_S` ends for it in `CUT_OFF_S`."""
    connection.execute(
        update(broker_contact)
        .where(broker_contact.c.broker == broker)
        .values(at=now - URGENT_SERVED_S + CUT_OFF_S)
    )


_CONTACTS: Final = select(broker_contact)
_CONTACT: Final = _CONTACTS.where(broker_contact.c.vehicle_id == bindparam("vehicle_id"))


def contact(connection: Connection, vehicle_id: int) -> Contact | None:
    """Find the last requests of brokers about a vehicle; None if there was none."""
    row = connection.execute(_CONTACT, {"vehicle_id": vehicle_id}).one_or_none()
    return Contact(row.broker, row.at, row.other, row.other_at) if row else None


def contacts(connection: Connection) -> dict[int, Contact]:
    """Return the last requests of brokers by vehicle."""
    rows = connection.execute(_CONTACTS)
    return {row.vehicle_id: Contact(row.broker, row.at, row.other, row.other_at) for row in rows}


def _stored(row: Any) -> StoredVehicle:
    return StoredVehicle(row.vehicle_id, json.loads(row.state), row.registered_at, row.updated_at)
