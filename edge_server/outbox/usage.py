"""How much the database holds, cheap enough to be asked often, and receipts that may go.

SQLite counts its pages: what is in use is what has been taken from the disk less the free list.
PostgreSQL is asked for the rows themselves while they are few; beyond, it keeps their number in its
statistics: times the size of recent ones it is an estimate, which a vacuum does not change, unlike
the size of its files.
"""

from typing import Final

from sqlalchemy import Connection, delete, func, select, text, tuple_

from edge_server.outbox.budget import Usage
from edge_server.store.tables import idempotency, telemetry, tombstone

_ROW_OVERHEAD_BYTES: Final = 250  # Row headers and index entries of a record on PostgreSQL
_SAMPLE: Final = 200
_FEW: Final = 20_000  # Rows that are added up in some milliseconds
_LIVE_ROWS: Final = text(
    "SELECT coalesce(sum(n_live_tup), 0) FROM pg_stat_user_tables WHERE relname = 'telemetry'"
)


def measure(connection: Connection) -> Usage:
    """Say how many bytes are in use, as this transaction sees it."""
    pictures = connection.execute(
        select(func.coalesce(func.sum(telemetry.c.size_bytes), 0)).where(
            telemetry.c.kind == "image"
        )
    ).scalar_one()
    in_use = _pages(connection) if connection.dialect.name == "sqlite" else _rows(connection)
    return Usage(max(in_use - pictures, 0), pictures)


def _pages(connection: Connection) -> int:
    count, free, size = (
        int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())
        for name in ("page_count", "freelist_count", "page_size")
    )
    return (count - free) * size


def _rows(connection: Connection) -> int:
    some = select(telemetry.c.size_bytes).limit(_FEW + 1).subquery()
    total = select(func.count(), func.coalesce(func.sum(some.c.size_bytes), 0)).select_from(some)
    number, size_bytes = connection.execute(total).one()
    return int(size_bytes + number * _ROW_OVERHEAD_BYTES) if number <= _FEW else _many(connection)


def _many(connection: Connection) -> int:
    live = int(connection.execute(_LIVE_ROWS).scalar_one())
    newest = select(telemetry.c.size_bytes).order_by(telemetry.c.id.desc()).limit(_SAMPLE)
    mean = connection.execute(select(func.avg(newest.subquery().c.size_bytes))).scalar_one()
    return int(live * (float(mean or 0.0) + _ROW_OVERHEAD_BYTES))


def forget_receipts(connection: Connection, before: float, limit: int) -> int:
    """Forget the oldest tombstones and idempotency keys of before a time; returns how many."""
    oldest_tombstones = (
        select(tombstone.c.message_id)
        .where(tombstone.c.delivered_at < before)
        .order_by(tombstone.c.delivered_at)
        .limit(limit)
    )
    gone = connection.execute(
        delete(tombstone).where(tombstone.c.message_id.in_(oldest_tombstones))
    ).rowcount
    name = tuple_(idempotency.c.key, idempotency.c.owner)
    oldest_keys = (
        select(idempotency.c.key, idempotency.c.owner)
        .where(idempotency.c.created_at < before)
        .order_by(idempotency.c.created_at)
        .limit(limit)
    )
    return gone + connection.execute(delete(idempotency).where(name.in_(oldest_keys))).rowcount
