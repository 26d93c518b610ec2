"""The outbox as rows, and the states of a row; every function works in the caller's transaction.

    QUEUED --> IN_FLIGHT: sent
    IN_FLIGHT --> GONE: confirmed
    IN_FLIGHT --> DEAD: rejected
    IN_FLIGHT --> QUEUED: put off, refused, crashed

A confirmed row is deleted from the database together with its record. IN_FLIGHT is never stored:
the relay knows it while it waits for an answer, so a crash leaves the row QUEUED and the record is
sent again under the same key.
"""

import json
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Final, NamedTuple

from sqlalchemy import Connection, bindparam, delete, func, insert, select, update

from edge_server.store.connection import locks
from edge_server.store.connection.database import insert_new
from edge_server.store.rows.tables import outbox, telemetry, tombstone
from edge_server.transitions import TransitionTable

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
"""Priority by kind; lower is sent first."""
MISSION_REPORT: Final = "mission_report"
OVERTAKEN: Final = "corrected while it was sent; a later report of its mission was sent before"


class State(StrEnum):
    """State of a row."""

    QUEUED = "queued"
    IN_FLIGHT = "in flight"
    DEAD = "dead"
    GONE = "gone"


class Trigger(StrEnum):
    """What changes the state of a row."""

    SENT = "sent"
    CONFIRMED = "confirmed"
    PUT_OFF = "put off"
    REFUSED = "refused"
    REJECTED = "rejected"
    CRASHED = "crashed"


ROW_STATES: Final = TransitionTable(
    "a row",
    {
        (State.QUEUED, Trigger.SENT): State.IN_FLIGHT,
        (State.IN_FLIGHT, Trigger.CONFIRMED): State.GONE,
        (State.IN_FLIGHT, Trigger.PUT_OFF): State.QUEUED,
        (State.IN_FLIGHT, Trigger.REFUSED): State.QUEUED,
        (State.IN_FLIGHT, Trigger.REJECTED): State.DEAD,
        (State.IN_FLIGHT, Trigger.CRASHED): State.QUEUED,
    },
)


class Stream(NamedTuple):
    """Records whose order is kept."""

    vehicle_id: int
    kind: str


class OutboxRecord(NamedTuple):
    """A record that has to be sent, with its outbox row."""

    outbox_id: int
    record_id: int
    message_id: str
    stream: Stream
    payload: str
    attempts: int

    @property
    def size_bytes(self) -> int:
        """Its size within a batch: its JSON and an allowance for the text around it."""
        payload = self.payload
        return 64 + (len(payload) if payload.isascii() else len(payload.encode()))


class Delivered(NamedTuple):
    """A record that the cloud has confirmed."""

    record: OutboxRecord
    status: int


_ENQUEUE: Final = insert(outbox)


def enqueue(connection: Connection, record_id: int, stream: Stream) -> None:
    """Queue a record behind everything of its stream that is committed before."""
    locks.take(connection, [locks.of_stream(*stream)])
    connection.execute(
        _ENQUEUE,
        {"record_id": record_id, "vehicle_id": stream.vehicle_id, "kind": stream.kind},
    )


def enqueue_all(connection: Connection, records: Sequence[tuple[int, Stream]]) -> None:
    """Queue many records, given by id and stream, in this order."""
    locks.take(connection, {locks.of_stream(*stream) for _, stream in records})
    connection.execute(
        insert(outbox),
        [
            {"record_id": record_id, "vehicle_id": stream.vehicle_id, "kind": stream.kind}
            for record_id, stream in records
        ],
    )


def requeue(connection: Connection, record_id: int) -> None:
    """Queue a record again in its old place, with no attempt counted."""
    connection.execute(
        update(outbox)
        .where(outbox.c.record_id == record_id)
        .values(state=State.QUEUED.value, attempts=0, last_error=None, rejected_at=None)
    )


_MARK_SENT: Final = (
    update(outbox).where(outbox.c.id.in_(bindparam("rows", expanding=True))).values(sent=True)
)


def mark_sent(connection: Connection, records: Sequence[OutboxRecord]) -> None:
    """Store that records may reach the cloud, whatever becomes of this process."""
    rows = [record.outbox_id for record in records]
    connection.execute(_MARK_SENT, {"rows": rows})


def was_sent_after(connection: Connection, record_id: int, vehicle_id: int, mission: int) -> bool:
    """Whether a report of a mission behind this record may have reached the cloud already.

    One that the cloud has confirmed is deleted; of the others, those that were sent count.
    """
    later = (
        select(telemetry.c.payload)
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(
            outbox.c.vehicle_id == vehicle_id,
            outbox.c.kind == MISSION_REPORT,
            outbox.c.sent,
            telemetry.c.id > record_id,
        )
    )
    payloads = connection.execute(later).scalars()
    return any(json.loads(payload)["mission_id"] == mission for payload in payloads)


_NEWEST: Final = select(func.max(outbox.c.id))
_STREAMS_AFTER: Final = (
    select(outbox.c.vehicle_id, outbox.c.kind)
    .where(outbox.c.id > bindparam("outbox_id"))
    .distinct()
)


def streams_after(connection: Connection, outbox_id: int) -> tuple[set[Stream], int]:
    """Return the streams that have rows after this one, and the newest row's id."""
    newest = connection.execute(_NEWEST).scalar_one() or 0
    if newest <= outbox_id:
        return set(), outbox_id
    rows = connection.execute(_STREAMS_AFTER, {"outbox_id": outbox_id})
    return {Stream(*row) for row in rows}, newest


_QUEUED: Final = (
    select(
        outbox.c.id,
        outbox.c.record_id,
        telemetry.c.message_id,
        telemetry.c.payload,
        outbox.c.attempts,
    )
    .join(telemetry, telemetry.c.id == outbox.c.record_id)
    .where(
        outbox.c.vehicle_id == bindparam("vehicle_id"),
        outbox.c.kind == bindparam("kind"),
        outbox.c.state == State.QUEUED.value,
        outbox.c.id > bindparam("after_id"),
    )
    .order_by(outbox.c.id)
    .limit(bindparam("limit"))
)


def read_queued(
    connection: Connection, stream: Stream, after_id: int, limit: int
) -> list[OutboxRecord]:
    """Return the next queued records of a stream in order."""
    values = {**stream._asdict(), "after_id": after_id, "limit": limit}
    rows = connection.execute(_QUEUED, values)
    return [OutboxRecord(r[0], r[1], r[2], stream, r[3], r[4]) for r in rows]


_DELETE_RECORDS: Final = (
    delete(telemetry)
    .where(telemetry.c.message_id.in_(bindparam("messages", expanding=True)))
    .returning(telemetry.c.message_id)
)


def delete_delivered(
    connection: Connection, delivered: Sequence[Delivered], delivered_at: float
) -> list[OutboxRecord]:
    """Delete confirmed records with their outbox rows and leave tombstones.

    Returns the records that were changed while they were sent: the cloud has not received their
    present content, so they stay and are queued under a new message_id.
    """
    if not delivered:
        return []
    messages = [one.record.message_id for one in delivered]
    deleted = set(connection.execute(_DELETE_RECORDS, {"messages": messages}).scalars())
    insert_new(
        connection,
        tombstone,
        [
            {
                "message_id": record.message_id,
                "kind": record.stream.kind,
                "vehicle_id": record.stream.vehicle_id,
                "record_id": record.record_id,
                "http_status": status,
                "attempts": record.attempts + 1,
                "delivered_at": delivered_at,
            }
            for record, status in delivered
        ],
    )
    return [one.record for one in delivered if one.record.message_id not in deleted]


def note_failure(connection: Connection, record: OutboxRecord, attempts: int, reason: str) -> None:
    """Store how often a record was put off, and why."""
    connection.execute(
        update(outbox)
        .where(outbox.c.id == record.outbox_id)
        .values(attempts=attempts, last_error=reason)
    )


def mark_dead(
    connection: Connection, record: OutboxRecord, attempts: int, reason: str, now: float
) -> bool:
    """Make a record a dead letter, unless it was changed while it was sent; returns whether."""
    current = select(telemetry.c.id).where(telemetry.c.message_id == record.message_id)
    if connection.execute(current.with_for_update()).first() is None:
        return False
    _mark_dead(connection, record, attempts, reason, now)
    return True


def _mark_dead(
    connection: Connection, record: OutboxRecord, attempts: int, reason: str, now: float
) -> None:
    connection.execute(
        update(outbox)
        .where(outbox.c.id == record.outbox_id)
        .values(state=State.DEAD.value, attempts=attempts, last_error=reason, rejected_at=now)
    )


def hold_back_correction(
    connection: Connection, record: OutboxRecord, sent: Sequence[OutboxRecord], now: float
) -> bool:
    """Make a dead letter of a mission report that was corrected too late; returns whether.

    `record` is the report as it was sent. If a later report of its mission is queued or among those
    that were `sent`, the correction would reach the cloud behind it, and after the end of a mission
    the cloud would receive RUNNING again.
    """
    if record.stream.kind != MISSION_REPORT:
        return False
    later = select(telemetry.c.payload).where(
        telemetry.c.kind == MISSION_REPORT,
        telemetry.c.vehicle_id == record.stream.vehicle_id,
        telemetry.c.id > record.record_id,
    )
    payloads = list(connection.execute(later).scalars())
    payloads += [
        one.payload
        for one in sent
        if one.stream == record.stream and one.record_id > record.record_id
    ]
    mission_id = json.loads(record.payload)["mission_id"]
    if all(json.loads(payload)["mission_id"] != mission_id for payload in payloads):
        return False
    _mark_dead(connection, record, record.attempts + 1, OVERTAKEN, now)
    return True


def delete_tombstones(connection: Connection, before: float) -> None:
    """Delete tombstones of deliveries before a time."""
    connection.execute(delete(tombstone).where(tombstone.c.delivered_at < before))
