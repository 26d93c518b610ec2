"""Orders that may have lain unread for too long are not carried out: their sender has given up."""

from flask import request

from edge_server.connections.exchange import exchange_of
from edge_server.services.errors import ConflictError
from edge_server.services.fleet.events import LIFETIME_S


def waited_s() -> float:
    """How long the request may have waited in this process, or in its socket, to be read."""
    exchange = exchange_of(request.environ)
    return 0.0 if exchange is None else exchange.waited_s


def check() -> None:
    """Refuse an order that may be older than an event is valid.

    Raises:
        ConflictError: if it is.
    """
    seconds = waited_s()
    if seconds > LIFETIME_S:
        raise ConflictError(
            f"the edge server stood still, and this may have waited for {seconds:.0f} s: it is not "
            "carried out; look what the vehicle does, and send it again"
        )
