"""`/alarms/history/`: the alarms in the archive, and who has acknowledged them."""

from typing import Any, Final

from flask import Blueprint

from edge_server.api import archive_schemas, bodies, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import PEOPLE, PLANNERS, allow, audit, caller
from edge_server.api.contract import PAGE, Contract, describe
from edge_server.services import flight_archive
from edge_server.services.flight_archive import Page

NAMES: Final = ("alarms/history",)


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("alarm_history", __name__)
    urls.add(routes, NAMES, "page", page, "GET")
    item = "int64:alarm_id"
    urls.add(routes, NAMES, "acknowledge", acknowledge, "POST", item=item, action="acknowledge")
    return routes


@allow(PEOPLE)
@describe(Contract({200: archive_schemas.RecordedAlarm}, is_list=True, query=PAGE))
def page() -> list[dict[str, Any]]:
    """List the alarms in the archive, oldest first."""
    after_id = bodies.query_after()
    limit = bodies.query_limit()
    since_s = bodies.query_time("since")

    def of(vehicle_id: int | None) -> list[dict[str, Any]]:
        wanted = Page(after_id, limit, vehicle_id, since_s)
        return flight_archive.alarms(bodies.context(), wanted)

    return scopes.pages(of, bodies.query_vehicle(), limit)


@allow(PLANNERS)
@describe(Contract({200: archive_schemas.RecordedAlarm}))
def acknowledge(alarm_id: int) -> dict[str, Any]:
    """Acknowledge an alarm; a repetition changes nothing."""
    scopes.check_resource(lambda: flight_archive.alarm(bodies.context(), alarm_id))
    acknowledged = flight_archive.acknowledge(bodies.context(), alarm_id, caller().name)
    audit(f"acknowledged alarm {alarm_id}")
    return acknowledged
