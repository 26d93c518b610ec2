"""`/telemetry/`: many reports of any kind in one request and one transaction, for the broker.

Each report succeeds or fails by itself: the answer has one entry per report, in order, with the
status that the report would have received alone.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from flask import Blueprint, g
from werkzeug.exceptions import Forbidden

from afarcloud import wire
from afarcloud.faults import DocumentError, Fault, InvalidError
from afarcloud.state import Report
from afarcloud.wire import TELEMETRY, Kind
from edge_server.api import bodies, errors, schemas, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import (
    BROKER,
    KEY_RULE,
    allow,
    broker,
    caller,
    is_idempotency_key,
)
from edge_server.api.contract import Contract, describe
from edge_server.services.errors import ServiceError
from edge_server.services.reports import telemetry
from edge_server.services.reports.telemetry import Arrival, Refusal

_KEY: Final = "idempotency_key"
_KINDS: Final = {kind.value: kind for kind in TELEMETRY}


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("bulk", __name__)
    urls.add(routes, ("telemetry",), "create", create, "POST")
    return routes


@allow(BROKER)
@describe(Contract({200: schemas.Receipts}, body=schemas.Reports))
def create() -> dict[str, Any]:
    """Store many reports; 200 means that each has an outcome, not that each was stored."""
    read = [_read(record) for record in _records()]
    arrivals = [one for one in read if isinstance(one, Arrival)]
    kept = iter(
        telemetry.ingest_all(bodies.context(), arrivals, caller().owner, broker())
        if arrivals
        else []
    )
    answers = [_answer(one, kept) for one in read]
    g.refused_records = Counter(one["status"] for one in answers if one["status"] != 201)
    return {"records": answers}


def _records() -> list[Any]:
    """Read the list of records; raises DocumentError if the body has none."""
    body = bodies.json_body(bodies.MAXIMUM_IMAGE_BODY_BYTES)
    records = body.get("records") if isinstance(body, dict) else None
    if not isinstance(records, list) or not body.keys() <= {"records"}:
        raise InvalidError((Fault("records", "must be the body's one field, an array"),))
    if not 1 <= len(records) <= schemas.MOST_RECORDS:
        raise InvalidError((Fault("records", f"must hold 1 to {schemas.MOST_RECORDS} reports"),))
    return records


def _read(record: Any) -> Arrival | DocumentError | Forbidden:
    """Read one report in its envelope, with its idempotency key if it has one."""
    if not isinstance(record, dict):
        return InvalidError((Fault("", 'must be an object such as {"pose": {...}}'),))
    key = record.get(_KEY)
    if key is not None and not is_idempotency_key(key):
        return InvalidError((Fault(_KEY, KEY_RULE),))
    envelope = {name: body for name, body in record.items() if name != _KEY}
    kind = _kind_of(envelope)
    if kind is None:
        return InvalidError((Fault("", f"must be one of {', '.join(_KINDS)} in its envelope"),))
    try:
        report = wire.read(kind, envelope)
    except DocumentError as error:
        return error
    if not isinstance(report, Report):
        raise TypeError(type(report))
    if not scopes.permits([report.vehicle_id]):
        return Forbidden(scopes.refusal([report.vehicle_id]))
    return Arrival(kind, report, key)


def _kind_of(envelope: dict[str, Any]) -> Kind | None:
    return _KINDS.get(wire.envelope_of(envelope)) if len(envelope) == 1 else None


def _answer(
    read: Arrival | DocumentError | Forbidden,
    kept: Iterator[dict[str, Any] | Refusal],
) -> dict[str, Any]:
    """Make the entry of a report: its receipt, or the error that it would have received alone."""
    if isinstance(read, DocumentError):
        return _invalid(read)
    if isinstance(read, Forbidden):
        return {"status": 403, **errors.body(read.description or "")}
    outcome = next(kept)
    if isinstance(outcome, DocumentError):
        return _invalid(outcome)
    if isinstance(outcome, ServiceError):
        status = errors.STATUS[type(outcome)]
        return {"status": status, **errors.body(str(outcome), outcome.faults)}
    return {"status": 201, **outcome}


def _invalid(error: DocumentError) -> dict[str, Any]:
    return {"status": 422, **errors.body("the document cannot be used", error.faults)}
