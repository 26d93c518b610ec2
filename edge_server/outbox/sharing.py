"""Several relays on one PostgreSQL database: each stream is sent by one of them at a time.

A relay holds an advisory lock with its number while its session lives, and writes that number into
the rows of the streams that it takes (SELECT ... FOR UPDATE SKIP LOCKED, so that nobody waits for
another who takes). A stream whose owner's lock is gone is free: the moment a relay is killed, its
session ends and the others take over. Every relay takes its share of all streams. One whose way to
the cloud is blocked leaves them to those who get through, and tries with one now and then.

Should a session be lost while its relay lives on, two may send one stream for a moment. Each goes
record by record in order and repeats the same keys, so the cloud's effect stays once and in order.
"""

import secrets
from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from math import ceil
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, Engine, TextClause, text

from edge_server.outbox.queue import PRIORITY, Stream
from edge_server.outbox.streams import Found, Situation
from edge_server.store import locks

TRIAL_S: Final = 10.0
"""So long in turn a blocked relay has one stream to try with, and none; others get through."""

# One step per stream along the outbox's index, however many rows a stream has
_LOOK: Final = text("""
WITH RECURSIVE lane AS (
  (SELECT vehicle_id, kind FROM outbox ORDER BY vehicle_id, kind LIMIT 1)
  UNION ALL
  SELECT following.vehicle_id, following.kind
  FROM lane, LATERAL (
    SELECT vehicle_id, kind FROM outbox
    WHERE (outbox.vehicle_id, outbox.kind) > (lane.vehicle_id, lane.kind)
    ORDER BY vehicle_id, kind LIMIT 1) AS following
)
SELECT lane.vehicle_id, lane.kind,
  (SELECT max(id) FROM outbox WHERE outbox.vehicle_id = lane.vehicle_id
    AND outbox.kind = lane.kind AND outbox.state = 'queued') AS newest,
  stream.vehicle_id IS NOT NULL AS is_known, stream.owner
FROM lane LEFT JOIN stream ON stream.vehicle_id = lane.vehicle_id AND stream.kind = lane.kind
""")
_RELAYS: Final = """
SELECT CAST(objid AS bigint) FROM pg_locks
WHERE locktype = 'advisory' AND granted AND objsubid = 2 AND classid = CAST(:{family} AS oid)
AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
"""
_COUNT: Final = text(
    "SELECT (SELECT count(*) FROM stream) AS streams, "  # noqa: S608  # our own words
    f"ARRAY({_RELAYS.format(family='alive')}) AS alive, "
    f"ARRAY({_RELAYS.format(family='open')}) AS open"
)
_LISTED: Final = (
    "SELECT * FROM unnest(CAST(:vehicle_ids AS int[]), CAST(:kinds AS text[])) "
    "AS listed(vehicle_id, kind)"
)
_INTRODUCE: Final = text(f"INSERT INTO stream (vehicle_id, kind) {_LISTED} ON CONFLICT DO NOTHING")
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
_GIVE: Final = text(
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
    """How many streams there are, and which relays live and get through."""

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

    def look(self, situation: Situation) -> Found:
        """Find what has come; take free streams up to our share, and give back beyond it."""
        self._tell_whether_open(is_open=situation.is_open)
        rows = self._rows()
        count = _Count(*self._session.execute(_COUNT, _FAMILIES).one())
        unknown = [row.stream for row in rows if not row.is_known]
        share = self._share(situation, count._replace(streams=count.streams + len(unknown)))
        gone = {row.stream for row in rows if row.owner != self._me} & self._mine
        self._mine -= gone
        if len(self._mine) < share:
            self._introduce(unknown)
            free = [row.stream for row in rows if row.newest and row.owner not in count.alive]
            self._take(free, share - len(self._mine))
        elif len(self._mine) > share:
            kept = situation.busy if situation.is_open else situation.flying
            gone |= self._give(sorted(self._mine - kept), len(self._mine) - share)
        foreign = {row.stream for row in rows} - self._mine
        return Found(self._news(rows), gone | foreign)

    def close(self) -> None:
        """End the session, and with it every claim."""
        self._session.close()

    def _share(self, situation: Situation, count: _Count) -> int:
        others = sum(number != self._me for number in count.open)
        if situation.is_open:
            return ceil(count.streams / (others + 1))
        if not others:
            return ceil(count.streams / max(len(count.alive), 1))
        return int(situation.now % (2 * TRIAL_S) < TRIAL_S)

    def _rows(self) -> list[_Row]:
        found = self._session.execute(_LOOK)
        return [_Row(Stream(row[0], row[1]), row[2], row[3], row[4]) for row in found]

    def _news(self, rows: Iterable[_Row]) -> set[Stream]:
        news = set()
        for stream, newest, _, _ in rows:
            if stream in self._mine and newest is not None and newest > self._seen.get(stream, 0):
                self._seen[stream] = newest
                news.add(stream)
        return news

    def _introduce(self, streams: list[Stream]) -> None:
        if streams:
            self._do(_INTRODUCE, streams).close()

    def _take(self, free: list[Stream], most: int) -> None:
        """Take the most urgent ones."""
        wanted = sorted(free, key=lambda stream: PRIORITY[stream.kind])[:most]
        if wanted:
            taken = self._do(_TAKE, wanted, me=self._me, **_FAMILIES)
            self._mine.update(Stream(*row) for row in taken)

    def _give(self, idle: list[Stream], most: int) -> AbstractSet[Stream]:
        given = set(idle[:most])
        if given:
            self._do(_GIVE, given, me=self._me).close()
            self._mine -= given
            for stream in given:
                self._seen.pop(stream, None)
        return given

    def _tell_whether_open(self, *, is_open: bool) -> None:
        if is_open != self._is_open:
            act = "pg_advisory_lock" if is_open else "pg_advisory_unlock"
            self._lock(act, locks.OPEN_RELAY)
            self._is_open = is_open

    def _lock(self, act: str, family: int) -> None:
        statement = text(f"SELECT {act}(:family, :number)")
        self._session.execute(statement, {"family": family, "number": self._me}).close()

    def _do(self, statement: TextClause, streams: Iterable[Stream], **values: object) -> Any:
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
    """Open a session that nobody else uses and that ends with us."""
    session = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
    session.detach()
    # A claim that is lost with the server's power is made again
    session.execute(text("SET synchronous_commit = off")).close()
    return session
