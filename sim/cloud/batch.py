"""Many records in one request: `POST /batch`, one JSON object per line, a result for each.

The offer stands in every answer (`Accept-Batch: 100`), so a farm learns of it without asking.
"""

import json
import time
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any

from flask import Flask, Response, jsonify, request
from werkzeug.exceptions import BadRequest, RequestEntityTooLarge

from sim.cloud.store import KINDS, Message, Outcome, Store

MAXIMUM_BYTES = 256 * 1024
_STATUS = {Outcome.STORED: 200, Outcome.DUPLICATE: 200, Outcome.CONFLICT: 409}


def add_to(app: Flask, store: Store, most_records: int) -> None:
    """Offer batches of up to so many records."""

    @app.post("/batch")
    def post_batch() -> tuple[Response, int]:
        lines = request.get_data().splitlines()
        if len(lines) > most_records or (request.content_length or 0) > MAXIMUM_BYTES:
            raise RequestEntityTooLarge(f"at most {most_records} records or {MAXIMUM_BYTES} bytes")
        messages = [_read(line) for line in lines]
        known = [message for message in messages if message.kind in KINDS]
        outcomes = iter(store.add_all(known, time.time()))
        return jsonify(results=[_result(message, outcomes) for message in messages]), HTTPStatus.OK

    @app.after_request
    def announce(response: Response) -> Response:
        response.headers["Accept-Batch"] = str(most_records)
        return response


def _read(line: bytes) -> Message:
    """Read a line.

    Raises:
        BadRequest: if it is no record at all, so that no result could name it.
    """
    try:
        entry = json.loads(line)
        kind, record = str(entry["kind"]), dict(entry["record"])
        return Message(kind, str(record["message_id"]), record)
    except (ValueError, TypeError, KeyError):
        raise BadRequest('a line must be {"kind": ..., "record": {"message_id": ...}}') from None


def _result(message: Message, outcomes: Iterator[Outcome]) -> dict[str, Any]:
    """What a record would have been answered alone."""
    if message.kind not in KINDS:
        return {"message_id": message.message_id, "status": HTTPStatus.NOT_FOUND}
    outcome = next(outcomes)
    return {
        "message_id": message.message_id,
        "status": _STATUS[outcome],
        "outcome": outcome.value,
    }
