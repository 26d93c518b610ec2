"""The mock cloud's HTTP surface."""

import time
import uuid
from http import HTTPStatus
from typing import Any

from flask import Flask, Response, jsonify, request
from werkzeug.exceptions import HTTPException

from sim.cloud import batch
from sim.cloud.store import KINDS, Outcome, Store

MAXIMUM_BODY_BYTES = 4 * 1024 * 1024
ANSWERS = {
    Outcome.STORED: HTTPStatus.OK,
    Outcome.DUPLICATE: HTTPStatus.OK,
    Outcome.CONFLICT: HTTPStatus.CONFLICT,
}


def create_app(store: Store, *, batch_records: int = 0) -> Flask:
    """Build the application about a store; it takes batches of so many records, none if 0."""
    app = Flask("sim.cloud")
    app.url_map.strict_slashes = False
    app.config["MAX_CONTENT_LENGTH"] = MAXIMUM_BODY_BYTES

    @app.get("/healthz")
    def healthz() -> Response:
        return jsonify(status="ok")

    @app.get("/")
    def overview() -> Response:
        return jsonify(counts=store.counts())

    @app.get("/records")
    def records() -> Response:
        return _listing(store, None)

    @app.errorhandler(HTTPException)
    def refuse(error: HTTPException) -> tuple[Response, int]:
        return jsonify(message=error.description), error.code or 500

    @app.errorhandler(OSError)
    def storage_failed(error: OSError) -> tuple[Response, int]:
        return jsonify(message=f"not stored: {error.strerror}"), HTTPStatus.INSUFFICIENT_STORAGE

    for kind in KINDS:
        _add_kind(app, store, kind)
    if batch_records:
        batch.add_to(app, store, batch_records)
    return app


def _add_kind(app: Flask, store: Store, kind: str) -> None:
    @app.post(f"/{kind}", endpoint=f"post_{kind}")
    def post() -> tuple[Response, int]:
        body = request.get_json()
        if not isinstance(body, dict):
            return jsonify(message="the body must be a JSON object"), HTTPStatus.BAD_REQUEST
        message_id = request.headers.get("Idempotency-Key") or str(uuid.uuid4())
        outcome = store.add(kind, message_id, body, time.time())
        answer: dict[str, Any] = {"message_id": message_id, "outcome": outcome.value}
        return jsonify(answer), ANSWERS[outcome]

    @app.get(f"/{kind}", endpoint=f"get_{kind}")
    def get() -> Response:
        return _listing(store, kind)


def _listing(store: Store, kind: str | None) -> Response:
    after = request.args.get("after", default=0, type=int)
    vehicle_id = request.args.get("vehicle_id", type=int)
    found = [
        record.as_json()
        for record in store.records(kind, max(0, after))
        if vehicle_id is None or record.body.get("vehicle_id") == vehicle_id
    ]
    return jsonify(found)
