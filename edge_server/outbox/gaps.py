"""Gaps: dropped records are declared to the cloud, in the transaction that drops them.

A gap is a record of its own, delivered to `{cloud}/gap` and kept until the cloud has confirmed it.
While a gap waits, records of the same stream that are dropped for the same reason are added to it,
so an outage of any length leaves few gaps. It keeps its `gap_id` then and becomes a new message: a
cloud that has received the smaller gap replaces it.
"""

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, delete, select
from ulid import ULID

from afarcloud.numbers import format_time
from edge_server.outbox import queue
from edge_server.outbox.queue import State, Stream
from edge_server.store.connection.database import to_json
from edge_server.store.rows import telemetry as telemetry_rows
from edge_server.store.rows.tables import outbox, telemetry

KIND: Final = "gap"
_LOOK_BACK: Final = 64
_CHUNK: Final = 500


class Reason(StrEnum):
    """Why a record was dropped."""

    THINNED = "thinned"
    BUDGET = "budget"
    AGE = "age"
    DEAD_LETTERS = "dead_letters"


class DroppedRecord(NamedTuple):
    """A record that is to be dropped."""

    record_id: int
    message_id: str
    stream: Stream
    sequence_number: int | None
    recorded_at: str | None
    received_at: float
    size_bytes: int


def drop(
    connection: Connection, records: Sequence[DroppedRecord], reason: Reason, now: float
) -> dict[str, int]:
    """Delete records and declare a gap for each of their streams; returns how many by kind.

    A record that was delivered or changed since it was chosen is left out.
    """
    streams: dict[Stream, list[DroppedRecord]] = {}
    for start in range(0, len(records), _CHUNK):
        chunk = records[start : start + _CHUNK]
        messages = [one.message_id for one in chunk]
        deleted = set(
            connection.execute(
                delete(telemetry)
                .where(telemetry.c.message_id.in_(messages))
                .returning(telemetry.c.message_id)
            ).scalars()
        )
        for one in chunk:
            if one.message_id in deleted:
                streams.setdefault(one.stream, []).append(one)
    dropped: dict[str, int] = {}
    for stream, of_stream in streams.items():
        _declare(connection, stream, of_stream, reason, now)
        dropped[stream.kind] = dropped.get(stream.kind, 0) + len(of_stream)
    return dropped


def _declare(
    connection: Connection,
    stream: Stream,
    dropped: Sequence[DroppedRecord],
    reason: Reason,
    now: float,
) -> None:
    body = _body(stream, dropped, reason, now)
    message_id = str(ULID())
    earlier = _waiting(connection, stream, reason)
    if earlier is not None:
        record_id, before = earlier
        body |= {name: value for name, value in before.items() if name.startswith("from_")}
        body |= {"gap_id": before["gap_id"], "count": body["count"] + before["count"]}
        payload = to_json({**body, "message_id": message_id})
        telemetry_rows.replace(connection, record_id, message_id=message_id, payload=payload)
        return
    body["gap_id"] = message_id
    record_id = telemetry_rows.add(
        connection,
        kind=KIND,
        vehicle_id=stream.vehicle_id,
        message_id=message_id,
        payload=to_json({**body, "message_id": message_id}),
        received_at=now,
    )
    queue.enqueue(connection, record_id, Stream(stream.vehicle_id, KIND))


def _body(
    stream: Stream, dropped: Sequence[DroppedRecord], reason: Reason, now: float
) -> dict[str, Any]:
    first, last = dropped[0], dropped[-1]
    return {
        "stream": f"{stream.vehicle_id}/{stream.kind}",
        "vehicle_id": stream.vehicle_id,
        "kind": stream.kind,
        "from_sequence_number": first.sequence_number,
        "from_message_id": first.message_id,
        "from_id": first.record_id,
        "from_received_at": _time(first.received_at),
        "to_sequence_number": last.sequence_number,
        "to_message_id": last.message_id,
        "to_id": last.record_id,
        "to_received_at": _time(last.received_at),
        "count": len(dropped),
        "reason": reason.value,
        "recorded_at": _time(now),
    }


def _waiting(
    connection: Connection, stream: Stream, reason: Reason
) -> tuple[int, dict[str, Any]] | None:
    """Find the unconfirmed gap of a stream and lock its row."""
    rows = connection.execute(
        select(telemetry.c.id, telemetry.c.payload)
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(
            outbox.c.vehicle_id == stream.vehicle_id,
            outbox.c.kind == KIND,
            outbox.c.state == State.QUEUED.value,
        )
        .order_by(outbox.c.id.desc())
        .limit(_LOOK_BACK)
        .with_for_update(of=telemetry)
    )
    for record_id, payload in rows:
        body: dict[str, Any] = json.loads(payload)
        if (body["kind"], body["reason"]) == (stream.kind, reason):
            return record_id, body
    return None


def _time(epoch_s: float) -> str:
    return format_time(datetime.fromtimestamp(round(epoch_s, 3), UTC))
