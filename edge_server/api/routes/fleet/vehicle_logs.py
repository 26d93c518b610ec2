"""`/vehicles/<id>/logs/`: a broker sends the log of a flight in parts, and continues one.

A log is begun under a name that the broker chooses, then its parts follow in order. Each request
may be repeated: to begin a log again gives how much of it was received, and a part that does not
begin there changes nothing (409).
"""

from typing import Any, Final

from flask import Blueprint
from flask.typing import ResponseReturnValue

from edge_server.api import archive_schemas, bodies, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import BROKER, allow
from edge_server.api.contract import Contract, describe
from edge_server.api.routes.fleet.vehicles import ITEM, NAMES
from edge_server.services import flight_logs
from edge_server.services.flight_logs import VehicleLog

NAME: Final = "logs/<string(maxlength=64):name>"
LATEST_OFFSET: Final = 2**32 - 1


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("vehicle_logs", __name__)
    urls.add(routes, NAMES, "page", page, "GET", item=ITEM, action="logs")
    urls.add(routes, NAMES, "put", put, "PUT", item=ITEM, action=NAME)
    urls.add(routes, NAMES, "patch", patch, "PATCH", item=ITEM, action=NAME)
    urls.add(routes, NAMES, "delete", delete, "DELETE", item=ITEM, action=NAME)
    return routes


@allow(BROKER)
@describe(Contract({200: archive_schemas.ReceivedLog}, is_list=True))
def page(vehicle_id: int) -> list[dict[str, Any]]:
    """List the logs of a vehicle that are not complete, newest first."""
    scopes.check(vehicle_id)
    return flight_logs.incomplete(bodies.context(), vehicle_id)


@allow(BROKER)
@describe(
    Contract(
        {200: archive_schemas.ReceivedLog, 201: archive_schemas.ReceivedLog},
        body=VehicleLog,
        errors=(409,),
    )
)
def put(vehicle_id: int, name: str) -> ResponseReturnValue:
    """Begin the log of a flight, or ask how much of it was received."""
    scopes.check(vehicle_id)
    described = bodies.model(VehicleLog)
    shown, is_new = flight_logs.begin(bodies.context(), vehicle_id, name, described)
    return shown, 201 if is_new else 200


@allow(BROKER)
@describe(
    Contract(
        {200: archive_schemas.ReceivedLog},
        query=("offset:required", "is_last"),
        files=(bodies.OCTETS,),
        errors=(409,),
    )
)
def patch(vehicle_id: int, name: str) -> dict[str, Any]:
    """Add a part of a log, of 1 MiB at most, where the received ones end; 409 elsewhere."""
    scopes.check(vehicle_id)
    offset = bodies.query_integer("offset", None, 0, LATEST_OFFSET)
    is_last = bodies.query_boolean("is_last")
    data = bodies.octets()
    return flight_logs.append(bodies.context(), vehicle_id, name, offset, data, is_last=is_last)


@allow(BROKER)
@describe(Contract({204: None}))
def delete(vehicle_id: int, name: str) -> ResponseReturnValue:
    """Delete a log, such as one that cannot be completed."""
    scopes.check(vehicle_id)
    flight_logs.discard(bodies.context(), vehicle_id, name)
    return "", 204
