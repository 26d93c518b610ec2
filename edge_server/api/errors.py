"""Error answers, all of one shape: message, faulty fields by path, AFarCloud's codes if any.

`{"message": ..., "detail": {"json": {path: [fault, ...]}}, "errors": [{code, name, path}],
"request_id": ...}`. An error never echoes the request, nor shows internals of the server.
"""

import logging
from collections.abc import Iterable
from typing import Any, Final

from flask import Flask, current_app, g
from flask.typing import ResponseReturnValue
from gunicorn.http.errors import (  # type: ignore[import-untyped]  # it has no types
    ParseException,
)
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from werkzeug.exceptions import HTTPException

from afarcloud.faults import DocumentError, Fault, SyntaxFaultError
from edge_server.services.errors import (
    ChangedError,
    ConflictError,
    FullError,
    KeyReusedError,
    NotFoundError,
    ServiceError,
    SpentError,
    TooLargeError,
    TooMuchError,
    UnavailableError,
)
from edge_server.store.connection.failures import is_busy, is_full, is_lost
from edge_server.store.files.integrity import is_broken, note_fault

LOG = logging.getLogger(__name__)

STATUS: Final[dict[type[ServiceError], int]] = {
    NotFoundError: 404,
    ConflictError: 409,
    TooMuchError: 429,
    KeyReusedError: 422,
    ChangedError: 412,
    TooLargeError: 413,
    FullError: 507,
    SpentError: 403,
    UnavailableError: 503,
}
RETRY_SOON: Final = {"Retry-After": "1"}


class RequestError(Exception):
    """A request that is refused before it reaches a service.

    `status` is the HTTP status; `where` is the part of the request with the faults: query, json,
    form or header.
    """

    def __init__(
        self, status: int, message: str, faults: tuple[Fault, ...] = (), where: str = "query"
    ) -> None:
        super().__init__(message)
        self.status = status
        self.faults = faults
        self.where = where


def body(message: str, faults: Iterable[Fault] = (), where: str = "json") -> dict[str, Any]:
    """Make the body of an error answer."""
    shape: dict[str, Any] = {"message": message, "detail": {}}
    paths: dict[str, list[str]] = {}
    codes = []
    for fault in faults:
        paths.setdefault(fault.path, []).append(fault.message)
        if fault.code is not None:
            codes.append({"code": fault.code, "name": fault.name, "path": fault.path})
    if paths:
        shape["detail"] = {where: paths}
    if codes:
        shape["errors"] = codes
    return shape


def install(app: Flask) -> None:
    """Register the handlers of all errors."""
    app.register_error_handler(DocumentError, _document)
    app.register_error_handler(ServiceError, _service)
    app.register_error_handler(RequestError, _request)
    app.register_error_handler(ParseException, _invalid_http)
    app.register_error_handler(DBAPIError, _database)
    app.register_error_handler(PoolTimeoutError, _overloaded)
    app.register_error_handler(HTTPException, _werkzeug)
    app.register_error_handler(500, _unexpected)


def _answer(message: str, faults: Iterable[Fault] = (), where: str = "json") -> dict[str, Any]:
    """Make the body of an error answer with the request's id, which the log has too."""
    return body(message, faults, where) | {"request_id": g.get("request_id", "")}


def _werkzeug(error: HTTPException) -> ResponseReturnValue:
    if error.response is not None:
        return error.response
    status = error.code or 500
    headers = {name: value for name, value in error.get_headers() if name.lower() != "content-type"}
    return _answer(_SENTENCES.get(status) or error.description or error.name), status, headers


_SENTENCES: Final = {
    400: "the request cannot be understood",
    404: "there is nothing at this path",
    405: "this path does not support this method",
    413: "the body is too large",
    500: "internal error; the edge server's log has the details",
}


def _document(error: DocumentError) -> ResponseReturnValue:
    broken = isinstance(error, SyntaxFaultError)
    message = "the body is not JSON" if broken else "the document cannot be used"
    return _answer(message, error.faults), 400 if broken else 422


def _service(error: ServiceError) -> ResponseReturnValue:
    headers = RETRY_SOON if isinstance(error, TooMuchError | UnavailableError) else {}
    answer = _answer(str(error), error.faults)
    if isinstance(error, ChangedError) and error.last is not None:
        answer["changed"] = error.last._asdict()
    return answer, STATUS[type(error)], headers


def _request(error: RequestError) -> ResponseReturnValue:
    return _answer(str(error), error.faults, where=error.where), error.status


def _invalid_http(error: Exception) -> ResponseReturnValue:
    """Answer a body that gunicorn's parser refuses while the application reads it."""
    LOG.warning("the body of a request is not valid HTTP (%s)", type(error).__name__)
    return _answer(_SENTENCES[400]), 400


def _database(error: DBAPIError) -> ResponseReturnValue:
    if is_broken(error):
        LOG.critical("the database is broken: %s", error.orig)
        note_fault(current_app.extensions["edge_context"].config.database_path, str(error.orig))
        return _answer("the database is broken and is being replaced"), 503, RETRY_SOON
    if is_full(error):
        LOG.error("the disk is full or cannot be written: %s", error.orig)
        return _answer("the disk is full or cannot be written; nothing was stored"), 507
    if is_lost(error):
        LOG.error("the database does not answer: %s", error.orig)
        return _answer("the database does not answer; try again"), 503, RETRY_SOON
    if is_busy(error):
        return _overloaded(error)
    return _unexpected(error)


def _overloaded(_error: Exception) -> ResponseReturnValue:
    return _answer("the database is busy; try again"), 503, RETRY_SOON


def _unexpected(error: Exception) -> ResponseReturnValue:
    if getattr(error, "original_exception", None) is None:  # Else Flask has logged it
        LOG.error("unexpected error", exc_info=error)
    return _answer(_SENTENCES[500]), 500
