"""`/vehicles/`: the registry."""

from typing import Any

from apiflask import APIBlueprint
from flask import make_response, url_for
from flask.typing import ResponseReturnValue

from afarcloud.faults import Fault, InvalidError
from afarcloud.model import Model
from afarcloud.numbers import INT32_MAX, ShortText
from edge_server.api import bodies, etags, scopes, urls
from edge_server.api.auth import ADMIN, PLANNERS, READERS, allow, audit, caller
from edge_server.api.contract import Contract, describe
from edge_server.services import vehicle_holds, vehicles
from edge_server.services.vehicles import VehicleState
from edge_server.store.keys import Role


class Release(Model):
    """Body of a release: what was done about the fault."""

    reason: ShortText


WORDS = ("vehicles", "vehicle")
ITEM = "int64:vehicle_id"


def blueprint() -> APIBlueprint:
    """Make the routes."""
    routes = APIBlueprint("vehicles", __name__)
    urls.add(routes, WORDS, "page", page, "GET")
    urls.add(routes, WORDS, "get", get, "GET", item=ITEM)
    urls.add(routes, WORDS, "put", put, "PUT", item=ITEM)
    urls.add(routes, WORDS, "delete", delete, "DELETE", item=ITEM)
    urls.add(routes, WORDS, "release", release, "POST", item=ITEM, action="release")
    return routes


@allow(READERS)
@describe(Contract({200: "Vehicle"}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List vehicles."""
    everyone = vehicles.everyone(bodies.context())
    return [one for one in everyone if scopes.permits([one["vehicle_id"]])]


@allow(READERS)
@describe(Contract({200: "Vehicle"}, conditional=True))
def get(vehicle_id: int) -> ResponseReturnValue:
    """Give one vehicle."""
    scopes.check(vehicle_id)
    return etags.tagged(vehicles.find(bodies.context(), vehicle_id))


@allow(PLANNERS | {Role.BROKER})
@describe(Contract({200: "Vehicle", 201: "Vehicle"}, body="VehicleState", conditional=True))
def put(vehicle_id: int) -> ResponseReturnValue:
    """Register or update a vehicle."""
    state = bodies.model(VehicleState)
    if not 1 <= vehicle_id <= INT32_MAX:
        raise InvalidError((Fault("vehicle_id", f"must be 1 to {INT32_MAX}"),))
    scopes.check(vehicle_id)
    stored, is_new = vehicles.put(bodies.context(), vehicle_id, state, etags.check_match)
    if caller().role != Role.BROKER:
        audit(f"put vehicle {vehicle_id}")
    response = make_response(etags.tagged(stored, 201 if is_new else 200))
    if is_new:
        response.headers["Location"] = url_for("vehicles.get", vehicle_id=vehicle_id)
    return response


@allow(PLANNERS)
@describe(Contract({200: "Vehicle"}, body="Release"))
def release(vehicle_id: int) -> ResponseReturnValue:
    """Let a vehicle fly again that is held after a fault; one that is not held stays as it is."""
    scopes.check(vehicle_id)
    reason = bodies.model(Release).reason
    stored = vehicle_holds.release(bodies.context(), vehicle_id, reason)
    audit(f"released vehicle {vehicle_id}")
    return etags.tagged(stored)


@allow(ADMIN)
@describe(Contract({204: None}, errors=(409,)))
def delete(vehicle_id: int) -> ResponseReturnValue:
    """Forget a vehicle."""
    scopes.check(vehicle_id)
    vehicles.remove(bodies.context(), vehicle_id)
    audit(f"deleted vehicle {vehicle_id}")
    return "", 204
