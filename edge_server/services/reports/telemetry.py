"""Reports of vehicles: stored until the cloud has them; one transaction, then 201."""

import base64
import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from sqlalchemy import Connection

from afarcloud.faults import InvalidError
from afarcloud.state import Image, Report
from afarcloud.wire import Kind, write
from edge_server.archive.flights import MissionName
from edge_server.archive.writer import Received
from edge_server.pictures import footprint
from edge_server.services import post_idempotency, records
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
from edge_server.services.fleet.progress import Change
from edge_server.services.records import Entry
from edge_server.services.reports import corrections, effects, listing
from edge_server.services.reports.listing import Listing
from edge_server.services.retries import retry_on_conflict
from edge_server.store.connection.locks import WORK
from edge_server.store.rows import idempotency, telemetry, work
from edge_server.store.rows.idempotency import Answered
from edge_server.store.rows.telemetry import Record
from edge_server.store.rows.work import Work

Refusal = KeyReusedError | FullError | ConflictError | InvalidError
"""Why one report of many is refused."""


class Arrival(NamedTuple):
    """A received report, and the key under which its sender may repeat it."""

    kind: Kind
    report: Report
    idempotency_key: str | None


@retry_on_conflict
def ingest(context: Context, kind: Kind, report: Report, caller: Caller) -> dict[str, Any]:
    """Store a report and queue it for the cloud; returns it as stored.

    Raises:
        KeyReusedError: if the idempotency key belongs to another request.
        FullError: if there is no room for it.
        InvalidError, ConflictError: if it does not fit its mission's state (`progress.apply`).
    """
    document: dict[str, Any] = write(report)
    body_sha256, body = post_idempotency.hash_body(document), records.for_cloud(document)
    context.contacts.note(caller.broker, [report.vehicle_id])
    context.space.admit(kind.value, _picture_bytes(report))
    now = context.clock()
    flights = effects.new_flights(context, [report], now)
    try:
        kept = context.database.write_together(
            lambda connection: _store(
                connection, kind, report, body, body_sha256, caller, now, flights
            ),
            *effects.locks_of(report, kind, flights),
        )
    except ConflictError:
        with context.database.write(WORK) as connection:
            effects.apply_refused(connection, report, now)
        raise
    answered = kept.answered
    context.note_acknowledged(answered.object_id)
    context.wake_relay()
    context.archive.take([_received(kind, report, answered, kept.mission)])
    return {"id": answered.object_id, **body, **_receipt(answered)}


@retry_on_conflict
def ingest_all(
    context: Context, arrivals: Sequence[Arrival], owner: str, broker: str = ""
) -> list[dict[str, Any] | Refusal]:
    """Store many reports in one transaction, in their order; returns a receipt or fault for each.

    `owner` has their idempotency keys; `broker` is its identity if it has several instances.

    A key that belongs to another request, a lack of room, and a report that does not fit its
    mission's state affect only their own report.
    """
    context.contacts.note(broker or owner, {one.report.vehicle_id for one in arrivals})
    flights = effects.new_flights(context, [one.report for one in arrivals], context.clock())
    wanted = {lock for one in arrivals for lock in effects.locks_of(one.report, one.kind, flights)}
    without_room = _without_room(context, arrivals)  # Makes room in transactions of its own
    with context.database.write(*wanted) as connection:
        now = context.clock()
        effects_of_batch = _apply_all(connection, arrivals, without_room, owner, now, flights)
        admitted = [
            number
            for number in range(len(arrivals))
            if number not in effects_of_batch.refused and number not in effects_of_batch.repeats
        ]
        entries = [_entry(arrivals[number]) for number in admitted]
        stored = records.store_all(connection, entries, owner, now)
        answers = {number: one.answer for number, one in zip(admitted, stored, strict=True)}
        _note_ends(connection, effects_of_batch.ends, answers)
        answers |= _answer_repeats(connection, arrivals, effects_of_batch.repeats, owner)
    acknowledged = [one.answer.object_id for one in stored if isinstance(one.answer, Answered)]
    context.note_acknowledged(max(acknowledged, default=0))
    context.wake_relay()
    context.archive.take(
        [
            _received(arrivals[number].kind, arrivals[number].report, answer, mission)
            for number, answer in sorted(answers.items())
            if isinstance(answer, Answered)
            for mission in (effects_of_batch.missions.get(number),)
        ]
    )
    return [
        effects_of_batch.refused[number]
        if number in effects_of_batch.refused
        else _result(answers[number])
        for number in range(len(arrivals))
    ]


class _BatchEffects(NamedTuple):
    """What happens to some reports of a batch, by their index; the others are stored too."""

    refused: dict[int, Refusal]
    ends: dict[int, int]
    """Reports that end a mission, with its work id."""
    repeats: dict[int, int]
    """Reports that repeat the end of a mission and are not stored again, with its work id."""
    missions: dict[int, Work]
    """The mission of each mission report, as it was before."""

    def note(self, number: int, change: Change | None) -> None:
        """Note the change of a report; the cloud receives the end of a mission once."""
        if change is None:
            return
        mission = change.mission
        self.missions[number] = mission
        if not (change.ended or change.is_repetition):
            return
        is_reported = mission.end_record is not None or mission.id in self.ends.values()
        part = self.repeats if change.is_repetition and is_reported else self.ends
        part[number] = mission.id


def _apply_all(
    connection: Connection,
    arrivals: Sequence[Arrival],
    refused: Mapping[int, Refusal],
    owner: str,
    now: float,
    flights: Collection[int],
) -> _BatchEffects:
    """Apply the effects of the reports that are new; returns what happens to each."""
    keys = [one.idempotency_key for one in arrivals if one.idempotency_key]
    known = set(idempotency.find_all(connection, keys, owner))
    repeated: dict[str, int] = {}  # Index by key
    effects_of_batch = _BatchEffects(dict(refused), {}, {}, {})
    for number, (_, report, key) in enumerate(arrivals):
        if number in refused or key in known:
            continue
        if key in repeated:
            first = repeated[key]
            if _entry(arrivals[first]) == _entry(arrivals[number]):
                effects_of_batch.repeats[number] = effects_of_batch.repeats[first]
            else:
                effects_of_batch.refused[number] = post_idempotency.key_reused()
            continue
        try:
            change = effects.apply(connection, report, now, flights)
        except (InvalidError, ConflictError) as error:
            effects_of_batch.refused[number] = error
            effects.apply_refused(connection, report, now)
            continue
        effects_of_batch.note(number, change)
        if key is not None and number in effects_of_batch.repeats:
            repeated[key] = number
        elif key is not None:
            known.add(key)
    return effects_of_batch


def _note_ends(
    connection: Connection,
    ends: Mapping[int, int],
    answers: Mapping[int, Answered | KeyReusedError],
) -> None:
    for number, work_id in ends.items():
        answer = answers[number]
        if isinstance(answer, Answered):
            work.note_end(connection, work_id, answer.object_id, answer.message_id)


def _answer_repeats(
    connection: Connection, arrivals: Sequence[Arrival], repeats: Mapping[int, int], owner: str
) -> dict[int, Answered]:
    """Return the receipt of the report that ended a mission for those that repeat it."""
    answers = {}
    keyed = {}
    for number, work_id in repeats.items():
        mission = work.get(connection, work_id)
        entry = _entry(arrivals[number])
        answer = None if mission is None else effects.end_of(mission, entry.kind, entry.sha256)
        if answer is None:
            raise RuntimeError(f"the end of work {work_id} is not known")
        answers[number] = answer
        if entry.key is not None:
            keyed[entry.key] = answer
    if keyed:
        idempotency.add_all(connection, keyed, owner)
    return answers


def _entry(arrival: Arrival) -> Entry:
    document: dict[str, Any] = write(arrival.report)
    sha256 = post_idempotency.hash_body(document)
    return Entry(arrival.kind.value, records.for_cloud(document), arrival.idempotency_key, sha256)


def _result(answer: Answered | KeyReusedError) -> dict[str, Any] | KeyReusedError:
    if isinstance(answer, KeyReusedError):
        return answer
    return {"id": answer.object_id, **_receipt(answer)}


def _without_room(context: Context, arrivals: Sequence[Arrival]) -> dict[int, FullError]:
    """Return the reports for which there is no room, by index."""
    refused = {}
    for number, arrival in enumerate(arrivals):
        try:
            context.space.admit(arrival.kind.value, _picture_bytes(arrival.report))
        except FullError as error:
            refused[number] = error
    return refused


def _picture_bytes(report: Report) -> int:
    return len(report.frame) if isinstance(report, Image) else 0


class _Kept(NamedTuple):
    """The answer to a report, and the mission that a new mission report is about."""

    answered: Answered
    mission: Work | None


def _store(  # a record, its sender and its time
    connection: Connection,
    kind: Kind,
    report: Report,
    body: dict[str, Any],
    body_sha256: bytes,
    caller: Caller,
    now: float,
    flights: Collection[int],
) -> _Kept:
    """Store a report unless it has been stored under this key; raises KeyReusedError."""
    answered = post_idempotency.find_answer(connection, caller, kind.value, body_sha256)
    if answered is not None:
        return _Kept(answered, None)
    change = effects.apply(connection, report, now, flights)
    if change is not None and change.is_repetition:
        answered = effects.end_of(change.mission, kind.value, body_sha256)
    if answered is None:
        record = records.store(connection, kind, body, now)
        answered = Answered(kind.value, body_sha256, record.id, record.message_id, now)
        if change is not None and (change.ended or change.is_repetition):
            work.note_end(connection, change.mission.id, record.id, record.message_id)
    post_idempotency.store_answer(connection, caller, answered)
    return _Kept(answered, None if change is None else change.mission)


def _received(kind: Kind, report: Report, answered: Answered, mission: Work | None) -> Received:
    """Describe a report that is stored to the archive."""
    name = None
    if mission is not None and mission.mission_id is not None:
        name = MissionName(mission.mission_id, mission.plan_id)
    place = footprint.place(_head(report)) if isinstance(report, Image) else None
    return Received(kind, report, answered.message_id, answered.created_at, name, place)


def _head(image: Image) -> bytes:
    """Decode as much of a picture as its camera's notes may be in."""
    return base64.b64decode(image.frame[: footprint.HEAD_BYTES // 3 * 4])


def _receipt(answered: Answered) -> dict[str, Any]:
    return {
        "message_id": answered.message_id,
        "received_at": show_time(answered.created_at),
    }


def page(  # each narrows the list
    context: Context,
    kind: Kind,
    *,
    after_id: int,
    limit: int,
    vehicle_id: int | None,
    since_s: float,
) -> Listing:
    """List the reports that the cloud has not confirmed, oldest first; pictures without frame."""
    with context.database.read() as connection:
        found = telemetry.page(
            connection,
            kind.value,
            after_id=after_id,
            limit=limit,
            vehicle_id=vehicle_id,
            since_s=since_s,
        )
        return listing.fill(found, show_without_frame)


def find(context: Context, kind: Kind, record_id: int) -> dict[str, Any]:
    """Return one report; raises NotFoundError, also if the cloud has it already."""
    with context.database.read() as connection:
        return show(_find(connection, kind, record_id))


@retry_on_conflict
def replace(
    context: Context,
    kind: Kind,
    record_id: int,
    report: Report,
    precondition: Precondition = unconditionally,
) -> dict[str, Any]:
    """Correct a report that is still stored; for the cloud it is a new message.

    Raises:
        NotFoundError: if there is none, or the cloud has it already.
        ChangedError: if the precondition fails.
        InvalidError, ConflictError: if it is about another vehicle, mission or plan than before,
            or it does not fit its mission's state.
    """
    with context.database.write(*corrections.locks_of(report)) as connection:
        record = _find(connection, kind, record_id, to_change=True)
        precondition(show(record))
        corrected = corrections.apply(connection, record, report, context.clock())
    context.wake_relay(changed=True)
    return show(corrected)


@retry_on_conflict
def remove(context: Context, kind: Kind, record_id: int) -> None:
    """Delete a report, sent or not; raises NotFoundError."""
    with context.database.write() as connection:
        if not telemetry.remove(connection, kind.value, record_id):
            raise _missing(kind, record_id)
    context.wake_relay(changed=True)


def show_without_frame(record: Record) -> dict[str, Any]:
    """Return a record as a list shows it."""
    shown = show(record)
    shown.pop("frame", None)
    return shown


def show(record: Record) -> dict[str, Any]:
    """Return a record as the API shows it."""
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
