"""`/storage`: the version, and what stores, budgets and disk hold."""

from typing import Any

from flask import Blueprint

from edge_server.api import bodies, schemas, urls
from edge_server.api.access.auth import ADMIN, allow
from edge_server.api.contract import Contract, describe
from edge_server.services.administration import storage


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("storage", __name__)
    urls.add(routes, ("storage",), "storage", show, "GET")
    return routes


@allow(ADMIN)
@describe(Contract({200: schemas.Storage}))
def show() -> dict[str, Any]:
    """Show what is stored, and the room that budgets and disk leave."""
    return storage.overview(bodies.context())
