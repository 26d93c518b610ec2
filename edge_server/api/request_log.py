"""Request ids, the access log and the request metrics.

A client may set `X-Request-ID`; an id of other than 1 to 64 plain characters is replaced. A log
line has method, path, status, duration, role and address; no query, no header, no body.
"""

import logging
import os
import re
import time
from collections.abc import Callable
from typing import Final
from urllib.parse import quote

from flask import Flask, Response, g, request

from edge_server import logs
from edge_server.api import urls
from edge_server.metrics import Metrics

ACCESS: Final = logging.getLogger("edge_server.access")
HEADER: Final = "X-Request-ID"
_PLAIN: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_NO_ROUTE: Final = "(none)"
_REQUEST_ID_BYTES: Final = 8
_MAXIMUM_PATH: Final = 200


def install(app: Flask, metrics: Metrics) -> None:
    """Install ids, log lines and metrics in an app; before any handler that refuses requests."""
    route_of = _routes(app)

    def end(response: Response) -> Response:
        return _end(response, metrics, route_of())

    app.before_request(_begin)
    app.after_request(end)
    app.teardown_request(_clear)


def _begin() -> None:
    offered = request.headers.get(HEADER, "")
    plain = _PLAIN.fullmatch(offered) is not None
    g.request_id = offered if plain else os.urandom(_REQUEST_ID_BYTES).hex()
    g.began_at = time.perf_counter()
    logs.REQUEST_ID.set(g.request_id)


def _clear(_error: BaseException | None) -> None:
    logs.REQUEST_ID.set(None)


def _end(response: Response, metrics: Metrics, route: str) -> Response:
    response.headers[HEADER] = g.request_id
    duration_s = time.perf_counter() - g.began_at
    method = request.method if request.method in _METHODS else "other"
    metrics.answered(method, route, response.status_code, duration_s)
    if response.status_code >= 400 and _posts_reports():
        metrics.rejected(response.status_code)
    refused: dict[int, int] = g.get("refused_records", {})  # In a bulk request, by status
    for status, records in refused.items():
        metrics.rejected(status, records)
    if ACCESS.isEnabledFor(logging.INFO):
        _write_line(response, method, duration_s)
    return response


def _write_line(response: Response, method: str, duration_s: float) -> None:
    path = quote(request.path[:_MAXIMUM_PATH])
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


def _posts_reports() -> bool:
    return request.method == "POST" and request.blueprint in {"telemetry", "bulk"}


def _routes(app: Flask) -> Callable[[], str]:
    """Make the label of the current route: its first spelling, to keep labels few."""
    names: dict[str, str] = {}

    def route_of() -> str:
        endpoint = request.endpoint
        if endpoint is None:
            return _NO_ROUTE
        if endpoint not in names:
            names[endpoint] = urls.canonical(next(app.url_map.iter_rules(endpoint)))
        return names[endpoint]

    return route_of
