"""`/flights/<id>/log`: what the vehicle has written of a flight, and the broker of its messages.

A flight has several logs if its vehicle was disarmed in between; `/flights/<id>/logs` lists them.
"""

from flask import Blueprint, Response, request

from edge_server.api import archive_schemas, bodies, etags, urls
from edge_server.api.access.auth import PEOPLE, allow
from edge_server.api.contract import Contract, describe
from edge_server.api.routes.reports.flights import ITEM, NAMES, check_flight
from edge_server.services import flight_logs
from edge_server.services.flight_logs import LogFile
from edge_server.services.reports.listing import Listing


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("flight_logs", __name__)
    urls.add(routes, NAMES, "page", page, "GET", item=ITEM, action="logs")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM, action="logs/<int64:number>")
    urls.add(routes, NAMES, "largest", largest, "GET", item=ITEM, action="log")
    return routes


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.FlightLog}, is_list=True))
def page(flight_id: int) -> Listing:
    """List the logs of a flight, oldest first, also those that are still received."""
    check_flight(flight_id)
    return flight_logs.of_flight(bodies.context(), flight_id)


@allow(PEOPLE)
@describe(Contract({200: None, 206: None}, conditional=True, errors=(416,)))
def get(flight_id: int, number: int) -> Response:
    """Give a log of a flight, or the range of its bytes that is asked for."""
    check_flight(flight_id)
    return _file(flight_logs.file_of_flight(bodies.context(), flight_id, number))


@allow(PEOPLE)
@describe(Contract({200: None, 206: None}, query=("format:log",), conditional=True, errors=(416,)))
def largest(flight_id: int) -> Response:
    """Give the vehicle's own log of a flight, the largest of several; or that of a format."""
    check_flight(flight_id)
    formats = flight_logs.OWN_FORMATS
    if (form := request.args.get("format")) is not None:
        formats = frozenset({bodies.query_choice("format", form, flight_logs.FORMATS)})
    return _file(flight_logs.largest_of_flight(bodies.context(), flight_id, formats))


def _file(found: LogFile) -> Response:
    answer = etags.file_part(found.tag, found.size_bytes, found.read, flight_logs.MEDIA_TYPE)
    answer.headers["Content-Disposition"] = f'attachment; filename="{found.name}"'
    return answer
