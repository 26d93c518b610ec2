"""How much waits in the outbox, for those who watch over it."""

from typing import Final, NamedTuple

from sqlalchemy import Connection, func, select

from edge_server.store.tables import outbox, telemetry

_STATUS_DIGITS: Final = 3


class Waiting(NamedTuple):
    """Rows of the outbox by kind, and dead letters by kind and the cloud's status."""

    queued: dict[str, int]
    dead: dict[tuple[str, str], int]


def count(connection: Connection) -> Waiting:
    """Count what waits; one pass over an index, so its time grows with the backlog."""
    queued: dict[str, int] = {}
    dead: dict[tuple[str, str], int] = {}
    rows = connection.execute(
        select(outbox.c.kind, outbox.c.state, func.count()).group_by(outbox.c.kind, outbox.c.state)
    )
    for kind, state, number in rows:
        if state == "dead":
            dead = dead or _dead(connection)
        else:
            queued[kind] = queued.get(kind, 0) + number
    return Waiting(queued, dead)


def _dead(connection: Connection) -> dict[tuple[str, str], int]:
    status = func.substr(outbox.c.last_error, 1, _STATUS_DIGITS)
    rows = connection.execute(
        select(outbox.c.kind, status, func.count())
        .where(outbox.c.state == "dead")
        .group_by(outbox.c.kind, status)
    )
    return {(kind, code if code.isdigit() else "none"): number for kind, code, number in rows}


def oldest_received_at(connection: Connection) -> float | None:
    """When the first record that still has to be sent was received; None when none waits."""
    found: float | None = connection.execute(
        select(telemetry.c.received_at)
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(outbox.c.state == "queued")
        .order_by(outbox.c.id)
        .limit(1)
    ).scalar_one_or_none()
    return found
