"""Reports of vehicles: kept until the cloud has them. One transaction, then 201."""

import json
from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

from sqlalchemy import Connection
from ulid import ULID

from afarcloud.faults import InvalidError
from afarcloud.state import Alarm, Image, MissionReport, Report, StateVector
from afarcloud.wire import Kind, write
from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.services import intake, listing, once, progress, vehicle_holds
from edge_server.services.attempts import repeatable
from edge_server.services.context import (
    Caller,
    Context,
    Precondition,
    show_time,
    unconditionally,
)
from edge_server.services.errors import (
    ConflictError,
    FullError,
    KeyReusedError,
    NotFoundError,
)
from edge_server.services.intake import Entry
from edge_server.services.listing import Listing
from edge_server.store import idempotency, telemetry
from edge_server.store.database import to_json
from edge_server.store.idempotency import Answered
from edge_server.store.locks import WORK, Lock, of_stream
from edge_server.store.telemetry import Record

Refusal = KeyReusedError | FullError | ConflictError | InvalidError
"""Why one report of many is not kept."""


class Arrival(NamedTuple):
    """A report that has come in, and the key under which its sender may repeat it."""

    kind: Kind
    report: Report
    idempotency_key: str | None


@repeatable
def ingest(context: Context, kind: Kind, report: Report, caller: Caller) -> dict[str, Any]:
    """Keep a report and make it due; returns it as stored.

    Raises:
        KeyReusedError: if the idempotency key belongs to another request.
        FullError: if there is no room for it.
        InvalidError, ConflictError: if it must not be said of its mission (`progress.apply`).
    """
    body = _payload(report)
    context.space.admit(kind.value, _picture_bytes(report))
    now = context.clock()
    flights = _new_flights(context, [report], now)
    try:
        answered = context.database.write_together(
            lambda connection: _keep(connection, kind, report, body, caller, now, flights),
            *_locks(report, kind, flights),
        )
    except ConflictError:
        _learn_of_refused(context, report, now)
        raise
    context.note_acknowledged(answered.object_id)
    context.wake_relay()
    return {"id": answered.object_id, **body, **_receipt(answered)}


@repeatable
def ingest_all(
    context: Context, arrivals: Sequence[Arrival], owner: str
) -> list[dict[str, Any] | Refusal]:
    """Keep many reports in one transaction, in their order; returns a receipt or fault for each.

    A key that belongs to another request spoils its own report only, and so do a lack of room and
    a report that must not be said of its mission.
    """
    refused: dict[int, Refusal] = dict(_without_room(context, arrivals))
    flights = _new_flights(context, [one.report for one in arrivals], context.clock())
    wanted = {lock for one in arrivals for lock in _locks(one.report, one.kind, flights)}
    with context.database.write(*wanted) as connection:
        now = context.clock()
        refused |= _apply_all(connection, arrivals, refused, owner, now, flights)
        admitted = [one for number, one in enumerate(arrivals) if number not in refused]
        entries = [
            Entry(one.kind.value, _payload(one.report), one.idempotency_key) for one in admitted
        ]
        kept = intake.keep_all(connection, entries, owner, now)
    acknowledged = [one.answer.object_id for one in kept if isinstance(one.answer, Answered)]
    context.note_acknowledged(max(acknowledged, default=0))
    context.wake_relay()
    answers = iter(kept)
    return [
        refused[number] if number in refused else _told(next(answers).answer)
        for number in range(len(arrivals))
    ]


def _apply_all(
    connection: Connection,
    arrivals: Sequence[Arrival],
    refused: Collection[int],
    owner: str,
    now: float,
    flights: Collection[int],
) -> dict[int, Refusal]:
    """Do what follows from the reports that are new; gives those that are refused, by place."""
    keys = [one.idempotency_key for one in arrivals if one.idempotency_key]
    known = set(idempotency.find_all(connection, keys, owner))
    faults: dict[int, Refusal] = {}
    for number, arrival in enumerate(arrivals):
        report = arrival.report
        is_done = number in refused or arrival.idempotency_key in known
        if is_done or not _moves_work(report, flights):
            continue
        try:
            _apply(connection, report, now, flights)
        except (InvalidError, ConflictError) as error:
            faults[number] = error
            if isinstance(report, MissionReport):
                vehicle_holds.after_refused_report(connection, report, now)
        else:
            if arrival.idempotency_key is not None:
                known.add(arrival.idempotency_key)
    return faults


def _told(answer: Answered | KeyReusedError) -> dict[str, Any] | KeyReusedError:
    if isinstance(answer, KeyReusedError):
        return answer
    return {"id": answer.object_id, **_receipt(answer)}


def _without_room(context: Context, arrivals: Sequence[Arrival]) -> dict[int, FullError]:
    """Which of these cannot come in, by their place."""
    refused = {}
    for number, arrival in enumerate(arrivals):
        try:
            context.space.admit(arrival.kind.value, _picture_bytes(arrival.report))
        except FullError as error:
            refused[number] = error
    return refused


def _picture_bytes(report: Report) -> int:
    return len(report.frame) if isinstance(report, Image) else 0


def _locks(report: Report, kind: Kind, flights: Collection[int]) -> tuple[Lock, ...]:
    """What a report needs: the end of its stream, and what it may move besides."""
    stream = of_stream(report.vehicle_id, kind.value)
    return (WORK, stream) if _moves_work(report, flights) else (stream,)


def _new_flights(context: Context, reports: Iterable[Report], now: float) -> frozenset[int]:
    """Vehicles whose state vectors among these show a flight that is not known so far.

    State vectors are many and hardly one is news, so this is looked at before the transaction. A
    mission that is accepted meanwhile is none that they were measured on.
    """
    in_the_air = [
        one for one in reports if isinstance(one, StateVector) and vehicle_holds.is_in_the_air(one)
    ]
    if not in_the_air:
        return frozenset()
    with context.database.read() as connection:
        return vehicle_holds.new_flights(connection, in_the_air, now)


def _moves_work(report: Report, flights: Collection[int]) -> bool:
    """Whether a report may change a mission, or hold its vehicle."""
    if isinstance(report, StateVector):
        return report.vehicle_id in flights
    is_about_mission = isinstance(report, Alarm) and report.mission_id is not None
    return is_about_mission or isinstance(report, MissionReport)


def _apply(connection: Connection, report: Report, now: float, flights: Collection[int]) -> None:
    """Do what follows from a report; raises InvalidError or ConflictError, nothing being done."""
    if isinstance(report, MissionReport):
        change = progress.apply(connection, report, now)
        vehicle_holds.after_report(connection, report, change, now)
    elif isinstance(report, Alarm):
        vehicle_holds.after_alarm(connection, report, now)
    elif isinstance(report, StateVector) and report.vehicle_id in flights:
        vehicle_holds.after_state_vector(connection, report, now)


def _learn_of_refused(context: Context, report: Report, now: float) -> None:
    if isinstance(report, MissionReport):
        with context.database.write(WORK) as connection:
            vehicle_holds.after_refused_report(connection, report, now)


def _payload(report: Report) -> dict[str, Any]:
    """A report as the cloud gets it: the number of our own piece of work is nothing to it."""
    body = write(report)
    body.pop("work_id", None)
    return body


def _keep(  # a record, who sent it and when
    connection: Connection,
    kind: Kind,
    report: Report,
    body: dict[str, Any],
    caller: Caller,
    now: float,
    flights: Collection[int],
) -> Answered:
    """Store a report unless it has been stored under this key; raises KeyReusedError."""
    body_sha256 = once.hash_body(body)
    answered = once.earlier(connection, caller, kind.value, body_sha256)
    if answered is not None:
        return answered
    _apply(connection, report, now, flights)
    record = store(connection, kind, body, now)
    answered = Answered(kind.value, body_sha256, record.id, record.message_id, now)
    once.remember(connection, caller, answered)
    return answered


def _receipt(answered: Answered) -> dict[str, Any]:
    return {
        "message_id": answered.message_id,
        "received_at": show_time(answered.created_at),
    }


def store(connection: Connection, kind: Kind, body: dict[str, Any], now: float) -> Record:
    """Write a record and its outbox row."""
    message_id = str(ULID())
    payload = to_json({**body, "message_id": message_id})
    vehicle_id = int(body["vehicle_id"])
    record_id = telemetry.add(
        connection,
        kind=kind.value,
        vehicle_id=vehicle_id,
        message_id=message_id,
        payload=payload,
        received_at=now,
    )
    queue.enqueue(connection, record_id, Stream(vehicle_id, kind.value))
    return Record(record_id, message_id, kind.value, vehicle_id, payload, now)


def page(  # each narrows the list
    context: Context,
    kind: Kind,
    *,
    after_id: int,
    limit: int,
    vehicle_id: int | None,
    since_s: float,
) -> Listing:
    """List what the cloud has not confirmed, oldest first; pictures without their frame."""
    with context.database.read() as connection:
        records = telemetry.page(
            connection,
            kind.value,
            after_id=after_id,
            limit=limit,
            vehicle_id=vehicle_id,
            since_s=since_s,
        )
        return listing.fill(records, show_without_frame)


def find(context: Context, kind: Kind, record_id: int) -> dict[str, Any]:
    """Give one report; raises NotFoundError, also when the cloud has it by now."""
    with context.database.read() as connection:
        return show(_find(connection, kind, record_id))


@repeatable
def replace(
    context: Context,
    kind: Kind,
    record_id: int,
    report: Report,
    precondition: Precondition = unconditionally,
) -> dict[str, Any]:
    """Correct a report that is still here; to the cloud it is a new message.

    Raises:
        NotFoundError: if it is not here, or the cloud has it by now.
        ChangedError: if the precondition says so.
        ConflictError: if it names another vehicle.
    """
    body = write(report)
    message_id = str(ULID())
    with context.database.write() as connection:
        record = _find(connection, kind, record_id, to_change=True)
        precondition(show(record))
        if record.vehicle_id != body["vehicle_id"]:
            raise ConflictError("a report cannot change its vehicle_id")
        payload = to_json({**body, "message_id": message_id})
        telemetry.replace(connection, record_id, message_id=message_id, payload=payload)
        queue.requeue(connection, record_id)
    context.wake_relay(changed=True)
    return show(record._replace(message_id=message_id, payload=payload))


@repeatable
def remove(context: Context, kind: Kind, record_id: int) -> None:
    """Forget a report, sent or not; raises NotFoundError."""
    with context.database.write() as connection:
        if not telemetry.remove(connection, kind.value, record_id):
            raise _missing(kind, record_id)
    context.wake_relay(changed=True)


def show_without_frame(record: Record) -> dict[str, Any]:
    """Give a record as a list shows it."""
    shown = show(record)
    shown.pop("frame", None)
    return shown


def show(record: Record) -> dict[str, Any]:
    """Give a record as the API shows it."""
    return {
        "id": record.id,
        **json.loads(record.payload),
        "received_at": show_time(record.received_at),
    }


def _find(connection: Connection, kind: Kind, record_id: int, *, to_change: bool = False) -> Record:
    record = telemetry.get(connection, kind.value, record_id, to_change=to_change)
    if record is None:
        raise _missing(kind, record_id)
    return record


def _missing(kind: Kind, record_id: int) -> NotFoundError:
    return NotFoundError(f"there is no {kind.value} {record_id} here")
