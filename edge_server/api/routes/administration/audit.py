"""`/audit/`: the audit log as NDJSON, one row a line, from the oldest that is kept."""

import json
from collections.abc import Iterator
from typing import Final

from flask import Blueprint, Response

from edge_server.api import bodies, urls
from edge_server.api.access.auth import ADMIN, allow
from edge_server.api.contract import Contract, describe
from edge_server.services import audit
from edge_server.services.context import Context

NDJSON: Final = "application/x-ndjson"


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("audit", __name__)
    urls.add(routes, ("audit",), "export", export, "GET")
    return routes


@allow(ADMIN)
@describe(Contract({200: None}, query=("after", "since")))
def export() -> Response:
    """Export who did what; each row holds the hash of the one before it."""
    after_id = bodies.query_after()
    since_s = bodies.query_time("since")
    return Response(_lines(bodies.context(), after_id, since_s), content_type=NDJSON)


def _lines(context: Context, after_id: int, since_s: float) -> Iterator[str]:
    for row in audit.export(context.database, after_id, since_s):
        yield json.dumps(row, ensure_ascii=False) + "\n"
