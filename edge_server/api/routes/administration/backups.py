"""`/backups/`: copies of the database on the edge server's disk, for admins."""

from typing import Any, Final

from flask import Blueprint
from flask.typing import ResponseReturnValue

from edge_server.api import bodies, schemas, urls
from edge_server.api.access.auth import ADMIN, allow, audit, refuse_restricted
from edge_server.api.contract import Contract, describe
from edge_server.services.administration import backups

NAMES: Final = ("backups", "backup")


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("backups", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "create", create, "POST")
    return routes


@allow(ADMIN)
@describe(Contract({200: schemas.Backups}))
def page() -> dict[str, Any]:
    """List the backups, the newest first, and the folder that they are in."""
    refuse_restricted("backups")
    return backups.overview(bodies.context())


@allow(ADMIN)
@describe(Contract({201: schemas.Backup}, errors=(409, 429, 503, 507)))
def create() -> ResponseReturnValue:
    """Make a backup now, while the database is in use; the oldest beyond 14 is deleted."""
    refuse_restricted("backups")
    made = backups.make(bodies.context())
    audit(f"made backup {made['name']}")
    return made, 201
