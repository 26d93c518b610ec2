"""`/videos/`: the live picture of vehicles' cameras, as Motion JPEG."""

import time
from functools import partial
from typing import Any, Final

from flask import Blueprint, Response, current_app, g, request
from flask.typing import ResponseReturnValue

from edge_server.api import bodies, schemas, urls
from edge_server.api.access import auth, scopes
from edge_server.api.access.auth import PEOPLE, allow
from edge_server.api.contract import Contract, describe
from edge_server.api.routes.fleet.live import stream_head
from edge_server.connections.exchange import exchange_of
from edge_server.live.mjpeg import CONTENT_TYPE
from edge_server.live.video import Cameras, TooManyViewersError
from edge_server.services.errors import NotFoundError, TooMuchError

EXTENSION: Final = "edge_cameras"
NAMES: Final = ("videos", "video")


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("videos", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item="int64:vehicle_id")
    return routes


@allow(PEOPLE)
@describe(Contract({200: schemas.Video}, is_list=True))
def page() -> list[dict[str, Any]]:
    """List the vehicles whose live picture can be looked at, and how their cameras are."""
    cameras: Cameras = current_app.extensions[EXTENSION]
    return [
        {
            "vehicle_id": one.vehicle_id,
            "url": urls.path_of("videos.get", vehicle_id=one.vehicle_id),
            "state": one.state.value,
            "reason": one.reason,
        }
        for one in cameras.listing()
        if scopes.permits([one.vehicle_id])
    ]


@allow(PEOPLE)
@describe(Contract({200: None}, other_answers=("multipart/x-mixed-replace",), errors=(404, 429)))
def get(vehicle_id: int) -> ResponseReturnValue:
    """Stream the pictures of a vehicle's camera, five a second at most, the newest each time.

    The answer ends with the session of its viewer, and when no picture comes for 20 s; the listing
    then has the reason. It costs the camera one connection, however many look.
    """
    scopes.check(vehicle_id)
    cameras: Cameras = current_app.extensions[EXTENSION]
    is_admitted = partial(auth.key_ring().is_active, g.key, bodies.context().clock)
    try:
        stream = cameras.view(vehicle_id, is_admitted, time.monotonic())
    except TooManyViewersError as error:
        raise TooMuchError(str(error)) from error
    if stream is None:
        raise NotFoundError(f"vehicle {vehicle_id} has no live picture: VIDEO_STREAMS names none")
    exchange = exchange_of(request.environ)
    if exchange is not None:
        exchange.begin_stream(stream_head(CONTENT_TYPE), stream)
        return ""
    # Another WSGI server: one picture, if there is one
    return Response(stream.take(time.monotonic()) or b"", content_type=CONTENT_TYPE)
