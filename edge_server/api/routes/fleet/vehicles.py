"""`/vehicles/`: the registry of vehicles."""

from typing import Any, Final

from flask import Blueprint, make_response
from flask.typing import ResponseReturnValue

from afarcloud.faults import Fault, InvalidError
from afarcloud.numbers import INT32_MAX, Model, ShortText
from edge_server.api import bodies, etags, schemas, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import ADMIN, PLANNERS, READERS, allow, audit, broker, caller
from edge_server.api.contract import Contract, describe
from edge_server.api.routes.fleet import live
from edge_server.services.fleet import vehicle_holds, vehicles
from edge_server.services.fleet.vehicles import VehicleState
from edge_server.store.rows.keys import Role


class Release(Model):
    """Body of a release: how the fault was resolved."""

    reason: ShortText


WATCHED_UPDATE_S: Final = 0.4
"""Interval of the updates that a broker is asked for while somebody watches."""
NAMES = ("vehicles", "vehicle")
ITEM = "int64:vehicle_id"


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("vehicles", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM)
    urls.add(routes, NAMES, "put", put, "PUT", item=ITEM)
    urls.add(routes, NAMES, "delete", delete, "DELETE", item=ITEM)
    urls.add(routes, NAMES, "release", release, "POST", item=ITEM, action="release")
    return routes


@allow(READERS)
@describe(Contract({200: schemas.Vehicle}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List vehicles."""
    everyone = vehicles.everyone(bodies.context())
    return [one for one in everyone if scopes.permits([one["vehicle_id"]])]


@allow(READERS)
@describe(Contract({200: schemas.Vehicle}, conditional=True))
def get(vehicle_id: int) -> ResponseReturnValue:
    """Give one vehicle."""
    scopes.check(vehicle_id)
    return etags.tagged(vehicles.find(bodies.context(), vehicle_id))


@allow(PLANNERS | {Role.BROKER})
@describe(
    Contract({200: schemas.Vehicle, 201: schemas.Vehicle}, body=VehicleState, conditional=True)
)
def put(vehicle_id: int) -> ResponseReturnValue:
    """Register or update a vehicle; while somebody watches, the answer has an `Update-Interval`."""
    state = bodies.model(VehicleState)
    if not 1 <= vehicle_id <= INT32_MAX:
        raise InvalidError((Fault("vehicle_id", f"must be 1 to {INT32_MAX}"),))
    scopes.check(vehicle_id)
    if caller().role == Role.BROKER:
        bodies.context().contacts.note(broker(), [vehicle_id])
        stored, is_new = vehicles.report(bodies.context(), vehicle_id, state, etags.check_match)
    else:
        stored, is_new = vehicles.put(bodies.context(), vehicle_id, state, etags.check_match)
        audit(f"put vehicle {vehicle_id}")
    response = make_response(etags.tagged(stored, 201 if is_new else 200))
    if live.is_watched():
        response.headers["Update-Interval"] = f"{WATCHED_UPDATE_S:g}"
    if is_new:
        response.headers["Location"] = urls.path_of("vehicles.get", vehicle_id=vehicle_id)
    return response


@allow(PLANNERS)
@describe(Contract({200: schemas.Vehicle}, body=Release))
def release(vehicle_id: int) -> ResponseReturnValue:
    """Release a vehicle that is held after a fault; no effect on one that is not held."""
    scopes.check(vehicle_id)
    reason = bodies.model(Release).reason
    stored = vehicle_holds.release(bodies.context(), vehicle_id, reason)
    audit(f"released vehicle {vehicle_id}")
    return etags.tagged(stored)


@allow(ADMIN)
@describe(Contract({204: None}, errors=(409,)))
def delete(vehicle_id: int) -> ResponseReturnValue:
    """Delete a vehicle."""
    scopes.check(vehicle_id)
    vehicles.remove(bodies.context(), vehicle_id)
    audit(f"deleted vehicle {vehicle_id}")
    return "", 204
