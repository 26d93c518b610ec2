"""`/dead_letters/`: what the cloud has rejected, until somebody decides what becomes of it."""

from typing import Any

from apiflask import APIBlueprint
from flask import request
from flask.typing import ResponseReturnValue

from afarcloud.faults import Fault
from afarcloud.wire import TELEMETRY
from edge_server.api import bodies, urls
from edge_server.api.auth import ADMIN, PLANNERS, allow, audit
from edge_server.api.contract import Contract, describe
from edge_server.api.errors import RequestError
from edge_server.services import dead_letters

WORDS = ("dead_letters", "dead_letter")
ITEM = "int64:record_id"
_KINDS = [kind.value for kind in TELEMETRY]


def blueprint() -> APIBlueprint:
    """Make the routes."""
    routes = APIBlueprint("dead_letters", __name__)
    urls.add(routes, WORDS, "page", page, "GET")
    urls.add(routes, WORDS, "get", get, "GET", item=ITEM)
    urls.add(routes, WORDS, "retry", retry, "POST", item=ITEM, action="retry")
    urls.add(routes, WORDS, "discard", discard, "DELETE", item=ITEM)
    return routes


@allow(PLANNERS)
@describe(
    Contract({200: "DeadLetter"}, is_list=True, query=("after", "limit", "kind", "vehicle_id"))
)
def page() -> list[dict[str, Any]]:
    """List what the cloud has rejected, and why."""
    return dead_letters.page(
        bodies.context(),
        after_id=bodies.query_integer("after", 0, 0, 2**63 - 1),
        limit=bodies.query_integer("limit", bodies.PAGE_DEFAULT, 1, bodies.PAGE_LIMIT),
        kind=_kind(),
        vehicle_id=bodies.query_vehicle(),
    )


@allow(PLANNERS)
@describe(Contract({200: "DeadLetter"}))
def get(record_id: int) -> dict[str, Any]:
    """Give one dead letter."""
    return dead_letters.find(bodies.context(), record_id)


@allow(PLANNERS)
@describe(Contract({200: "Record"}))
def retry(record_id: int) -> dict[str, Any]:
    """Send a dead letter once more."""
    stored = dead_letters.retry(bodies.context(), record_id)
    audit(f"retried dead letter {record_id}")
    return stored


@allow(ADMIN)
@describe(Contract({204: None}))
def discard(record_id: int) -> ResponseReturnValue:
    """Forget a dead letter for good."""
    dead_letters.discard(bodies.context(), record_id)
    audit(f"discarded dead letter {record_id}")
    return "", 204


def _kind() -> str | None:
    kind = request.args.get("kind")
    if kind is not None and kind not in _KINDS:
        fault = Fault("kind", f"must be one of {', '.join(_KINDS)}")
        raise RequestError(422, "the query cannot be used", (fault,))
    return kind
