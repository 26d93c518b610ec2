"""The audit log as rows: appended, read, and cut at its old end.

Every row holds the hash of the one before it and its own: SHA-256 over its canonical JSON (keys in
order, no spaces, UTF-8), in which the hash before stands as hex. `audit_chain` holds both ends of
the chain; a writer locks it until the commit, so that no two rows follow the same one.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, delete, func, insert, select, text, update

from edge_server.store.rows.tables import audit, audit_chain

_PAGE: Final = 500
_WIDTHS: Final = {
    name: audit.c[name].type.length  # type: ignore[attr-defined]  # they are all String
    for name in ("who", "role", "key_prefix", "address", "request_id", "action", "object", "result")
}


class Entry(NamedTuple):
    """An audited write: who did what to which object, from where, with what result."""

    at: float  # [s] since the epoch
    who: str
    role: str
    key_prefix: str
    address: str
    request_id: str
    action: str
    object: str
    result: str


class Row(NamedTuple):
    """An entry in its place in the chain."""

    id: int
    entry: Entry
    prev_hash: bytes
    hash: bytes


class Ends(NamedTuple):
    """The chain's ends: the newest row that was removed, and the newest one of all."""

    first_id: int
    first_hash: bytes
    last_id: int
    last_hash: bytes


def hash_of(row_id: int, entry: Entry, prev_hash: bytes) -> bytes:
    """Hash a row in its place."""
    fields = {"id": row_id, **entry._asdict(), "prev_hash": prev_hash.hex()}
    canonical = json.dumps(fields, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(canonical.encode()).digest()


def append(connection: Connection, entry: Entry) -> Row:
    """Write the next row; text that is longer than its column is cut."""
    ends = _ends(connection, lock=True)
    texts = {name: _storable(getattr(entry, name), width) for name, width in _WIDTHS.items()}
    kept = entry._replace(at=round(entry.at, 3), **texts)
    row_id = ends.last_id + 1
    row = Row(row_id, kept, ends.last_hash, hash_of(row_id, kept, ends.last_hash))
    connection.execute(
        insert(audit),
        {"id": row_id, **kept._asdict(), "prev_hash": row.prev_hash, "hash": row.hash},
    )
    connection.execute(update(audit_chain).values(last_id=row_id, last_hash=row.hash))
    return row


def ends(connection: Connection) -> Ends:
    """Return both ends of the chain."""
    return _ends(connection, lock=False)


def freeze(connection: Connection) -> None:
    """Make this transaction see one state of the log, as on SQLite it always does."""
    if connection.dialect.name == "postgresql":
        connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ"))


def rows(connection: Connection, after_id: int = 0) -> Iterator[Row]:
    """Return the rows after an id, in order, a page at a time."""
    while found := page(connection, after_id=after_id, limit=_PAGE):
        yield from found
        after_id = found[-1].id


def page(connection: Connection, *, after_id: int, limit: int, since_s: float = 0.0) -> list[Row]:
    """Return some rows after an id, in order."""
    query = select(audit).where(audit.c.id > after_id, audit.c.at >= since_s)
    return [_row(found) for found in connection.execute(query.order_by(audit.c.id).limit(limit))]


def last_of(connection: Connection, objects: Sequence[str], result: str) -> Entry | None:
    """Return the newest entry about one of these objects with this result."""
    query = select(audit).where(audit.c.object.in_(objects), audit.c.result == result)
    found = connection.execute(query.order_by(audit.c.id.desc()).limit(1)).one_or_none()
    return None if found is None else _row(found).entry


def cut(connection: Connection, before_s: float) -> int:
    """Remove the oldest rows, up to the first that is younger; returns how many.

    The end of the chain moves with them, so that what stays can be verified.
    """
    old = _ends(connection, lock=True)
    youngest = select(func.min(audit.c.id)).where(audit.c.at >= before_s)
    stays = connection.execute(youngest).scalar_one()
    removed = select(audit.c.id, audit.c.hash).order_by(audit.c.id.desc()).limit(1)
    if stays is not None:
        removed = removed.where(audit.c.id < stays)
    last_removed = connection.execute(removed).one_or_none()
    if last_removed is None or last_removed.id <= old.first_id:
        return 0  # The age of missing rows is unknown
    first_id, first_hash = last_removed
    connection.execute(update(audit_chain).values(first_id=first_id, first_hash=first_hash))
    return connection.execute(delete(audit).where(audit.c.id <= first_id)).rowcount


def _ends(connection: Connection, *, lock: bool) -> Ends:
    query = select(
        audit_chain.c.first_id,
        audit_chain.c.first_hash,
        audit_chain.c.last_id,
        audit_chain.c.last_hash,
    )
    found = connection.execute(query.with_for_update() if lock else query).one()
    return Ends(*found)


def _row(found: Any) -> Row:
    entry = Entry(*(getattr(found, name) for name in Entry._fields))
    return Row(found.id, entry, found.prev_hash, found.hash)


def _storable(text: str, width: int) -> str:
    """Replace what a database cannot store: NUL and lone surrogates."""
    return text.replace("\0", "\N{SYMBOL FOR NULL}").encode(errors="replace").decode()[:width]
