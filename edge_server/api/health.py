"""`/healthz`: does the process answer; `/readyz`: can it do its work. No key needed."""

from typing import Any

from apiflask import APIBlueprint
from flask.typing import ResponseReturnValue
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from edge_server.api import bodies, urls
from edge_server.api.auth import PUBLIC, allow
from edge_server.api.contract import Contract, describe
from edge_server.observability import relay_health


def blueprint() -> APIBlueprint:
    """Make the routes."""
    routes = APIBlueprint("health", __name__)
    urls.add(routes, ("healthz",), "healthz", healthz, "GET")
    urls.add(routes, ("readyz",), "readyz", readyz, "GET")
    return routes


@allow(PUBLIC)
@describe(Contract({200: "Health"}))
def healthz() -> dict[str, Any]:
    """Say that the process is alive, and how the database is."""
    return {"status": "ok", "database": "ok" if _database_answers() else "unavailable"}


@allow(PUBLIC)
@describe(Contract({200: "Health", 503: "Health"}))
def readyz() -> ResponseReturnValue:
    """Say whether requests can be served now, not while the server ends; and how the relay is.

    Without a relay nothing reaches the cloud, but reports, plans and aborts are served: 200.
    """
    relay = relay_health.look(bodies.context().config)
    uplink = {"uplink": relay.uplink.name.lower(), "relay_deaths": relay.deaths}
    if bodies.context().bell.closed:
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
