"""Which POSTs have been answered with 201, so that a repeated one has no second effect."""

from typing import NamedTuple

from sqlalchemy import Connection, delete, insert, select

from edge_server.store.tables import idempotency


class Answered(NamedTuple):
    """A POST that was answered before; enough to answer it again in the same words."""

    route: str
    body_sha256: bytes
    object_id: int
    message_id: str | None
    created_at: float


def find(connection: Connection, key: str, role: str) -> Answered | None:
    """Look a key up."""
    row = connection.execute(
        select(
            idempotency.c.route,
            idempotency.c.body_sha256,
            idempotency.c.object_id,
            idempotency.c.message_id,
            idempotency.c.created_at,
        ).where(idempotency.c.key == key, idempotency.c.role == role)
    ).one_or_none()
    return Answered(*row) if row else None


def remember(connection: Connection, key: str, role: str, answered: Answered) -> None:
    """Keep what was answered."""
    connection.execute(insert(idempotency), {"key": key, "role": role, **answered._asdict()})


def forget_before(connection: Connection, moment: float) -> None:
    """Drop keys that are too old to be repeated."""
    connection.execute(delete(idempotency).where(idempotency.c.created_at < moment))
