"""Stores reports with their outbox rows, in the transaction of the caller.

Many reports take few statements, however many there are: singly each would take four, and on a
database server four round trips.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from sqlalchemy import Connection
from ulid import ULID

from afarcloud.wire import Kind
from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.services import audit, post_idempotency
from edge_server.services.errors import KeyReusedError
from edge_server.store.connection.database import to_json
from edge_server.store.rows import idempotency, telemetry
from edge_server.store.rows.idempotency import Answered
from edge_server.store.rows.telemetry import Draft, Record


class Entry(NamedTuple):
    """A report as it was received, and the key under which its sender may repeat it."""

    kind: str
    body: dict[str, Any]
    key: str | None
    sha256: bytes
    """Identifies a repetition."""


class StoredEntry(NamedTuple):
    """Result of an entry: an answer, new or earlier, or the refusal of its key."""

    answer: Answered | KeyReusedError
    is_new: bool


def for_cloud(document: dict[str, Any]) -> dict[str, Any]:
    """Return a report as the cloud receives it: without the id of our piece of work."""
    return {name: value for name, value in document.items() if name != "work_id"}


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


def store_all(
    connection: Connection, entries: Sequence[Entry], owner: str, now: float
) -> list[StoredEntry]:
    """Store entries that are not stored under their key yet, in order; returns their results."""
    known = idempotency.find_all(connection, [one.key for one in entries if one.key], owner)
    drafts: list[Draft] = []
    places: list[int | None] = []  # Of each entry among the drafts
    outcomes: list[StoredEntry] = []
    waiting: dict[str, int] = {}  # Keys of this very batch
    for entry in entries:
        answered = Answered(entry.kind, entry.sha256, 0, str(ULID()), now)
        earlier = known.get(entry.key) if entry.key else None
        if earlier is None:
            if entry.key:
                known[entry.key] = answered
                waiting[entry.key] = len(drafts)
            places.append(len(drafts))
            drafts.append(_draft(entry, answered))
            outcomes.append(StoredEntry(answered, is_new=True))
            continue
        places.append(waiting.get(entry.key or ""))
        same = (earlier.route, earlier.body_sha256) == (answered.route, answered.body_sha256)
        outcomes.append(
            StoredEntry(earlier if same else post_idempotency.key_reused(), is_new=False)
        )
    ids = _insert(connection, drafts)
    found = [_with_id(stored, place, ids) for stored, place in zip(outcomes, places, strict=True)]
    _store_answers(connection, entries, found, owner)
    return found


def _draft(entry: Entry, answered: Answered) -> Draft:
    message_id = answered.message_id or ""
    payload = to_json({**entry.body, "message_id": message_id})
    vehicle_id = int(entry.body["vehicle_id"])
    return Draft(message_id, entry.kind, vehicle_id, payload, answered.created_at)


def _insert(connection: Connection, drafts: Sequence[Draft]) -> list[int]:
    if not drafts:
        return []
    ids = telemetry.add_all(connection, drafts)
    streams = [Stream(draft.vehicle_id, draft.kind) for draft in drafts]
    queue.enqueue_all(connection, list(zip(ids, streams, strict=True)))
    return ids


def _with_id(stored: StoredEntry, place: int | None, ids: Sequence[int]) -> StoredEntry:
    if place is None or isinstance(stored.answer, KeyReusedError):
        return stored
    return stored._replace(answer=stored.answer._replace(object_id=ids[place]))


def _store_answers(
    connection: Connection, entries: Sequence[Entry], outcomes: Sequence[StoredEntry], owner: str
) -> None:
    answers = {}
    for entry, (answer, is_new) in zip(entries, outcomes, strict=True):
        if is_new and isinstance(answer, Answered):
            audit.made(answer.object_id)
            if entry.key is not None:
                answers[entry.key] = answer
    if answers:
        idempotency.add_all(connection, answers, owner)
