"""`/dead_letters/`: reports that the cloud has rejected, to be retried, corrected or discarded."""

from typing import Any

from flask import Blueprint, Response, request
from flask.typing import ResponseReturnValue

from afarcloud.state import Report
from afarcloud.wire import Kind
from edge_server.api import bodies, schemas, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import ADMIN, PLANNERS, allow, audit
from edge_server.api.contract import Contract, describe
from edge_server.api.routes.administration.audit import NDJSON
from edge_server.outbox import gaps
from edge_server.services.errors import ConflictError
from edge_server.services.reports import dead_letters
from edge_server.store.connection.database import to_json

NAMES = ("dead_letters", "dead_letter")
ITEM = "int64:record_id"
_EXAMPLE = {"sequence_number": 7, "vehicle_id": 1, "capacity": 5.2, "percentage": 0.8}


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("dead_letters", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM)
    urls.add(routes, NAMES, "retry", retry, "POST", item=ITEM, action="retry")
    urls.add(routes, NAMES, "retry_all", retry_all, "POST", action="retry")
    urls.add(routes, NAMES, "export", export, "GET", action="export")
    urls.add(routes, NAMES, "edit", edit, "PUT", item=ITEM)
    urls.add(routes, NAMES, "discard", discard, "DELETE", item=ITEM)
    return routes


@allow(PLANNERS)
@describe(
    Contract(
        {200: schemas.DeadLetter}, is_list=True, query=("after", "limit", "kind", "vehicle_id")
    )
)
def page() -> list[dict[str, Any]]:
    """List rejected reports and the reasons."""
    after_id = bodies.query_after()
    limit = bodies.query_limit()
    kind = _kind()

    def of(vehicle_id: int | None) -> list[dict[str, Any]]:
        return dead_letters.page(
            bodies.context(), after_id=after_id, limit=limit, kind=kind, vehicle_id=vehicle_id
        )

    return scopes.pages(of, bodies.query_vehicle(), limit)


@allow(PLANNERS)
@describe(Contract({200: schemas.DeadLetter}))
def get(record_id: int) -> dict[str, Any]:
    """Give one dead letter."""
    return scopes.permitted(dead_letters.find(bodies.context(), record_id))


@allow(PLANNERS)
@describe(Contract({200: schemas.Record}))
def retry(record_id: int) -> dict[str, Any]:
    """Retry a dead letter."""
    scopes.check_resource(lambda: dead_letters.find(bodies.context(), record_id))
    stored = dead_letters.retry(bodies.context(), record_id)
    audit(f"retried dead letter {record_id}")
    return stored


@allow(PLANNERS)
@describe(Contract({200: schemas.Retried}, query=("kind", "vehicle_id")))
def retry_all() -> dict[str, int]:
    """Retry all dead letters, or those of a kind or vehicle."""
    vehicle_id = bodies.query_vehicle()
    scopes.check(vehicle_id)
    retried = dead_letters.retry_all(bodies.context(), kind=_kind(), vehicle_id=vehicle_id)
    audit(f"retried {retried} dead letters")
    return {"retried": retried}


@allow(ADMIN)
@describe(Contract({200: schemas.Record}, body=schemas.AnyReport, errors=(409,), example=_EXAMPLE))
def edit(record_id: int) -> dict[str, Any]:
    """Correct a dead letter and send it."""
    kind = scopes.permitted(dead_letters.find(bodies.context(), record_id))["kind"]
    if kind == gaps.KIND:
        raise ConflictError("a gap cannot be edited: retry or delete it")
    report = bodies.document(Kind(kind), Report)
    stored = dead_letters.edit(bodies.context(), record_id, report)
    audit(f"corrected dead letter {record_id}")
    return stored


@allow(PLANNERS)
@describe(Contract({200: None}, query=("kind", "vehicle_id"), other_answers=(NDJSON,)))
def export() -> Response:
    """Export all dead letters as NDJSON."""
    vehicle_id = bodies.query_vehicle()
    scopes.check(vehicle_id)
    found = dead_letters.export(bodies.context(), kind=_kind(), vehicle_id=vehicle_id)
    return Response((to_json(letter) + "\n" for letter in found), content_type=NDJSON)


@allow(ADMIN)
@describe(Contract({204: None}))
def discard(record_id: int) -> ResponseReturnValue:
    """Discard a dead letter."""
    scopes.check_resource(lambda: dead_letters.find(bodies.context(), record_id))
    dead_letters.discard(bodies.context(), record_id)
    audit(f"discarded dead letter {record_id}")
    return "", 204


def _kind() -> str | None:
    kind = request.args.get("kind")
    if kind is None:
        return None
    return bodies.query_choice("kind", kind, schemas.KINDS_OF_DEAD_LETTERS)
