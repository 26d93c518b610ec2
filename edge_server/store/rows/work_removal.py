"""Work that is deleted or queued anew: withdrawn missions are noted; old work is deleted."""

from sqlalchemy import ColumnElement, Connection, delete, insert, literal, select

from edge_server.store.rows.tables import plan, withdrawn, work
from edge_server.store.rows.work import (
    CLOSED,
    EVENT,
    STATE_VECTOR,
    Work,
    add_mission,
    newest_id,
)


def remove(connection: Connection, identifier: int) -> None:
    """Delete a piece of work."""
    connection.execute(delete(work).where(work.c.id == identifier))


def remove_of_plan(connection: Connection, plan_row: int, now: float) -> None:
    """Delete a plan's missions and note them as withdrawn."""
    _note_withdrawn(connection, work.c.plan == plan_row, now)
    connection.execute(delete(work).where(work.c.plan == plan_row))


def _note_withdrawn(connection: Connection, which: ColumnElement[bool], now: float) -> None:
    columns = work.c.id, plan.c.plan_id, work.c.vehicle_id, work.c.mission_id, literal(now)
    gone = select(*columns).join(plan, work.c.plan == plan.c.id).where(which)
    names = ["work_id", "plan_id", "vehicle_id", "mission_id", "withdrawn_at"]
    connection.execute(insert(withdrawn).from_select(names, gone))


def is_withdrawn(connection: Connection, vehicle_id: int, field: str, value: int | str) -> bool:
    """Whether a mission was cancelled or replaced, by its work_id, plan_id or mission_id."""
    query = select(withdrawn.c.work_id).where(withdrawn.c[field] == value)
    if field == "mission_id":
        query = query.where(withdrawn.c.vehicle_id == vehicle_id)
    return connection.execute(query.limit(1)).first() is not None


def queue_anew(connection: Connection, item: Work, now: float) -> None:
    """Queue a mission that has not begun under a new id, behind all other work."""
    if item.plan is None or item.body is None:
        raise TypeError("only a mission of a plan can be queued anew")
    _note_withdrawn(connection, work.c.id == item.id, now)
    remove(connection, item.id)
    add_mission(
        connection,
        plan_row=item.plan,
        body=item.body,
        now=item.created_at,
        expires_at=item.expires_at,
        place=item.place,
    )


def delete_withdrawn(connection: Connection, before: float) -> None:
    """Delete withdrawn missions from before a time, on which no broker reports any more."""
    connection.execute(delete(withdrawn).where(withdrawn.c.withdrawn_at < before))


def delete_requests(connection: Connection, before: float) -> None:
    """Delete closed requests; the newest work stays, since cursors are compared with its id."""
    connection.execute(
        delete(work).where(
            work.c.kind == STATE_VECTOR,
            work.c.state == CLOSED,
            work.c.expires_at < before,
            work.c.id < newest_id(connection),
        )
    )


def delete_events(connection: Connection, before: float) -> None:
    """Delete events that were received before a time; the newest work stays."""
    connection.execute(
        delete(work).where(
            work.c.kind == EVENT,
            work.c.created_at < before,
            work.c.id < newest_id(connection),
        )
    )
