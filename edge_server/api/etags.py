"""`ETag`, `If-Match` and `If-None-Match`: no lost updates (RFC 9110 section 8.8).

A tag is the hash of the representation, live status included: it changes when a mission of the plan
starts.
"""

import hashlib
from typing import Any

from flask import make_response, request
from flask.typing import ResponseReturnValue
from werkzeug.datastructures import ETags

from edge_server.services.errors import ChangedError
from edge_server.store.connection.database import to_json

_LENGTH = 32
FORMS = ("geojson",)
"""Representations other than JSON; `If-Match` accepts the tag of any of them."""


def tag_of(shown: dict[str, Any]) -> str:
    """Make the tag of a representation; "" if the resource does not exist."""
    return hashlib.sha256(to_json(shown).encode()).hexdigest()[:_LENGTH] if shown else ""


def tagged(shown: dict[str, Any], status: int = 200, form: str = "") -> ResponseReturnValue:
    """Answer with a representation and its tag; 304 without a body if the caller has it.

    A `form` other than JSON has other tags, since its bytes differ.
    """
    tag = tag_of(shown) + (f"-{form}" if form else "")
    if request.method == "GET" and request.if_none_match.contains(tag):
        response = make_response("", 304)
    else:
        response = make_response(shown, status)
    response.set_etag(tag)
    return response


def check_match(shown: dict[str, Any]) -> None:
    """Evaluate the request's `If-Match`; raises ChangedError if it does not hold."""
    wanted: ETags = request.if_match
    if not wanted:
        return
    tag = tag_of(shown)
    tags = [tag, *(f"{tag}-{form}" for form in FORMS)]
    if not shown or not (wanted.star_tag or any(one in wanted for one in tags)):
        raise ChangedError("the resource has changed since it was read; read it again")
