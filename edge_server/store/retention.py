"""Which rows have been kept for long enough."""

from sqlalchemy import Connection, delete, exists, select

from edge_server.store.tables import access_key, plan, work

_ROWS_AT_ONCE = 500


def forget_plans(connection: Connection, before: float, now: float) -> int:
    """Drop some plans received before a moment of which nothing can happen any more."""
    unfinished = exists().where(work.c.plan == plan.c.id, work.c.state != "closed")
    old = (
        select(plan.c.id)
        .where(plan.c.received_at < before, plan.c.expires_at < now, ~unfinished)
        .order_by(plan.c.id)
        .limit(_ROWS_AT_ONCE)
    )
    return connection.execute(delete(plan).where(plan.c.id.in_(old))).rowcount


def forget_keys(connection: Connection, before: float) -> int:
    """Drop keys that have opened nothing since before a moment.

    One that lay in a file stays: the file may still be there, and it must not open anything again.
    """
    ended = (access_key.c.revoked_at < before) | (access_key.c.expires_at < before)
    return connection.execute(delete(access_key).where(ended, ~access_key.c.in_file)).rowcount
