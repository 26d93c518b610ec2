"""How much the disk may hold, how much it holds, and what is dropped when it is full.

 80 %   old receipts are deleted, then state_vector and pose are thinned
 95 %   pictures are refused
100 %   the oldest records of the droppable kinds are dropped
105 %   every record is refused; up to here is the reserve for alarms and mission reports

`measure` is cheap enough to be called often. SQLite counts its pages: in use is what has been taken
from the disk less the free list. On PostgreSQL the rows are added up while they are few; beyond
that the number of rows comes from its statistics and is multiplied by the size of recent rows. A
vacuum does not change this estimate, unlike the size of the database's files.
"""

import math
from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple

from sqlalchemy import Connection, delete, func, select, text, tuple_

from edge_server.store.rows.tables import idempotency, telemetry, tombstone

THINNED: Final = ("state_vector", "pose")
"""Kinds of which one record per interval holds nearly as much information."""
THINNING_INTERVAL_S: Final = 10.0
DROPPED: Final = ("state_vector", "pose", "battery")
"""Kinds whose oldest records may be dropped; never an alarm, a report, an observation or a gap."""
URGENT: Final = frozenset({"alarm", "mission_report"})
_ROW_OVERHEAD_BYTES: Final = 250  # Row headers and index entries of a record on PostgreSQL
_SAMPLE: Final = 200
_FEW: Final = 20_000  # Rows that are added up in some milliseconds
_LIVE_ROWS: Final = text(
    "SELECT coalesce(sum(n_live_tup), 0) FROM pg_stat_user_tables WHERE relname = 'telemetry'"
)


class Level(IntEnum):
    """How full the disk budget is."""

    NORMAL = 0
    THINNING = 1
    NO_PICTURES = 2
    DROPPING = 3
    FULL = 4


_FROM: Final = (
    (1.05, Level.FULL),
    (1.0, Level.DROPPING),
    (0.95, Level.NO_PICTURES),
    (0.8, Level.THINNING),
)


class Usage(NamedTuple):
    """Bytes that are in use; pictures have a budget of their own."""

    data_bytes: int
    picture_bytes: int


def level(used_bytes: float, budget_bytes: float) -> Level:
    """Return how full a budget is."""
    share = used_bytes / budget_bytes
    return next((found for bound, found in _FROM if share >= bound), Level.NORMAL)


def has_room(kind: str, now: Level) -> bool:
    """Whether a record of a kind is accepted at a level, once everything droppable is dropped."""
    if kind == "image":
        return now < Level.NO_PICTURES
    return now < Level.DROPPING or (kind in URGENT and now < Level.FULL)


class Sample(NamedTuple):
    """A record that may be thinned out: its row, and when it was recorded [s since 1970]."""

    row: int
    recorded_at: float


def superfluous(
    samples: Iterable[Sample], last_kept: float | None
) -> tuple[list[int], float | None]:
    """Return the rows to drop so that the first record of each interval stays.

    `samples` are in the order of their stream. `last_kept` is the interval of the record that was
    kept last before them; its value after them is returned too. A clock that was set back only
    starts another interval.
    """
    dropped = []
    for row, recorded_at in samples:
        interval = recorded_at // THINNING_INTERVAL_S
        if interval == last_kept:
            dropped.append(row)
        last_kept = interval
    return dropped, last_kept


_PICTURES: Final = select(func.coalesce(func.sum(telemetry.c.size_bytes), 0)).where(
    telemetry.c.kind == "image"
)


def measure(connection: Connection) -> Usage:
    """Return how many bytes are in use, as this transaction sees it."""
    pictures = connection.execute(_PICTURES).scalar_one()
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


def newest_receipt(connection: Connection) -> float:
    """Return when the newest tombstone or idempotency key was stored; infinity without any."""
    newest = (
        connection.execute(select(func.max(column))).scalar_one()
        for column in (tombstone.c.delivered_at, idempotency.c.created_at)
    )
    return max((float(one) for one in newest if one is not None), default=math.inf)


def delete_receipts(connection: Connection, before: float, limit: int) -> int:
    """Delete the oldest tombstones and idempotency keys from before a time; returns how many."""
    oldest_tombstones = (
        select(tombstone.c.message_id)
        .where(tombstone.c.delivered_at < before)
        .order_by(tombstone.c.delivered_at)
        .limit(limit)
    )
    deleted = connection.execute(
        delete(tombstone).where(tombstone.c.message_id.in_(oldest_tombstones))
    ).rowcount
    name = tuple_(idempotency.c.key, idempotency.c.owner)
    oldest_keys = (
        select(idempotency.c.key, idempotency.c.owner)
        .where(idempotency.c.created_at < before)
        .order_by(idempotency.c.created_at)
        .limit(limit)
    )
    return deleted + connection.execute(delete(idempotency).where(name.in_(oldest_keys))).rowcount
