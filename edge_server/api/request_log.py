"""Every request has an id, leaves one line in the log, and is counted.

A caller may bring an id (`X-Request-ID`); one that is no plain word is replaced by our own. The
line names method, path, status, time taken, role and sender; no query, no header, no body.
"""

import logging
import os
import re
import time
from collections.abc import Callable
from typing import Final
from urllib.parse import quote

from apiflask import APIFlask
from flask import Flask, Response, g, request

from edge_server.observability import logs
from edge_server.observability.metrics import Metrics

ACCESS: Final = logging.getLogger("edge_server.access")
HEADER: Final = "X-Request-ID"
_PLAIN: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_NOWHERE: Final = "(none)"
_BYTES_OF_OUR_OWN: Final = 8
_MOST_OF_A_PATH: Final = 200


def install(app: APIFlask, metrics: Metrics) -> None:
    """Give an app's requests ids, log lines and counts; before anything may refuse them."""
    route_of = _routes(app)

    def leave(response: Response) -> Response:
        return _leave(response, metrics, route_of())

    app.before_request(_enter)
    app.after_request(leave)
    app.teardown_request(_forget)


def request_id() -> str:
    """The id of the request that is being served."""
    found: str = g.request_id
    return found


def _enter() -> None:
    offered = request.headers.get(HEADER, "")
    plain = _PLAIN.fullmatch(offered) is not None
    g.request_id = offered if plain else os.urandom(_BYTES_OF_OUR_OWN).hex()
    g.began_at = time.perf_counter()
    logs.REQUEST_ID.set(g.request_id)


def _forget(_error: BaseException | None) -> None:
    logs.REQUEST_ID.set(None)


def _leave(response: Response, metrics: Metrics, route: str) -> Response:
    response.headers[HEADER] = g.request_id
    duration_s = time.perf_counter() - g.began_at
    method = request.method if request.method in _METHODS else "other"
    metrics.answered(method, route, response.status_code, duration_s)
    if response.status_code >= 400 and _brings_reports():
        metrics.rejected(response.status_code)
    refused: dict[int, int] = g.get("refused_records", {})  # Of a bulk, by status
    for status, records in refused.items():
        metrics.rejected(status, records)
    if ACCESS.isEnabledFor(logging.INFO):
        _write_line(response, method, duration_s)
    return response


def _write_line(response: Response, method: str, duration_s: float) -> None:
    path = quote(request.path[:_MOST_OF_A_PATH])
    ACCESS.info(
        "%s %s %d",
        method,
        path,
        response.status_code,
        extra={
            "method": method,
            "path": path,
            "status": response.status_code,
            "duration_ms": round(duration_s * 1e3, 2),
            "role": g.get("role"),
            "address": request.remote_addr,
        },
    )


def _brings_reports() -> bool:
    return request.method == "POST" and request.blueprint in {"telemetry", "bulk"}


def _routes(app: Flask) -> Callable[[], str]:
    """How to name the present route: by the first of its spellings, so that there are few."""
    names: dict[str, str] = {}

    def route_of() -> str:
        endpoint = request.endpoint
        if endpoint is None:
            return _NOWHERE
        if endpoint not in names:
            names[endpoint] = next(app.url_map.iter_rules(endpoint)).rule
        return names[endpoint]

    return route_of
