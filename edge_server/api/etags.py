"""`ETag`, `If-Match` and `If-None-Match`: nobody overwrites what he has not seen (RFC 9110, 8.8).

A tag is the hash of what a GET shows, live status included: a plan that has begun to fly since
the caller looked is another plan.
"""

import hashlib
from typing import Any

from flask import make_response, request
from flask.typing import ResponseReturnValue
from werkzeug.datastructures import ETags

from edge_server.services.errors import ChangedError
from edge_server.store.database import to_json

_LENGTH = 32
FORMS = ("geojson",)
"""Other forms than our own JSON; a tag of any form is good for a change."""


def tag_of(shown: dict[str, Any]) -> str:
    """Tag a thing as it is shown; "" for one that is not there."""
    return hashlib.sha256(to_json(shown).encode()).hexdigest()[:_LENGTH] if shown else ""


def tagged(shown: dict[str, Any], status: int = 200, form: str = "") -> ResponseReturnValue:
    """Answer with a thing and its tag; 304 without a body when the caller has it already.

    A `form` other than our own JSON has tags of its own: they stand for other bytes.
    """
    tag = tag_of(shown) + (f"-{form}" if form else "")
    if request.method == "GET" and request.if_none_match.contains(tag):
        response = make_response("", 304)
    else:
        response = make_response(shown, status)
    response.set_etag(tag)
    return response


def check_match(shown: dict[str, Any]) -> None:
    """Hold a thing against the request's `If-Match`; raises ChangedError."""
    wanted: ETags = request.if_match
    if not wanted:
        return
    tag = tag_of(shown)
    tags = [tag, *(f"{tag}-{form}" for form in FORMS)]
    if not shown or not (wanted.star_tag or any(one in wanted for one in tags)):
        raise ChangedError("it has changed since it was read; read it again")
