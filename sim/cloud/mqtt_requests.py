"""What the mock cloud answers to a message that came over MQTT; pure but for the store.

    <root>/<kind>/<vehicle_id>   a record; its message_id is the message's correlation data
    <root>/batch                 NDJSON, {"kind": "pose", "record": {..., "message_id": ...}} a line

The answer says the status that HTTP would have given: {"message_id", "status", "outcome"}, for a
batch {"status", "results": [...]} with one of them per line.
"""

import json
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from sim.cloud.store import KINDS, Message, Outcome, Store

BATCH: Final = "batch"
MOST_RECORDS: Final = 100
_STATUS: Final = {
    Outcome.STORED: HTTPStatus.OK,
    Outcome.DUPLICATE: HTTPStatus.OK,
    Outcome.CONFLICT: HTTPStatus.CONFLICT,
}


class Request(NamedTuple):
    """A message, its topic without the root."""

    topic: str
    key: str  # Correlation data
    payload: bytes


def answer(store: Store, request: Request, now: float) -> dict[str, Any]:
    """Keep what the message holds and give the answer to it."""
    if request.topic == BATCH:
        return _answer_batch(store, request.payload, now)
    kind, _, _ = request.topic.partition("/")
    body = _object(request.payload)
    if body is None:
        return _refusal(request.key, HTTPStatus.BAD_REQUEST, "the payload must be a JSON object")
    return _keep(store, kind, request.key, body, now)


def _answer_batch(store: Store, payload: bytes, now: float) -> dict[str, Any]:
    """All lines are kept in one go, or none of them."""
    lines = payload.splitlines()
    if len(lines) > MOST_RECORDS:
        return {"status": HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "message": "too many records"}
    messages: list[Message] = []
    for line in lines:
        entry = _object(line) or {}
        record = entry.get("record")
        if not isinstance(record, dict):
            return {"status": HTTPStatus.BAD_REQUEST, "message": "each line must hold a record"}
        messages.append(Message(str(entry.get("kind")), str(record.get("message_id")), record))
    try:
        outcomes = iter(store.add_all([m for m in messages if m.kind in KINDS], now))
    except OSError as error:
        return _not_stored(error)
    results = [
        _result(m.message_id, next(outcomes)) if m.kind in KINDS else _no_kind(m.message_id, m.kind)
        for m in messages
    ]
    return {"status": HTTPStatus.OK, "results": results}


def _keep(store: Store, kind: str, key: str, body: dict[str, Any], now: float) -> dict[str, Any]:
    if kind not in KINDS:
        return _no_kind(key, kind)
    try:
        return _result(key, store.add(kind, key, body, now))
    except OSError as error:
        return {"message_id": key, **_not_stored(error)}


def _result(key: str, outcome: Outcome) -> dict[str, Any]:
    return {"message_id": key, "status": _STATUS[outcome], "outcome": outcome.value}


def _no_kind(key: str, kind: str) -> dict[str, Any]:
    return _refusal(key, HTTPStatus.NOT_FOUND, f"there is no kind {kind}")


def _not_stored(error: OSError) -> dict[str, Any]:
    return {"status": HTTPStatus.INSUFFICIENT_STORAGE, "message": f"not stored: {error.strerror}"}


def _refusal(key: str, status: HTTPStatus, message: str) -> dict[str, Any]:
    return {"message_id": key, "status": status, "message": message}


def _object(payload: bytes) -> dict[str, Any] | None:
    try:
        body = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    return body if isinstance(body, dict) else None
