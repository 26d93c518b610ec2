"""Input of requests: JSON bodies of bounded size and depth, and query parameters."""

import re
from collections.abc import Collection
from datetime import datetime
from typing import Any, Final, TypeVar

from flask import current_app, request
from werkzeug.exceptions import RequestEntityTooLarge

from afarcloud import wire
from afarcloud.faults import Fault, SyntaxFaultError
from afarcloud.numbers import INT32_MAX, Model
from afarcloud.wire import Kind
from edge_server.api.errors import RequestError
from edge_server.services.context import Context

MAXIMUM_BODY_BYTES: Final = 1024 * 1024
MAXIMUM_DEPTH: Final = 20
_NESTING: Final = (dict, list)
MAXIMUM_IMAGE_BODY_BYTES: Final = 3 * 512 * 1024  # A 1 MiB frame in base64, and its fields
OCTETS: Final = "application/octet-stream"
_CHARSET: Final = re.compile(r";\s*charset\s*=[\s\"']*([^\s\"';]*)")
"""Also where it is not written as in RFC 9110 section 8.3: in single quotes, or behind a blank."""
_UTF_8: Final = frozenset({"", "utf-8", "utf8", "utf_8", "us-ascii", "ascii"})
"""Names of charsets whose texts are UTF-8 too."""
_FLAGS: Final[dict[str | None, bool]] = {None: False, "true": True, "false": False}
_WHOLE: Final = re.compile(r"([0-9]{1,19})(?:\.0+)?")  # 5.0 is an integer, as in a body
_NUMBER: Final = re.compile(r"[0-9]{1,400}(\.[0-9]{1,400})?([eE][+-]?[0-9]{1,3})?")
_LATEST_S: Final = 1e11  # Epoch seconds; the year 5138
_LARGEST_ID: Final = 2**63 - 1
_PAGE_DEFAULT: Final = 100
_PAGE_LIMIT: Final = 1000

_Model = TypeVar("_Model", bound=Model)


def context() -> Context:
    """Give the context of the services of this app."""
    found: Context = current_app.extensions["edge_context"]
    return found


def extension(name: str) -> Any:
    """Give an extension of this app by name; None if there is none."""
    return current_app.extensions.get(name)


def refuse_encoded() -> None:
    """Refuse a compressed body; raises 415 (RFC 9110 section 8.4)."""
    if request.headers.get("Content-Encoding", "identity").strip().lower() not in {"", "identity"}:
        raise RequestError(415, "the body must not be compressed: no Content-Encoding is accepted")


def refuse_other_charset() -> None:
    """Refuse JSON that is said to be in another charset than UTF-8; raises 415 (RFC 8259, 8.1).

    Read as UTF-8 it would be taken for something else, or refused for a wrong reason.
    """
    charsets = _CHARSET.findall(request.headers.get("Content-Type", "").lower())
    if request.is_json and not _UTF_8.issuperset(charsets):
        raise RequestError(415, "the body must be in UTF-8, as JSON is")


def refuse_repeated_parameters() -> None:
    """Refuse a query that gives a parameter twice, of which one would be ignored; raises 422."""
    faults = tuple(
        Fault(name, "must be given once")
        for name, values in request.args.lists()
        if len(values) > 1
    )
    if faults:
        raise RequestError(422, "the query cannot be used", faults)


def json_body(limit: int = MAXIMUM_BODY_BYTES) -> Any:
    """Read and parse the body; raises 413 or 415, or SyntaxFaultError."""
    if not request.is_json:
        raise RequestError(415, "the body must be application/json")
    parsed = wire.parse_json(raw_body(limit))
    if not _nests_within(parsed, MAXIMUM_DEPTH):
        raise SyntaxFaultError((Fault("", f"nests deeper than {MAXIMUM_DEPTH}"),))
    return parsed


def _nests_within(value: Any, levels: int) -> bool:
    """Whether a value nests at most so many levels deep."""
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, list):
        return True
    return levels > 0 and all(
        _nests_within(one, levels - 1) for one in value if one.__class__ in _NESTING
    )


def raw_body(limit: int = MAXIMUM_BODY_BYTES, *, keep: bool = False) -> bytes:
    """Read the body; raises 413 beyond the limit, also for one in chunks, which names no length.

    It can be read again only with `keep`.
    """
    request.max_content_length = limit + 1
    too_long = Fault("", f"must be at most {limit} bytes")
    too_large = RequestError(413, "the body is too large", (too_long,), where="json")
    try:
        raw = request.get_data(cache=keep)
    except RequestEntityTooLarge:
        raise too_large from None
    if len(raw) > limit:
        raise too_large
    return raw


def octets() -> bytes:
    """Read a body that is a part of a file; raises 413 or 415."""
    if request.mimetype != OCTETS:
        raise RequestError(415, f"the body must be {OCTETS}")
    return raw_body()


def document(kind: Kind, model: type[_Model]) -> _Model:
    """Read a document of this kind, with or without its envelope; raises DocumentError.

    `model` is the type of the kind, or a base of it.
    """
    limit = MAXIMUM_IMAGE_BODY_BYTES if kind is Kind.IMAGE else MAXIMUM_BODY_BYTES
    read = wire.read(kind, json_body(limit))
    if not isinstance(read, model):
        raise TypeError(type(read))
    return read


def model(kind: type[_Model]) -> _Model:
    """Read a body that AFarCloud does not define; raises DocumentError."""
    return wire.read_as(kind, json_body())


def query_number(name: str, default: float, low: float, high: float) -> float:
    """Read a number from the query; raises 422 with its name."""
    raw = request.args.get(name)
    if raw is None:
        return default
    try:
        number = float(raw)
    except ValueError:
        number = float("nan")
    if not low <= number <= high:
        message = f"must be a number from {low:g} to {high:g}"
        raise RequestError(422, "the query cannot be used", (Fault(name, message),))
    return number


def query_integer(name: str, default: int | None, low: int, high: int) -> int:
    """Read a whole number from the query, which must be given without a default; raises 422."""
    raw = request.args.get(name, "" if default is None else None)
    if raw is None and default is not None:
        return default
    whole = _WHOLE.fullmatch(raw or "")
    if whole is None or not low <= int(whole[1]) <= high:
        message = f"must be a whole number from {low} to {high}"
        raise RequestError(422, "the query cannot be used", (Fault(name, message),))
    return int(whole[1])


def query_after() -> int:
    """Read `after` from the query, the id behind which a list begins; raises 422."""
    return query_integer("after", 0, 0, _LARGEST_ID)


def query_limit() -> int:
    """Read `limit` from the query, how many items a list has at most; raises 422."""
    return query_integer("limit", _PAGE_DEFAULT, 1, _PAGE_LIMIT)


def query_boolean(name: str) -> bool:
    """Read true or false from the query, false when it is not given; raises 422 with its name."""
    raw = request.args.get(name)
    if raw not in _FLAGS:
        fault = Fault(name, "must be true or false")
        raise RequestError(422, "the query cannot be used", (fault,))
    return _FLAGS[raw]


def query_choice(name: str, given: str, choices: Collection[str]) -> str:
    """Check that what the query gives is one of the choices; raises 422 with its name."""
    if given not in choices:
        fault = Fault(name, f"must be one of {', '.join(choices)}")
        raise RequestError(422, "the query cannot be used", (fault,))
    return given


def query_vehicle() -> int | None:
    """Read `vehicle_id` from the query; None without one: all vehicles."""
    return query_integer("vehicle_id", 0, 1, INT32_MAX) or None


def query_time(name: str) -> float:
    """Read an RFC 3339 time or epoch seconds [s]; 0 when it is not given; raises 422."""
    raw = request.args.get(name)
    if raw is None:
        return 0.0
    try:
        seconds = _epoch(raw) if _NUMBER.fullmatch(raw) else _rfc3339(raw)
    except ValueError:
        message = "must be a time such as 2026-11-21T08:00:00Z, or epoch seconds"
        raise RequestError(422, "the query cannot be used", (Fault(name, message),)) from None
    return seconds


def _epoch(raw: str) -> float:
    seconds = float(raw)
    if seconds > _LATEST_S:
        raise ValueError(raw)
    return seconds


def _rfc3339(raw: str) -> float:
    moment = datetime.fromisoformat(raw.replace(" ", "+"))  # A plus that was not escaped
    if moment.tzinfo is None:
        raise ValueError(raw)
    return moment.timestamp()
