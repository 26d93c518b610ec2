"""`/broker/commands`, and `/latest_state_vector/`, whose requests the broker receives there."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from flask import Blueprint, request
from flask.typing import ResponseReturnValue
from pydantic import Field

from afarcloud.numbers import Model
from afarcloud.plan import LatestStateVector
from afarcloud.wire import Kind
from edge_server.api import bodies, schemas, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import BROKER, PEOPLE, allow, audit, broker
from edge_server.api.contract import Contract, describe
from edge_server.connections.exchange import exchange_of
from edge_server.services.fleet import broker_work, work_identity
from edge_server.services.fleet.broker_work import Acknowledgement

LONGEST_WAIT_S: Final = 25.0


class Acknowledged(Model):
    """Body of an acknowledgement."""

    status: Acknowledgement
    message: str | None = Field(default=None, max_length=1000)
    identity: str | None = Field(default=None, max_length=work_identity.LENGTH)


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("broker", __name__)
    urls.add(routes, ("broker/commands",), "poll", poll, "GET")
    urls.add(
        routes,
        ("broker/commands",),
        "acknowledge",
        acknowledge,
        "POST",
        item="int64:identifier",
        action="ack",
    )
    names = ("latest_state_vector", "latest_state_vectors")
    urls.add(routes, names, "ask", request_state_vector, "POST")
    return routes


@allow(BROKER)
@describe(Contract({200: schemas.Work}, query=("after", "wait"), errors=(429,)))
def poll() -> dict[str, Any]:
    """Give work for the broker; with `wait`, block until there is some."""
    after = bodies.query_after()
    wait_s = bodies.query_number("wait", 0.0, 0.0, LONGEST_WAIT_S)
    return broker_work.poll(
        bodies.context(), after, wait_s, broker(), scopes.vehicles(), _is_connected(request.environ)
    )


def _is_connected(environ: Mapping[str, Any]) -> Callable[[], bool]:
    """Return a check of whether the client still waits: true under another WSGI server."""
    exchange = exchange_of(environ)
    return lambda: exchange is None or exchange.is_connected


@allow(BROKER)
@describe(Contract({200: schemas.WorkState}, body=Acknowledged, errors=(409,)))
def acknowledge(identifier: int) -> dict[str, Any]:
    """Acknowledge a work item."""
    acknowledgement = bodies.model(Acknowledged)
    if scopes.vehicles() is not None:
        vehicle_id = broker_work.vehicle_of(bodies.context(), identifier)
        scopes.check(*([] if vehicle_id is None else [vehicle_id]))
    return broker_work.acknowledge(
        bodies.context(),
        identifier,
        acknowledgement.status,
        acknowledgement.message,
        broker(),
        acknowledgement.identity,
    )


@allow(PEOPLE)
@describe(Contract({202: schemas.StateVectorRequest}, body=LatestStateVector, errors=(404, 429)))
def request_state_vector() -> ResponseReturnValue:
    """Request a fresh state vector of one vehicle, or of all."""
    wanted = bodies.document(Kind.LATEST_STATE_VECTOR, LatestStateVector)
    scopes.check(wanted.vehicle_id)
    answer = broker_work.request_state_vector(bodies.context(), wanted)
    audit("requested the latest state vector")
    return answer, 202
