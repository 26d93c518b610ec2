"""The broker's door: `/broker/commands`, and `/latest_state_vector/` which ends up there."""

from typing import Any, Final

from apiflask import APIBlueprint
from flask.typing import ResponseReturnValue
from pydantic import Field

from afarcloud.model import Model
from afarcloud.plan import LatestStateVector
from afarcloud.wire import Kind
from edge_server.api import bodies, scopes, urls
from edge_server.api.auth import BROKER, PEOPLE, allow, audit
from edge_server.api.contract import Contract, describe
from edge_server.services import broker_work
from edge_server.services.broker_work import Acknowledgement

LONGEST_WAIT_S: Final = 25.0


class Acknowledged(Model):
    """Body of an acknowledgement."""

    status: Acknowledgement
    message: str | None = Field(default=None, max_length=1000)


def blueprint() -> APIBlueprint:
    """Make the routes."""
    routes = APIBlueprint("broker", __name__)
    urls.add(routes, ("broker/commands",), "poll", poll, "GET")
    for slash in ("/", ""):
        place = f"/broker/commands/<int64:identifier>/ack{slash}"
        routes.add_url_rule(place, "acknowledge", acknowledge, methods=["POST"])
    words = ("latest_state_vector", "latest_state_vectors")
    urls.add(routes, words, "ask", ask_for_state_vector, "POST")
    return routes


@allow(BROKER)
@describe(Contract({200: "Work"}, query=("after", "wait"), errors=(429,)))
def poll() -> dict[str, Any]:
    """Give work, waiting for some if asked to."""
    after = bodies.query_integer("after", 0, 0, 2**63 - 1)
    wait_s = bodies.query_number("wait", 0.0, 0.0, LONGEST_WAIT_S)
    return broker_work.poll(bodies.context(), after, wait_s, scopes.vehicles())


@allow(BROKER)
@describe(Contract({200: "WorkState"}, body="Acknowledged", errors=(409,)))
def acknowledge(identifier: int) -> dict[str, Any]:
    """Take in what the broker says of a piece of work."""
    said = bodies.model(Acknowledged)
    if scopes.vehicles() is not None:
        meant = broker_work.vehicle_of(bodies.context(), identifier)
        scopes.check(*([] if meant is None else [meant]))
    return broker_work.acknowledge(bodies.context(), identifier, said.status, said.message)


@allow(PEOPLE)
@describe(Contract({202: "StateVectorRequest"}, body="LatestStateVector", errors=(404, 429)))
def ask_for_state_vector() -> ResponseReturnValue:
    """Ask for a fresh state vector of one vehicle, or of all."""
    request = bodies.document(Kind.LATEST_STATE_VECTOR)
    if not isinstance(request, LatestStateVector):
        raise TypeError(type(request))
    scopes.check(request.vehicle_id)
    answer = broker_work.ask_for_state_vector(bodies.context(), request)
    audit("asked for the latest state vector")
    return answer, 202
