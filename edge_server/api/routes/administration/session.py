"""`/session/`: people sign in with name and password, or by a link, and sign out.

The answer sets the session's secret as a cookie that no script reads. Its `csrf_token` goes into
the header X-CSRF-Token of every write of the session.
"""

import math
from typing import Any, Final

from flask import Blueprint, Response, current_app, g, jsonify, request
from flask.typing import ResponseReturnValue
from werkzeug.exceptions import Unauthorized

from edge_server.api import bodies, schemas, urls
from edge_server.api.access import audit_trail, auth
from edge_server.api.access.auth import PUBLIC, READERS, allow, audit
from edge_server.api.access.limits import Limits
from edge_server.api.contract import Contract, describe
from edge_server.services.administration import accounts
from edge_server.services.administration.accounts import SignIn
from edge_server.services.context import show_time
from edge_server.services.errors import ConflictError
from edge_server.store.rows.keys import StoredKey

NAMES: Final = ("session",)
LIMITS: Final = "edge_limits"
EXAMPLE: Final = {"name": "maria", "password": "nine words are better than one"}
_HOUR_S: Final = 3600.0
_BY_LINK: Final = "link"
_REFUSED: Final = "wrong name or password, or the account is disabled"
_LINK_REFUSED: Final = "this link was used already, or it has expired: ask for a new one"


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("session", __name__)
    urls.add(routes, NAMES, "create", sign_in, "POST")
    urls.add(routes, NAMES, "get", get, "GET")
    urls.add(routes, NAMES, "end", sign_out, "DELETE")
    return routes


@allow(PUBLIC)
@describe(Contract({201: schemas.PresentSession}, body=SignIn, errors=(401, 429), example=EXAMPLE))
def sign_in() -> ResponseReturnValue:
    """Begin a session; a wrong password and an unknown name have the same answer."""
    limits: Limits = current_app.extensions[LIMITS]
    wanted = bodies.model(SignIn)
    limits.count_sign_in(wanted.name, request.remote_addr)
    context = bodies.context()
    now = context.clock()
    audit_trail.begin(context, StoredKey("", "", b"", f"user/{wanted.name or _BY_LINK}"))
    valid_s = context.config.session_hours * _HOUR_S
    begun = accounts.sign_in(context.database, wanted, now, valid_s, request.remote_addr or "")
    if begun is None:
        raise Unauthorized(_REFUSED if wanted.link is None else _LINK_REFUSED)
    person, session, secret = begun
    limits.note_sign_in(person.name, request.remote_addr)
    auth.key_ring().invalidate()
    answer: Response = jsonify(
        {
            "name": person.name,
            "role": person.role,
            "csrf_token": auth.token_of_session(secret),
            "expires_at": show_time(session.expires_at),
        }
    )
    _set_cookie(answer, secret, math.floor(valid_s))
    return answer, 201


@allow(READERS)
@describe(Contract({200: schemas.PresentSession}))
def get() -> dict[str, Any]:
    """Give who the caller is; a key has no `csrf_token`, because its requests need none."""
    key: StoredKey = g.key
    return {
        "name": key.name.removeprefix("user/"),
        "role": key.role,
        "csrf_token": auth.csrf_token(),
        "expires_at": None if key.expires_at is None else show_time(key.expires_at),
    }


@allow(READERS)
@describe(Contract({204: None}, errors=(409,)))
def sign_out() -> ResponseReturnValue:
    """End the caller's session."""
    if not auth.is_session():
        raise ConflictError("this request has a key and no session")
    key: StoredKey = g.key
    accounts.end_session(bodies.context().database, key.prefix)
    auth.key_ring().invalidate()
    audit("signed out")
    answer = current_app.response_class(status=204)
    _set_cookie(answer, "", 0)
    return answer


def _set_cookie(answer: Response, secret: str, valid_s: int) -> None:
    is_tls = bodies.context().config.tls_certificate_file is not None
    answer.set_cookie(
        auth.COOKIE, secret, max_age=valid_s, httponly=True, samesite="Strict", secure=is_tls
    )
