"""The outbox on the caller's transaction: put in, look at the heads, settle."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from sqlalchemy import Connection, bindparam, delete, func, insert, select, update

from edge_server.store import locks
from edge_server.store.database import insert_new
from edge_server.store.tables import outbox, telemetry, tombstone

PRIORITY: Final[Mapping[str, int]] = {
    "alarm": 0,
    "mission_report": 1,
    "gap": 1,
    "state_vector": 2,
    "pose": 3,
    "battery": 3,
    "observation": 3,
    "image": 4,
}
"""Lower goes first."""


class Stream(NamedTuple):
    """Records whose order is kept."""

    vehicle_id: int
    kind: str


class Parcel(NamedTuple):
    """One record on its way."""

    outbox_id: int
    record_id: int
    message_id: str
    stream: Stream
    payload: str
    attempts: int

    @property
    def size_bytes(self) -> int:
        """What it takes among others: its JSON and some words about it."""
        payload = self.payload
        return 64 + (len(payload) if payload.isascii() else len(payload.encode()))


class Delivered(NamedTuple):
    """A parcel that the cloud has confirmed."""

    parcel: Parcel
    status: int


_ENQUEUE: Final = insert(outbox)


def enqueue(connection: Connection, record_id: int, stream: Stream) -> None:
    """Make a record due; it follows whatever of its stream is committed before."""
    locks.take(connection, [locks.of_stream(*stream)])
    connection.execute(
        _ENQUEUE,
        {"record_id": record_id, "vehicle_id": stream.vehicle_id, "kind": stream.kind},
    )


def enqueue_all(connection: Connection, due: Sequence[tuple[int, Stream]]) -> None:
    """Make many records due, in this order."""
    locks.take(connection, {locks.of_stream(*stream) for _, stream in due})
    connection.execute(
        insert(outbox),
        [
            {"record_id": record_id, "vehicle_id": stream.vehicle_id, "kind": stream.kind}
            for record_id, stream in due
        ],
    )


def requeue(connection: Connection, record_id: int) -> None:
    """Make a record due again, as if it had never been tried."""
    connection.execute(
        update(outbox)
        .where(outbox.c.record_id == record_id)
        .values(state="queued", attempts=0, last_error=None)
    )


def streams_after(connection: Connection, outbox_id: int) -> tuple[set[Stream], int]:
    """Streams that got rows after this one, and the newest row's id."""
    newest = connection.execute(select(func.max(outbox.c.id))).scalar_one() or 0
    if newest <= outbox_id:
        return set(), outbox_id
    rows = connection.execute(
        select(outbox.c.vehicle_id, outbox.c.kind).where(outbox.c.id > outbox_id).distinct()
    )
    return {Stream(*row) for row in rows}, newest


def heads(connection: Connection, stream: Stream, after_id: int, limit: int) -> list[Parcel]:
    """The next records of a stream in order."""
    rows = connection.execute(
        select(
            outbox.c.id,
            outbox.c.record_id,
            telemetry.c.message_id,
            telemetry.c.payload,
            outbox.c.attempts,
        )
        .join(telemetry, telemetry.c.id == outbox.c.record_id)
        .where(
            outbox.c.vehicle_id == stream.vehicle_id,
            outbox.c.kind == stream.kind,
            outbox.c.state == "queued",
            outbox.c.id > after_id,
        )
        .order_by(outbox.c.id)
        .limit(limit)
    )
    return [Parcel(r[0], r[1], r[2], stream, r[3], r[4]) for r in rows]


_DELETE_RECORDS: Final = (
    delete(telemetry)
    .where(telemetry.c.message_id.in_(bindparam("messages", expanding=True)))
    .returning(telemetry.c.message_id)
)


def settle(
    connection: Connection, delivered: Sequence[Delivered], delivered_at: float
) -> list[Parcel]:
    """Delete confirmed records with their outbox rows and leave tombstones.

    Returns the parcels whose record was changed meanwhile: what the cloud got is not what is
    kept now, so the record stays and is due again under its new message_id.
    """
    if not delivered:
        return []
    messages = [one.parcel.message_id for one in delivered]
    gone = set(connection.execute(_DELETE_RECORDS, {"messages": messages}).scalars())
    insert_new(
        connection,
        tombstone,
        [
            {
                "message_id": parcel.message_id,
                "kind": parcel.stream.kind,
                "vehicle_id": parcel.stream.vehicle_id,
                "record_id": parcel.record_id,
                "http_status": status,
                "attempts": parcel.attempts + 1,
                "delivered_at": delivered_at,
            }
            for parcel, status in delivered
        ],
    )
    return [one.parcel for one in delivered if one.parcel.message_id not in gone]


def note_failure(connection: Connection, parcel: Parcel, attempts: int, reason: str) -> None:
    """Keep how often and why a record was put off."""
    connection.execute(
        update(outbox)
        .where(outbox.c.id == parcel.outbox_id)
        .values(attempts=attempts, last_error=reason)
    )


def bury(connection: Connection, parcel: Parcel, attempts: int, reason: str) -> None:
    """Make a dead letter of a record, unless it was changed meanwhile."""
    current = select(telemetry.c.id).where(telemetry.c.message_id == parcel.message_id)
    if connection.execute(current.with_for_update()).first() is None:
        return
    connection.execute(
        update(outbox)
        .where(outbox.c.id == parcel.outbox_id)
        .values(state="dead", attempts=attempts, last_error=reason)
    )


def forget_tombstones(connection: Connection, before: float) -> None:
    """Drop tombstones that are too old to matter."""
    connection.execute(delete(tombstone).where(tombstone.c.delivered_at < before))
