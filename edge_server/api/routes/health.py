"""`/healthz`: liveness; `/readyz`: readiness. No key needed."""

from typing import Any

from flask import Blueprint
from flask.typing import ResponseReturnValue
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from edge_server import relay_health
from edge_server.api import bodies, schemas, urls
from edge_server.api.access.auth import PUBLIC, allow
from edge_server.api.contract import Contract, describe


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("health", __name__)
    urls.add(routes, ("healthz",), "healthz", healthz, "GET")
    urls.add(routes, ("readyz",), "readyz", readyz, "GET")
    return routes


@allow(PUBLIC)
@describe(Contract({200: schemas.Health}))
def healthz() -> dict[str, Any]:
    """Report that the process is alive, and the state of the database."""
    return {"status": "ok", "database": "ok" if _database_answers() else "unavailable"}


@allow(PUBLIC)
@describe(Contract({200: schemas.Health, 503: schemas.Health}))
def readyz() -> ResponseReturnValue:
    """Report whether requests can be served, and the state of the relay; 503 while shutting down.

    Without a relay nothing reaches the cloud, but reports, plans and aborts are served: 200.
    """
    relay = relay_health.read(bodies.context().config)
    uplink = {"uplink": relay.uplink.name.lower(), "relay_deaths": relay.deaths}
    if bodies.context().work_signal.closed:
        return {"status": "stopping", "database": "ok", **uplink}, 503
    if _database_answers():
        return {"status": "ready", "database": "ok", **uplink}, 200
    return {"status": "not ready", "database": "unavailable", **uplink}, 503


def _database_answers() -> bool:
    try:
        with bodies.context().database.read() as connection:
            connection.execute(text("SELECT count(*) FROM alembic_version")).scalar_one()
    except SQLAlchemyError:
        return False
    return True
