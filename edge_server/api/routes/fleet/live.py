"""`/live/`: what changes on the farm, as server-sent events."""

from functools import partial
from typing import Final

from flask import Blueprint, Response, current_app, g, request
from flask.typing import ResponseReturnValue

from edge_server.api import bodies, urls
from edge_server.api.access import auth, scopes
from edge_server.api.access.auth import READERS, allow
from edge_server.api.contract import Contract, describe
from edge_server.api.headers import HEADERS
from edge_server.connections.exchange import exchange_of
from edge_server.live.changes import Changes
from edge_server.live.stream import LiveStream
from edge_server.live.watcher import Watcher
from edge_server.services.errors import TooMuchError
from edge_server.store.rows.keys import StoredKey

EXTENSION: Final = "edge_live"
MEDIA_TYPE: Final = "text/event-stream"
FIRST_STATE_WITHIN_S: Final = 5.0


def stream_head(content_type: str) -> bytes:
    """Encode the head of an answer without an end."""
    lines = (
        "HTTP/1.1 200 OK",
        "Connection: close",
        f"Content-Type: {content_type}",
        *(f"{name}: {value}" for name, value in HEADERS.items()),
        "",
    )
    return "".join(f"{line}\r\n" for line in lines).encode()


class Live:
    """The changes and their watcher of one app."""

    def __init__(self, changes: Changes, watcher: Watcher) -> None:
        self.changes = changes
        self.watcher = watcher


def is_watched() -> bool:
    """Whether somebody watches the farm now."""
    live: Live | None = current_app.extensions.get(EXTENSION)
    return live is not None and live.watcher.is_watched


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("live", __name__)
    urls.add(routes, ("live",), "get", get, "GET")
    return routes


@allow(READERS)
@describe(Contract({200: None}, other_answers=(MEDIA_TYPE,), errors=(429,)))
def get() -> ResponseReturnValue:
    """Stream changes: `snapshot` with the complete state first, then each change by itself.

    A reader that sends `Last-Event-ID` continues after that event if it is still stored. A comment
    is sent every 4 s. The stream ends with the key or session of its reader, and when the reader
    does not keep up.
    """
    live: Live = current_app.extensions[EXTENSION]
    key: StoredKey = g.key
    exchange = exchange_of(request.environ)
    if exchange is None:  # Another WSGI server: the reader connects again and again
        live.watcher.look()
    else:
        live.watcher.note_reader()
        if not live.watcher.wait_for_first(FIRST_STATE_WITHIN_S):
            raise TooMuchError("the database does not answer in time; try again")
    stream = LiveStream(
        live.changes,
        live.watcher.state,
        vehicle_ids=scopes.vehicles(),
        last_id=request.headers.get("Last-Event-ID", ""),
        is_admitted=partial(auth.key_ring().is_active, key, bodies.context().clock),
        note_reader=(lambda: None) if exchange is None else live.watcher.note_reader,
    )
    if exchange is not None:
        exchange.begin_stream(stream_head(f"{MEDIA_TYPE}; charset=utf-8"), stream)
        return ""
    return Response(stream.take(0.0) or b"", content_type=MEDIA_TYPE)
