"""Plans as rows; their missions are rows of `store/rows/work.py`."""

import json
from collections.abc import Collection
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, bindparam, delete, exists, insert, select, update

from edge_server.store.connection.database import new_id, to_json
from edge_server.store.rows.tables import plan, work

_DELETED_AT_ONCE: Final = 500


class StoredPlan(NamedTuple):
    """A plan without its missions."""

    id: int
    plan_id: str
    body: dict[str, Any]
    received_at: float
    expires_at: float
    warnings: list[dict[str, str]]


def add(connection: Connection, stored: StoredPlan) -> int:
    """Store a plan (its `id` is ignored); returns its id."""
    result = connection.execute(insert(plan).values(_columns(stored)))
    return new_id(result)


def replace(connection: Connection, stored: StoredPlan) -> None:
    """Overwrite the plan with this id."""
    connection.execute(update(plan).where(plan.c.id == stored.id).values(_columns(stored)))


_BY_NUMBER: Final = select(plan).where(plan.c.id == bindparam("reference"))
_BY_ULID: Final = select(plan).where(plan.c.plan_id == bindparam("reference"))


def find(connection: Connection, reference: int | str) -> StoredPlan | None:
    """Find a plan by its number or its ULID."""
    query = _BY_NUMBER if isinstance(reference, int) else _BY_ULID
    row = connection.execute(query, {"reference": reference}).one_or_none()
    return _stored(row) if row else None


def page(
    connection: Connection, *, after_id: int, limit: int, since_s: float, vehicle_id: int | None
) -> list[StoredPlan]:
    """List plans, oldest first: those received from `since_s`, with a mission of the vehicle."""
    query = select(plan).where(plan.c.id > after_id, plan.c.received_at >= since_s)
    if vehicle_id is not None:
        of_vehicle = select(work.c.plan).where(work.c.vehicle_id == vehicle_id)
        query = query.where(plan.c.id.in_(of_vehicle))
    return [_stored(row) for row in connection.execute(query.order_by(plan.c.id).limit(limit))]


def names(connection: Connection, plan_ids: Collection[str]) -> dict[str, str]:
    """Give the names of plans that have one, by their ULIDs."""
    query = select(plan.c.plan_id, plan.c.body).where(plan.c.plan_id.in_(plan_ids))
    bodies = {row.plan_id: json.loads(row.body) for row in connection.execute(query)}
    return {plan_id: body["name"] for plan_id, body in bodies.items() if body.get("name")}


def remove(connection: Connection, identifier: int) -> None:
    """Delete a plan and its missions."""
    connection.execute(delete(plan).where(plan.c.id == identifier))


def delete_old(connection: Connection, before: float, now: float) -> int:
    """Delete some plans that were received before a time and have no unfinished mission."""
    unfinished = exists().where(work.c.plan == plan.c.id, work.c.state != "closed")
    old = (
        select(plan.c.id)
        .where(plan.c.received_at < before, plan.c.expires_at < now, ~unfinished)
        .order_by(plan.c.id)
        .limit(_DELETED_AT_ONCE)
    )
    return connection.execute(delete(plan).where(plan.c.id.in_(old))).rowcount


def _columns(stored: StoredPlan) -> dict[str, Any]:
    return {
        "plan_id": stored.plan_id,
        "body": to_json(stored.body),
        "received_at": stored.received_at,
        "expires_at": stored.expires_at,
        "warnings": to_json(stored.warnings),
    }


def _stored(row: Any) -> StoredPlan:
    return StoredPlan(
        row.id,
        row.plan_id,
        json.loads(row.body),
        row.received_at,
        row.expires_at,
        json.loads(row.warnings),
    )
