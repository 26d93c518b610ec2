"""Signatures of the cloud's writes, in the header `X-JWS-Signature` (edge_server.api.access.jws).

Checked before every write under `/plans/` and `/events/`, whatever the route, once the caller is
authenticated. The transaction of the write also marks the signature as used.
"""

from typing import Final, Protocol

from flask import g, request
from werkzeug.datastructures import WWWAuthenticate
from werkzeug.exceptions import Forbidden, Unauthorized

from edge_server.api import bodies
from edge_server.api.access import audit_trail
from edge_server.api.access.scopes import SAFE_METHODS
from edge_server.services.audit import Token
from edge_server.store.rows.keys import Role

HEADER: Final = "X-JWS-Signature"
SIGNED: Final = frozenset({"plans", "events"})
"""Blueprints whose writes the cloud must sign; other roles may."""
EXTENSION: Final = "edge_cloud_signatures"


class Signatures(Protocol):
    """Verifier of signatures."""

    def check(self, signature: str, body: bytes, path: str, now: float) -> Token:
        """Verify the signature of a body; raises 401, 403 or 422."""


def check_request() -> None:
    """Verify the signature of a write; raises 401, 403 or 422.

    Call it after authentication. Other roles need no signature, but one that is present must be
    valid.
    """
    if request.method in SAFE_METHODS or request.blueprint not in SIGNED:
        return
    signatures: Signatures | None = bodies.extension(EXTENSION)
    signature = request.headers.get(HEADER)
    if signatures is None:
        if g.role == Role.CLOUD:
            raise Forbidden("the cloud may not write here: CLOUD_JWS_KEY_FILE is not set")
        return
    if signature is None:
        if g.role == Role.CLOUD:
            raise invalid_signature(f"a write of the cloud must be signed in the header {HEADER}")
        return
    body = bodies.raw_body(keep=True)
    token = signatures.check(signature, body, request.path.rstrip("/"), bodies.context().clock())
    if (trail := audit_trail.current()) is not None:
        trail.token = token


def invalid_signature(reason: str) -> Unauthorized:
    """Make the 401 for a missing or invalid signature."""
    challenge = WWWAuthenticate("bearer", {"realm": "edge server", "error": "invalid_request"})
    return Unauthorized(reason, www_authenticate=challenge)
