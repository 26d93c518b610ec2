"""The POSTs that were answered with 201, so that a repeated one has no second effect."""

from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

from sqlalchemy import Connection, bindparam, delete, insert, select

from edge_server.store.rows.tables import idempotency


class Answered(NamedTuple):
    """The answer to a POST, from which it can be given again."""

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


_FIND: Final = select(*_COLUMNS).where(
    idempotency.c.key == bindparam("wanted"), idempotency.c.owner == bindparam("by")
)
_ADD: Final = insert(idempotency)


def find(connection: Connection, key: str, owner: str) -> Answered | None:
    """Find the answer of a key."""
    row = connection.execute(_FIND, {"wanted": key, "by": owner}).one_or_none()
    return Answered(*row) if row else None


def find_all(connection: Connection, keys: Collection[str], owner: str) -> dict[str, Answered]:
    """Find the answers of many keys."""
    if not keys:
        return {}
    rows = connection.execute(
        select(idempotency.c.key, *_COLUMNS).where(
            idempotency.c.key.in_(keys), idempotency.c.owner == owner
        )
    )
    return {row[0]: Answered(*row[1:]) for row in rows}


def add(connection: Connection, key: str, owner: str, answered: Answered) -> None:
    """Store an answer."""
    connection.execute(_ADD, {"key": key, "owner": owner, **answered._asdict()})


def add_all(connection: Connection, answers: Mapping[str, Answered], owner: str) -> None:
    """Store many answers, by key."""
    connection.execute(
        _ADD,
        [{"key": key, "owner": owner, **one._asdict()} for key, one in answers.items()],
    )


def delete_before(connection: Connection, moment: float) -> None:
    """Delete keys from before a time."""
    connection.execute(delete(idempotency).where(idempotency.c.created_at < moment))
