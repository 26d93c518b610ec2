"""`/flights/`: what was flown, from the archive; kept after the cloud has the reports."""

import hashlib
from collections.abc import Collection, Iterator
from typing import Any, Final

from flask import Blueprint, Response, request

from edge_server.api import archive_schemas, bodies, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import PEOPLE, allow
from edge_server.api.contract import PAGE, Contract, describe
from edge_server.archive import observation_files
from edge_server.archive.track_files import FORMATS
from edge_server.services import flight_archive
from edge_server.services.flight_archive import Page

NAMES: Final = ("flights", "flight")
ITEM: Final = "int64:flight_id"
PART: Final = ("after", "limit")
OBSERVATION_FORMATS: Final = ("json", "csv")


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("flights", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM)
    for name, view in (
        ("track", track),
        ("pictures", pictures),
        ("footprints", footprints),
        ("observations", observations),
    ):
        urls.add(routes, NAMES, name, view, "GET", item=ITEM, action=name)
    number = "pictures/<int64:number>"
    urls.add(routes, NAMES, "picture", picture, "GET", item=ITEM, action=number)
    small = f"{number}/thumbnail"
    urls.add(routes, NAMES, "thumbnail", thumbnail, "GET", item=ITEM, action=small)
    return routes


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.Flight}, is_list=True, query=PAGE))
def page() -> list[dict[str, Any]]:
    """List the flights in the archive, oldest first."""
    asked, since_s = _part(), bodies.query_time("since")

    def of(vehicle_id: int | None) -> list[dict[str, Any]]:
        wanted = asked._replace(vehicle_id=vehicle_id, since_s=since_s)
        return flight_archive.flights(bodies.context(), wanted)

    return scopes.pages(of, bodies.query_vehicle(), asked.limit)


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.FlightWithResults}))
def get(flight_id: int) -> dict[str, Any]:
    """Give a flight with its commands and their results."""
    return scopes.permitted(flight_archive.flight_with_results(bodies.context(), flight_id))


@allow(PEOPLE)
@describe(Contract({200: None}, query=("format:track",)))
def track(flight_id: int) -> Response:
    """Give the track of a flight as GeoJSON, CSV or GPX 1.1."""
    form = _form("geojson", FORMATS)
    check_flight(flight_id)
    media_type, _ = FORMATS[form]
    lines = flight_archive.track(bodies.context(), flight_id, form)
    return _file(lines, media_type, f"flight-{flight_id}.{form}")


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.FlightPicture}, is_list=True, query=PART))
def pictures(flight_id: int) -> list[dict[str, Any]]:
    """List the pictures of a flight, without their data."""
    asked = _part()
    check_flight(flight_id)
    return flight_archive.pictures(bodies.context(), flight_id, asked)


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.PictureFootprint}, is_list=True, query=PART))
def footprints(flight_id: int) -> list[dict[str, Any]]:
    """List what ground the pictures of a flight show; null for one that is no map."""
    asked = _part()
    check_flight(flight_id)
    return flight_archive.footprints(bodies.context(), flight_id, asked)


@allow(PEOPLE)
@describe(Contract({200: None}))
def picture(flight_id: int, number: int) -> Response:
    """Give a picture as the vehicle has taken it."""
    check_flight(flight_id)
    found = flight_archive.picture(bodies.context(), flight_id, number)
    return Response(found.data, content_type=found.media_type)


@allow(PEOPLE)
@describe(Contract({200: None}, conditional=True, errors=(429,)))
def thumbnail(flight_id: int, number: int) -> Response:
    """Give a picture as a JPEG of at most 320 pixels a side; 404 if it cannot be read."""
    check_flight(flight_id)
    context = bodies.context()
    found = flight_archive.picture(context, flight_id, number)
    tag = f"{hashlib.sha256(found.key.encode()).hexdigest()[:32]}-thumbnail"
    if request.if_none_match.contains(tag):
        answer = Response(status=304)
    else:
        small = flight_archive.thumbnail(context, flight_id, number, found)
        answer = Response(small, content_type="image/jpeg")
    answer.set_etag(tag)
    # Asked again each time: who may see a picture changes
    answer.headers["Cache-Control"] = "private, no-cache"
    return answer


@allow(PEOPLE)
@describe(
    Contract(
        {200: archive_schemas.FlightObservations},
        is_list=True,
        query=(*PART, "format:csv"),
        other_answers=("text/csv",),
    )
)
def observations(flight_id: int) -> list[dict[str, Any]] | Response:
    """List the measurements of a flight, or give all of them as CSV."""
    is_file = _form("json", OBSERVATION_FORMATS) == "csv"
    asked = _part()
    check_flight(flight_id)
    if not is_file:
        return flight_archive.observations(bodies.context(), flight_id, asked)
    return _file(
        flight_archive.observations_csv(bodies.context(), flight_id),
        observation_files.MEDIA_TYPE,
        f"flight-{flight_id}-measurements.csv",
    )


def _form(default: str, forms: Collection[str]) -> str:
    """Read which format is wanted; raises 422."""
    return bodies.query_choice("format", request.args.get("format", default), forms)


def _file(lines: Iterator[str], media_type: str, name: str) -> Response:
    """Answer a file that is written while it is sent."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(lines, content_type=media_type, headers=headers)


def _part() -> Page:
    """Read which part of a list is wanted; raises 422."""
    after_id = bodies.query_after()
    limit = bodies.query_limit()
    return Page(after_id, limit)


def check_flight(flight_id: int) -> None:
    """Check that a flight exists and that the key permits its vehicle; raises 403 or 404."""
    scopes.permitted(flight_archive.flight(bodies.context(), flight_id))
