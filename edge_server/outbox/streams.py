"""Which streams a relay sends: all of them if it is the only relay, else its share.

`AllStreams` serves a SQLite file, whose one relay holds the lock of the state folder.
`SharedStreams` serves a PostgreSQL database with any number of relays: each stream is sent by one
of them at a time. A relay holds an advisory lock with its number while its session lives, and
writes that number into the rows of the streams that it takes (SELECT ... FOR UPDATE SKIP LOCKED, so
that no relay waits for another). A stream whose owner holds no lock is free: when a relay is
killed, its session ends and the others take over at once. Every relay takes its share of all
streams. A relay that cannot reach the cloud leaves them to those that can, and from time to time
tries with one.

If a session is lost while its relay lives on, two relays may send one stream for a moment. Each
sends record by record in order under the same keys, so the cloud applies each record once and in
order.

ReplacedError  the database file is not the one that was read before
"""

import secrets
from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from math import ceil
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

from sqlalchemy import Connection, Engine, TextClause, text

from edge_server.outbox import queue
from edge_server.outbox.queue import PRIORITY, Stream
from edge_server.store.connection import locks
from edge_server.store.connection.database import Database


class ReplacedError(Exception):
    """The database file is not the one that was read before."""


class RelayStatus(NamedTuple):
    """The relay's state; time is in monotonic seconds."""

    now: float
    is_open: bool  # Whether the cloud is reachable, as far as the relay knows
    busy: AbstractSet[Stream]  # Some of their records are read, in flight or not written yet
    in_flight: AbstractSet[Stream]  # Some of their records are in flight or not written yet


class StreamChanges(NamedTuple):
    """What a look at the database has found."""

    new: AbstractSet[Stream]  # Ours, with rows that were not there before
    gone: AbstractSet[Stream]  # Not ours, or no longer ours


class Streams(Protocol):
    """Which streams this relay sends."""

    def look(self, status: RelayStatus) -> StreamChanges:
        """Find new rows; take and release streams if there are other relays."""

    def close(self) -> None:
        """Release all streams."""


class AllStreams:
    """Every stream of a database that no other relay reads."""

    def __init__(self, database: Database, path: Path) -> None:
        self._database = database
        self._path = path
        self._inode = path.stat().st_ino
        self._newest_row = 0

    def look(self, _status: RelayStatus) -> StreamChanges:
        """Find streams with new rows.

        Raises:
            ReplacedError: if the server has set a broken database aside and made a new one.
        """
        self._check_file()
        with self._database.read() as connection:
            new, self._newest_row = queue.streams_after(connection, self._newest_row)
        return StreamChanges(new, frozenset())

    def close(self) -> None:
        """Do nothing: no stream is taken."""

    def _check_file(self) -> None:
        try:
            inode = self._path.stat().st_ino
        except FileNotFoundError:
            inode = 0
        if inode != self._inode:
            raise ReplacedError(f"{self._path} has been replaced")


TRIAL_S: Final = 10.0
"""A blocked relay beside working ones has one stream to try with for so long, then none."""

# One step per stream along the outbox's index, however many rows a stream has
_LOOK: Final = text("""
WITH RECURSIVE found AS (
  (SELECT vehicle_id, kind FROM outbox ORDER BY vehicle_id, kind LIMIT 1)
  UNION ALL
  SELECT following.vehicle_id, following.kind
  FROM found, LATERAL (
    SELECT vehicle_id, kind FROM outbox
    WHERE (outbox.vehicle_id, outbox.kind) > (found.vehicle_id, found.kind)
    ORDER BY vehicle_id, kind LIMIT 1) AS following
)
SELECT found.vehicle_id, found.kind,
  (SELECT max(id) FROM outbox WHERE outbox.vehicle_id = found.vehicle_id
    AND outbox.kind = found.kind AND outbox.state = 'queued') AS newest,
  stream.vehicle_id IS NOT NULL AS is_known, stream.owner
FROM found
LEFT JOIN stream ON stream.vehicle_id = found.vehicle_id AND stream.kind = found.kind
""")
_RELAYS: Final = """
SELECT CAST(objid AS bigint) FROM pg_locks
WHERE locktype = 'advisory' AND granted AND objsubid = 2 AND classid = CAST(:{family} AS oid)
AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
"""
_COUNT: Final = text(
    "SELECT (SELECT count(*) FROM stream) AS streams, "  # noqa: S608  # constant text
    f"ARRAY({_RELAYS.format(family='alive')}) AS alive, "
    f"ARRAY({_RELAYS.format(family='open')}) AS open"
)
_LISTED: Final = (
    "SELECT * FROM unnest(CAST(:vehicle_ids AS int[]), CAST(:kinds AS text[])) "
    "AS listed(vehicle_id, kind)"
)
_ADD: Final = text(f"INSERT INTO stream (vehicle_id, kind) {_LISTED} ON CONFLICT DO NOTHING")
_TAKE: Final = text(f"""
UPDATE stream SET owner = :me FROM (
  SELECT vehicle_id, kind FROM stream
  WHERE (vehicle_id, kind) IN ({_LISTED})
  AND (owner IS NULL OR NOT EXISTS (
    SELECT FROM ({_RELAYS.format(family="alive")}) AS relay(number) WHERE relay.number = owner))
  ORDER BY vehicle_id, kind FOR UPDATE SKIP LOCKED
) AS free
WHERE stream.vehicle_id = free.vehicle_id AND stream.kind = free.kind
RETURNING stream.vehicle_id, stream.kind
""")  # noqa: S608  # as above
_RELEASE: Final = text(
    f"UPDATE stream SET owner = NULL WHERE owner = :me AND (vehicle_id, kind) IN ({_LISTED})"  # noqa: S608  # as above
)
_FAMILIES: Final = {"alive": locks.RELAY, "open": locks.OPEN_RELAY}


class _Row(NamedTuple):
    """A stream with something in the outbox."""

    stream: Stream
    newest: int | None  # Newest row that is due
    is_known: bool
    owner: int | None


class _Count(NamedTuple):
    """How many streams there are, which relays live, and which of them reach the cloud."""

    streams: int
    alive: list[int]
    open: list[int]


class SharedStreams:
    """The streams of one relay among others; raises DBAPIError when its session is lost."""

    def __init__(self, engine: Engine) -> None:
        self._me = secrets.randbelow(2**31)
        self._is_open = False
        self._mine: set[Stream] = set()
        self._seen: dict[Stream, int] = {}
        self._session = _own_session(engine)
        self._lock("pg_advisory_lock", locks.RELAY)

    def look(self, status: RelayStatus) -> StreamChanges:
        """Find new rows; take free streams up to our share, and release those beyond it."""
        self._publish_open(is_open=status.is_open)
        rows = self._rows()
        count = _Count(*self._session.execute(_COUNT, _FAMILIES).one())
        unknown = [row.stream for row in rows if not row.is_known]
        share = self._share(status, count._replace(streams=count.streams + len(unknown)))
        gone = {row.stream for row in rows if row.owner != self._me} & self._mine
        self._mine -= gone
        if len(self._mine) < share:
            self._add(unknown)
            free = [row.stream for row in rows if row.newest and row.owner not in count.alive]
            self._take(free, share - len(self._mine))
        elif len(self._mine) > share:
            kept = status.busy if status.is_open else status.in_flight
            gone |= self._release(sorted(self._mine - kept), len(self._mine) - share)
        foreign = {row.stream for row in rows} - self._mine
        return StreamChanges(self._new(rows), gone | foreign)

    def close(self) -> None:
        """End the session, which releases every stream."""
        self._session.close()

    def _share(self, status: RelayStatus, count: _Count) -> int:
        others = sum(number != self._me for number in count.open)
        if status.is_open:
            return ceil(count.streams / (others + 1))
        if not others:
            return ceil(count.streams / max(len(count.alive), 1))
        return int(status.now % (2 * TRIAL_S) < TRIAL_S)

    def _rows(self) -> list[_Row]:
        found = self._session.execute(_LOOK)
        return [_Row(Stream(row[0], row[1]), row[2], row[3], row[4]) for row in found]

    def _new(self, rows: Iterable[_Row]) -> set[Stream]:
        new = set()
        for stream, newest, _, _ in rows:
            if stream in self._mine and newest is not None and newest > self._seen.get(stream, 0):
                self._seen[stream] = newest
                new.add(stream)
        return new

    def _add(self, streams: list[Stream]) -> None:
        if streams:
            self._execute(_ADD, streams).close()

    def _take(self, free: list[Stream], limit: int) -> None:
        """Remove and return the most urgent streams."""
        wanted = sorted(free, key=lambda stream: PRIORITY[stream.kind])[:limit]
        if wanted:
            taken = self._execute(_TAKE, wanted, me=self._me, **_FAMILIES)
            self._mine.update(Stream(*row) for row in taken)

    def _release(self, idle: list[Stream], limit: int) -> AbstractSet[Stream]:
        released = set(idle[:limit])
        if released:
            self._execute(_RELEASE, released, me=self._me).close()
            self._mine -= released
            for stream in released:
                self._seen.pop(stream, None)
        return released

    def _publish_open(self, *, is_open: bool) -> None:
        if is_open != self._is_open:
            act = "pg_advisory_lock" if is_open else "pg_advisory_unlock"
            self._lock(act, locks.OPEN_RELAY)
            self._is_open = is_open

    def _lock(self, act: str, family: int) -> None:
        statement = text(f"SELECT {act}(:family, :number)")
        self._session.execute(statement, {"family": family, "number": self._me}).close()

    def _execute(self, statement: TextClause, streams: Iterable[Stream], **values: object) -> Any:
        listed = sorted(streams)
        return self._session.execute(
            statement,
            {
                "vehicle_ids": [stream.vehicle_id for stream in listed],
                "kinds": [stream.kind for stream in listed],
                **values,
            },
        )


def _own_session(engine: Engine) -> Connection:
    """Open a session that only this relay uses and that ends with it."""
    session = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
    session.detach()
    # A stream whose owner is lost in a power cut is taken again
    session.execute(text("SET synchronous_commit = off")).close()
    return session
