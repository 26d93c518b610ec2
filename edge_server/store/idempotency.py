"""Which POSTs have been answered with 201, so that a repeated one has no second effect."""

from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

from sqlalchemy import Connection, delete, insert, select

from edge_server.store.tables import idempotency


class Answered(NamedTuple):
    """A POST that was answered before; enough to answer it again in the same words."""

    route: str
    body_sha256: bytes
    object_id: int
    message_id: str | None
    created_at: float
    answer: str | None = None  # JSON, where it cannot be made again from the rest


_COLUMNS: Final = (
    idempotency.c.route,
    idempotency.c.body_sha256,
    idempotency.c.object_id,
    idempotency.c.message_id,
    idempotency.c.created_at,
    idempotency.c.answer,
)


def find(connection: Connection, key: str, owner: str) -> Answered | None:
    """Look a key up."""
    row = connection.execute(
        select(*_COLUMNS).where(idempotency.c.key == key, idempotency.c.owner == owner)
    ).one_or_none()
    return Answered(*row) if row else None


def find_all(connection: Connection, keys: Collection[str], owner: str) -> dict[str, Answered]:
    """Look many keys up; gives those that were answered before."""
    if not keys:
        return {}
    rows = connection.execute(
        select(idempotency.c.key, *_COLUMNS).where(
            idempotency.c.key.in_(keys), idempotency.c.owner == owner
        )
    )
    return {row[0]: Answered(*row[1:]) for row in rows}


def remember(connection: Connection, key: str, owner: str, answered: Answered) -> None:
    """Keep what was answered."""
    connection.execute(insert(idempotency), {"key": key, "owner": owner, **answered._asdict()})


def remember_all(connection: Connection, answers: Mapping[str, Answered], owner: str) -> None:
    """Keep what was answered, by key."""
    connection.execute(
        insert(idempotency),
        [{"key": key, "owner": owner, **one._asdict()} for key, one in answers.items()],
    )


def forget_before(connection: Connection, moment: float) -> None:
    """Drop keys that are too old to be repeated."""
    connection.execute(delete(idempotency).where(idempotency.c.created_at < moment))
