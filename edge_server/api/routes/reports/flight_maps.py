"""`/flights/<id>/map`: the pictures of a survey, laid out as one map for each band.

`/flight_maps/` lists those that are made.
"""

from typing import Any, Final

from flask import Blueprint, Response, request
from flask.typing import ResponseReturnValue

from edge_server.api import archive_schemas, bodies, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import PEOPLE, PLANNERS, allow, audit
from edge_server.api.contract import Contract, describe
from edge_server.api.routes.reports.flights import ITEM, NAMES, check_flight
from edge_server.pictures import footprint
from edge_server.services import flight_maps

LIST_NAMES: Final = ("flight_maps",)


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("flight_maps", __name__)
    urls.add(routes, LIST_NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM, action="map")
    urls.add(routes, NAMES, "make", make, "POST", item=ITEM, action="map")
    urls.add(routes, NAMES, "picture", picture, "GET", item=ITEM, action="map/picture")
    return routes


@allow(PEOPLE)
@describe(
    Contract(
        {200: archive_schemas.MadeFlightMap}, is_list=True, query=("after", "limit", "vehicle_id")
    )
)
def page() -> list[dict[str, Any]]:
    """List the maps of flights that are made, the one that was made last at the end."""
    after_id = bodies.query_after()
    limit = bodies.query_limit()

    def of(vehicle_id: int | None) -> list[dict[str, Any]]:
        return flight_maps.listing(
            bodies.context(), after_id=after_id, limit=limit, vehicle_id=vehicle_id
        )

    return scopes.pages(of, bodies.query_vehicle(), limit)


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.FlightMap}, query=("band",)))
def get(flight_id: int) -> dict[str, Any]:
    """Give the state of a flight's map, and what ground it shows once it is made."""
    check_flight(flight_id)
    return flight_maps.overview(bodies.context(), flight_id, _band())


@allow(PLANNERS)
@describe(Contract({202: archive_schemas.FlightMap}, query=("band",), errors=(409, 429)))
def make(flight_id: int) -> ResponseReturnValue:
    """Begin to make the map of a flight out of its pictures that look down."""
    check_flight(flight_id)
    begun = flight_maps.make(bodies.context(), flight_id, _band())
    audit(f"begun the map of flight {flight_id}")
    return begun, 202


@allow(PEOPLE)
@describe(Contract({200: None}, query=("band",)))
def picture(flight_id: int) -> Response:
    """Give the map as a WebP between its corners, transparent where nothing is known."""
    check_flight(flight_id)
    answer = Response(
        flight_maps.picture(bodies.context(), flight_id, _band()),
        content_type=flight_maps.MEDIA_TYPE,
    )
    answer.headers["Cache-Control"] = "private, no-cache"
    return answer


def _band() -> str:
    """Read of which pictures the map is; raises 422."""
    return bodies.query_choice("band", request.args.get("band", footprint.RGB), footprint.BANDS)
