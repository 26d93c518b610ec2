"""`/maps/`: maps of the farm from the maps folder, below everything that the console draws."""

from typing import Any, Final
from urllib.parse import quote

from flask import Blueprint, Response, request

from edge_server.api import bodies, etags, schemas, urls
from edge_server.api.access.auth import PEOPLE, allow
from edge_server.api.contract import Contract, describe
from edge_server.services import farm_maps

NAMES: Final = ("maps", "map")
ITEM: Final = "string(maxlength=200):file_name"
MEDIA_TYPE: Final = "application/octet-stream"


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("maps", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "tiles", tiles, "GET", item=ITEM)
    urls.add(routes, NAMES, "picture", picture, "GET", item=ITEM, action="picture")
    return routes


@allow(PEOPLE)
@describe(Contract({200: schemas.FarmMap}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List the maps of the farm; one that cannot be shown has a fault in place of an address."""
    maps = farm_maps.listing(bodies.context())
    return [one | {"url": one["url"] and quote(one["url"])} for one in maps]


@allow(PEOPLE)
@describe(Contract({200: None, 206: None}, conditional=True, errors=(416,)))
def tiles(file_name: str) -> Response:
    """Give a PMTiles archive, or the range of its bytes that is asked for."""
    found = farm_maps.tiles(bodies.context(), file_name)
    return etags.file_part(found.tag, found.size_bytes, found.read, MEDIA_TYPE)


@allow(PEOPLE)
@describe(Contract({200: None}, conditional=True, errors=(429,)))
def picture(file_name: str) -> Response:
    """Give the picture of a GeoTIFF as a WebP between its corners; 404 if it cannot be shown."""
    context = bodies.context()
    found = farm_maps.orthophoto(context, file_name)
    if request.if_none_match.contains(found.tag):
        answer = Response(status=304)
    else:
        small = farm_maps.orthophoto_picture(context, found)
        answer = Response(small, content_type="image/webp")
    answer.set_etag(found.tag)
    answer.headers["Cache-Control"] = "private, no-cache"
    return answer
