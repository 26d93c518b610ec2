"""`/events/`: they interrupt a mission, expire after seconds and stay readable."""

from typing import Any, Final

from flask import Blueprint
from flask.typing import ResponseReturnValue
from werkzeug.exceptions import Forbidden

from afarcloud.enumerations import EventType
from afarcloud.plan import Event
from afarcloud.wire import Kind
from edge_server.api import bodies, etags, freshness, schemas, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import PEOPLE, PLANNERS, READERS, allow, audit, caller
from edge_server.api.contract import PAGE, Contract, describe
from edge_server.services.fleet import events
from edge_server.store.rows.keys import Role

NAMES: Final = ("events", "event")
ITEM: Final = "int64:identifier"
FLYING_ON: Final = frozenset({EventType.RESUME_MISSION, EventType.DRONE_SPEED})
"""Events after which a vehicle flies on; a farmer may only stop it."""
EXAMPLE: Final = {
    "sequence_number": 5,
    "vehicle_id": 1,
    "event_type_id": 1,
    "abort": {"latitude": 40.4434, "longitude": -3.7382, "altitude": 5.0},
}


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("events", __name__)
    urls.add(routes, NAMES, "create", create, "POST")
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM)
    urls.add(routes, NAMES, "put", put, "PUT", item=ITEM)
    urls.add(routes, NAMES, "delete", delete, "DELETE", item=ITEM)
    return routes


@allow(PEOPLE)
@describe(
    Contract(
        {201: schemas.StoredEvent},
        body=Event,
        repeatable=True,
        errors=(404, 409, 429),
        example=EXAMPLE,
    )
)
def create() -> ResponseReturnValue:
    """Interrupt a vehicle's mission; a farmer may stop it, not resume it or change its speed."""
    freshness.check()
    stored = events.create(bodies.context(), _event(), caller(), freshness.waited_s())
    audit(f"posted event {stored['id']}: {stored['event_type_name']}")
    return stored, 201, {"Location": urls.path_of("events.get", identifier=stored["id"])}


@allow(READERS)
@describe(Contract({200: schemas.StoredEvent}, is_list=True, query=PAGE))
def page() -> list[dict[str, Any]]:
    """List events, also those that have ended."""
    after_id = bodies.query_after()
    limit = bodies.query_limit()
    since_s = bodies.query_time("since")
    context = bodies.context()

    def of(vehicle_id: int | None) -> list[dict[str, Any]]:
        return events.page(
            context, after_id=after_id, limit=limit, since_s=since_s, vehicle_id=vehicle_id
        )

    return scopes.pages(of, bodies.query_vehicle(), limit)


@allow(READERS)
@describe(Contract({200: schemas.StoredEvent}, conditional=True))
def get(identifier: int) -> ResponseReturnValue:
    """Give an event with its live state."""
    return etags.tagged(scopes.permitted(events.find(bodies.context(), identifier)))


@allow(PEOPLE)
@describe(
    Contract(
        {200: schemas.StoredEvent}, body=Event, conditional=True, errors=(409, 429), example=EXAMPLE
    )
)
def put(identifier: int) -> ResponseReturnValue:
    """Replace an event that the broker has not accepted; it expires after 10 s from now."""
    precondition = scopes.with_vehicle_check(etags.check_match)
    stored = events.replace(bodies.context(), identifier, _event(), precondition)
    audit(f"replaced event {identifier}: {stored['event_type_name']}")
    return etags.tagged(stored)


@allow(PLANNERS)
@describe(Contract({204: None}, errors=(409,)))
def delete(identifier: int) -> ResponseReturnValue:
    """Cancel a queued event, or delete one that has ended."""
    scopes.permitted(events.find(bodies.context(), identifier))
    events.remove(bodies.context(), identifier)
    audit(f"deleted event {identifier}")
    return "", 204


def _event() -> Event:
    """Read an event that the caller may post; raises 403."""
    event = bodies.document(Kind.EVENT, Event)
    if caller().role == Role.FARMER and event.event_type_id in FLYING_ON:
        raise Forbidden("a farmer may stop a mission, not resume it or change its speed")
    scopes.check(event.vehicle_id)
    return event
