"""Locks on what only one transaction at a time may do, among all programs on one database.

SQLite has one writer anyway, so these locks cost nothing there. PostgreSQL's writers run
concurrently; each takes the locks that it needs (advisory, until its end) and then sees what the
one before it has committed. They are always taken in the order of this file, so no deadlock occurs.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple
from zlib import crc32

from sqlalchemy import Connection, text


class Lock(NamedTuple):
    """Key of an advisory lock, the same in all programs."""

    family: int
    number: int = 0


_OURS: Final = 0x0FA2_0000  # Far from what another program on the database may count from
_HELD: Final = "edge_locks"
_BUCKETS: Final = 256

MIGRATION: Final = Lock(_OURS + 1)
"""The shape of the database."""
KEYS: Final = Lock(_OURS + 2)
"""Which keys there are: programs that start together make one set."""
WORK: Final = Lock(_OURS + 3)
"""Plans, missions and their status: names, queue limits, expiry, dispatch, the broker's cursor."""
_VEHICLE: Final = _OURS + 4
_STREAM: Final = _OURS + 5
RELAY: Final = _OURS + 6
"""Family of the locks that relays hold while they live, by their number."""
OPEN_RELAY: Final = _OURS + 7
"""The same while they reach the cloud."""

_TAKE: Final = text(
    "SELECT pg_advisory_xact_lock(wanted.family, wanted.number) FROM "
    "unnest(CAST(:families AS int[]), CAST(:numbers AS int[])) AS wanted(family, number)"
)


def of_vehicle(vehicle_id: int) -> Lock:
    """Return the lock of a vehicle's row; numbers beyond 31 bits share locks."""
    return Lock(_VEHICLE, vehicle_id % 2**31)


def of_stream(vehicle_id: int, kind: str) -> Lock:
    """Return the lock of a stream's end, so that its rows become visible in the order of their ids.

    PostgreSQL assigns an id before the commit: without this lock a row could be committed after
    a later one has been seen and sent. Streams share a few hundred locks, so that a request with
    very many streams does not fill the database's lock table.
    """
    return Lock(_STREAM, crc32(f"{vehicle_id}/{kind}".encode()) % _BUCKETS)


def take(connection: Connection, wanted: Iterable[Lock]) -> None:
    """Acquire the locks that this transaction does not hold yet, waiting for other holders."""
    if connection.dialect.name != "postgresql":
        return
    held: set[Lock] = connection.info.setdefault(_HELD, set())
    missing = sorted(set(wanted) - held)
    if missing:
        numbers = {
            "families": [lock.family for lock in missing],
            "numbers": [lock.number for lock in missing],
        }
        connection.execute(_TAKE, numbers).close()
        held.update(missing)


def reset(connection: Connection) -> None:
    """Note that a transaction begins, which holds no locks."""
    connection.info.pop(_HELD, None)
