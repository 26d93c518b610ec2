"""Many records in one request: NDJSON out, a result per record back; pure.

    {"kind": "pose", "record": {"sequence_number": 7, ..., "message_id": "01K9..."}}
    {"kind": "alarm", "record": {...}}

    {"results": [{"message_id": "01K9...", "status": 200}, {"message_id": ..., "status": 422}]}

A result has the status that the record alone would have been answered with, `retry_after_s` and
`outcome` included. The cloud takes the records of one stream in their order: after a record that
has to be retried, it answers the later records of that stream in the batch with 424.
"""

import json
from collections.abc import Sequence
from typing import Any, Final

from afarcloud import wire
from edge_server.outbox.answers import Answer, Outcome, Reply, classify
from edge_server.outbox.queue import OutboxRecord

MEDIA_TYPE: Final = "application/x-ndjson"
JSON: Final = "application/json"
REFUSED: Final = frozenset({400, 404, 405, 410, 413, 415, 422, 501})
"""Statuses of a batch as a whole that say nothing of its records: they are sent singly."""
NO_BATCHES_S: Final = 600.0
"""How long no batch is sent after one was refused as a whole."""


def write(records: Sequence[OutboxRecord]) -> bytes:
    """Return the body of a batch."""
    lines = [f'{{"kind":"{one.stream.kind}","record":{one.payload}}}\n' for one in records]
    return "".join(lines).encode()


def read(reply: Reply, records: Sequence[OutboxRecord]) -> list[Reply] | None:
    """Return a reply for each record; None if a confirming answer does not fit the batch.

    A reply that confirms nothing is the reply to each of the records.
    """
    if not isinstance(reply, Answer) or classify(reply).outcome is not Outcome.CONFIRMED:
        return [reply] * len(records)
    results = _results(reply.body)
    if results is None or len(results) != len(records):
        return None
    replies = [_reply(result, record) for result, record in zip(results, records, strict=True)]
    found = [one for one in replies if one is not None]
    return found if len(found) == len(records) else None


def _results(body: bytes) -> list[Any] | None:
    document = wire.parse_json(body) if body.strip() else None
    results = document.get("results") if isinstance(document, dict) else None
    return results if isinstance(results, list) else None


def _reply(result: Any, record: OutboxRecord) -> Reply | None:
    if not isinstance(result, dict) or result.get("message_id") != record.message_id:
        return None
    status = result.get("status")
    if isinstance(status, bool) or not isinstance(status, int) or not 200 <= status <= 599:
        return None
    body = json.dumps({"outcome": result.get("outcome")}).encode()
    return Answer(status, JSON, body, _seconds(result.get("retry_after_s")))


def _seconds(value: object) -> float | None:
    """Return a usable wait [s], else None; NaN fails the comparison."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1e9:
        return None
    return float(value)
