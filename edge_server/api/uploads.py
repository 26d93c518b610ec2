"""Uploaded files: as the body of a request, or as the one file of a form."""

import codecs
from collections.abc import Collection
from typing import Any, Final, NamedTuple

from flask import request
from werkzeug.datastructures import FileStorage
from werkzeug.exceptions import BadRequest, RequestEntityTooLarge

from afarcloud.faults import Fault, InvalidError, SyntaxFaultError
from afarcloud.wire import parse_json
from edge_server.api import bodies
from edge_server.api.errors import RequestError

FORM: Final = "multipart/form-data"
UNSPECIFIED: Final = "application/octet-stream"
JSON: Final = "application/json"
_FORM_BYTES: Final = 16 * 1024
"""Allowance for the parts of a form around its file."""
_MOST_PARTS: Final = 20


class Upload(NamedTuple):
    """A file as received; `media_type` is UNSPECIFIED where the client named none."""

    raw: bytes
    media_type: str


def upload(media_types: Collection[str]) -> Upload:
    """Read the file of a request.

    Raises:
        RequestError: 413 for one that is too large, 415 for one of none of these types, 422 for
            a form that has not exactly one file.
    """
    if request.mimetype != FORM:
        if request.mimetype not in {*media_types, UNSPECIFIED}:
            known = ", ".join([*media_types, FORM])
            raise RequestError(415, f"the body must be one of: {known}")
        return Upload(bodies.raw_body(), request.mimetype)
    file = _only_file()
    raw = file.stream.read(bodies.MAXIMUM_BODY_BYTES + 1)
    if len(raw) > bodies.MAXIMUM_BODY_BYTES:
        raise _too_large()
    media_type = file.mimetype if file.mimetype in media_types else UNSPECIFIED
    return Upload(raw, media_type)


def parsed(upload: Upload, fault: str) -> Any:
    """Parse a file that must be JSON.

    Raises:
        SyntaxFaultError: if its media type is JSON and it is not.
        InvalidError: with the fault, if its media type does not say what it is, and it is not JSON.
    """
    text = upload.raw.removeprefix(codecs.BOM_UTF8)  # RFC 8259 section 8.1 lets a reader ignore it
    if upload.media_type.endswith("json"):
        return parse_json(text)
    try:
        return parse_json(text)
    except SyntaxFaultError:
        raise InvalidError((Fault("", fault),)) from None


def _only_file() -> FileStorage:
    request.max_content_length = bodies.MAXIMUM_BODY_BYTES + _FORM_BYTES
    request.max_form_memory_size = _FORM_BYTES
    request.max_form_parts = _MOST_PARTS
    try:
        files = [file for _, file in request.files.items(multi=True)]
    except RequestEntityTooLarge:
        raise _too_large() from None
    except (BadRequest, ValueError):
        fault = Fault("file", "cannot be read from the form")
        raise RequestError(422, "the form cannot be used", (fault,), where="form") from None
    if len(files) != 1:
        fault = Fault("file", f"must be present once, not {len(files)} times")
        raise RequestError(422, "the form cannot be used", (fault,), where="form")
    return files[0]


def _too_large() -> RequestError:
    fault = Fault("", f"must be at most {bodies.MAXIMUM_BODY_BYTES} bytes")
    return RequestError(413, "the body is too large", (fault,), where="json")
