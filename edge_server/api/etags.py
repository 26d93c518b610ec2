"""`ETag`, `If-Match` and `If-None-Match`: no lost updates (RFC 9110 section 8.8); `Range`.

A tag is the hash of the representation, live status included: it changes when a mission of the plan
starts.
"""

import hashlib
from collections.abc import Callable, Iterator
from typing import Any

from flask import Response, make_response, request
from flask.typing import ResponseReturnValue
from werkzeug.datastructures import ETags, Range
from werkzeug.exceptions import RequestedRangeNotSatisfiable
from werkzeug.http import quote_etag

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
    """Evaluate the request's `If-Match`; raises ChangedError if it does not hold.

    One that names no tag, cut off perhaps, does not hold: its sender meant a certain version.
    """
    if "If-Match" not in request.headers:
        return
    wanted: ETags = request.if_match
    if not wanted:
        raise ChangedError("If-Match names no tag; send the ETag that was read")
    tag = tag_of(shown)
    tags = [tag, *(f"{tag}-{form}" for form in FORMS)]
    if not shown or not (wanted.star_tag or any(one in wanted for one in tags)):
        raise ChangedError("the resource has changed since it was read; read it again")


def file_part(
    tag: str, size_bytes: int, read: Callable[[int, int], Iterator[bytes]], media_type: str
) -> Response:
    """Answer with a file, or the range of its bytes that is asked for (RFC 9110 section 14).

    `read` gives the bytes from a first offset up to a last one, which is not included.

    Raises:
        RequestedRangeNotSatisfiable: if the file has no such bytes.
    """
    if request.if_none_match.contains(tag):
        answer = Response(status=304)
    elif (wanted := _wanted(tag)) is None:
        answer = Response(read(0, size_bytes), content_type=media_type)
        answer.content_length = size_bytes
    elif (part := _bytes_of(wanted, size_bytes)) is None:
        raise RequestedRangeNotSatisfiable(length=size_bytes)
    else:
        answer = Response(read(*part), 206, content_type=media_type)
        answer.content_length = part[1] - part[0]
        answer.content_range.set(*part, size_bytes)
    answer.set_etag(tag)
    answer.accept_ranges = "bytes"
    answer.headers["Cache-Control"] = "private, no-cache"
    return answer


def _wanted(tag: str) -> Range | None:
    """Read which part is wanted; several parts, and one of a former file, become the whole.

    `If-Range` names the file that a client has the beginning of; it is compared strongly, so that
    neither a weak tag nor a date matches (RFC 9110 section 13.1.5).
    """
    asked = request.range
    is_one = asked is not None and asked.units == "bytes" and len(asked.ranges) == 1
    is_same = request.headers.get("If-Range", quote_etag(tag)) == quote_etag(tag)
    return asked if is_one and is_same else None


def _bytes_of(wanted: Range, size_bytes: int) -> tuple[int, int] | None:
    """Return first and last byte, the latter not included; None if the file has none of them.

    The last bytes of a file that is shorter are the whole file (RFC 9110 section 14.1.2).
    """
    first, _ = wanted.ranges[0]
    if size_bytes and first < -size_bytes:
        return 0, size_bytes
    return wanted.range_for_length(size_bytes)
