"""`/healthz`: liveness; `/readyz`: readiness. No key needed."""

from contextlib import suppress
from typing import Any, Final

from flask import Blueprint
from flask.typing import ResponseReturnValue
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from edge_server import relay_health
from edge_server.api import bodies, schemas, urls
from edge_server.api.access.auth import PUBLIC, allow
from edge_server.api.contract import Contract, describe
from edge_server.store.files.read_only import is_read_only


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
    return {"status": "ok", "database": _database_state()}


@allow(PUBLIC)
@describe(Contract({200: schemas.Health, 503: schemas.Health}))
def readyz() -> ResponseReturnValue:
    """Report whether requests can be served, and the state of the relay; 503 while shutting down.

    Without a relay nothing reaches the cloud, but reports, plans and aborts are served: 200. So it
    is where the database cannot be written: reading goes on, and an abort may find room.
    """
    relay = relay_health.read(bodies.context().config)
    uplink = {"uplink": relay.uplink.name.lower(), "relay_deaths": relay.deaths}
    if bodies.context().work_signal.closed:
        return {"status": "stopping", "database": "ok", **uplink}, 503
    database = _database_state()
    status, code = _READINESS[database]
    return {"status": status, "database": database, **uplink}, code


REFUSAL_SHOWS_S: Final = 30.0
_READINESS: Final = {
    "ok": ("ready", 200),
    "not writable": ("degraded", 200),
    "unavailable": ("not ready", 503),
}


def _database_state() -> str:
    """Read something; also write where the last transaction was not stored."""
    context = bodies.context()
    database, file = context.database, context.config.database_path
    try:
        with database.read() as connection:
            connection.execute(text("SELECT count(*) FROM alembic_version")).scalar_one()
    except SQLAlchemyError:
        return "unavailable"
    if not database.is_shared and is_read_only(file.parent):
        return "not writable"
    if database.was_refused(within_s=0.0):
        with suppress(SQLAlchemyError), database.write() as connection:
            connection.execute(text("UPDATE alembic_version SET version_num = version_num"))
    return "not writable" if database.was_refused(within_s=REFUSAL_SHOWS_S) else "ok"
