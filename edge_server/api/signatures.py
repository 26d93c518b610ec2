"""What the cloud writes is signed, in the header `X-JWS-Signature` (edge_server.api.jws).

Every write under `/plans/` and `/events/` asks here, once the caller is known: a route of these
blueprints cannot forget it. A signature is used up in the transaction that it has let through.
"""

from typing import Final, Protocol

from flask import g, request
from werkzeug.datastructures import WWWAuthenticate
from werkzeug.exceptions import Forbidden, Unauthorized

from edge_server.api import bodies, trails
from edge_server.api.scopes import SAFE_METHODS
from edge_server.services.audit import Token
from edge_server.store.keys import Role

HEADER: Final = "X-JWS-Signature"
SIGNED: Final = frozenset({"plans", "events"})
"""Blueprints whose writes the cloud must sign, and anybody may."""
EXTENSION: Final = "edge_cloud_signatures"


class Signatures(Protocol):
    """Who can check a signature."""

    def check(self, shown: str, body: bytes, path: str, now: float) -> Token:
        """Check a signature of a body; raises 401, 403 or 422."""


def check_request() -> None:
    """Hold what the cloud writes against its signature; raises 401, 403 or 422.

    Call it when the caller is known. Others need no signature, but one that is there must be good.
    """
    if request.method in SAFE_METHODS or request.blueprint not in SIGNED:
        return
    signatures: Signatures | None = bodies.extension(EXTENSION)
    shown = request.headers.get(HEADER)
    if signatures is None:
        if g.role == Role.CLOUD:
            raise Forbidden("the cloud may not write here: CLOUD_JWS_KEY_FILE is not set")
        return
    if shown is None:
        if g.role == Role.CLOUD:
            raise unsigned(f"what the cloud writes must be signed: {HEADER}")
        return
    body = bodies.raw_body(keep=True)
    token = signatures.check(shown, body, request.path.rstrip("/"), bodies.context().clock())
    if (trail := trails.current()) is not None:
        trail.token = token


def unsigned(reason: str) -> Unauthorized:
    """Make the 401 for what bears no good signature."""
    challenge = WWWAuthenticate("bearer", {"realm": "edge server", "error": "invalid_request"})
    return Unauthorized(reason, www_authenticate=challenge)
