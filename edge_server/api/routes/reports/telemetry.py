"""`/pose/` and the six other kinds of report: stored until the cloud has confirmed them."""

from typing import Any

from flask import Blueprint
from flask.typing import ResponseReturnValue

from afarcloud.state import Report
from afarcloud.wire import MODELS, TELEMETRY, Kind
from edge_server.api import bodies, etags, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import ADMIN, BROKER, PEOPLE, allow, audit, caller
from edge_server.api.contract import PAGE, Contract, describe
from edge_server.api.schemas import STORED_REPORTS
from edge_server.services.reports import telemetry

PLURAL = {
    Kind.POSE: "poses",
    Kind.BATTERY: "batteries",
    Kind.IMAGE: "images",
    Kind.OBSERVATION: "observations",
    Kind.STATE_VECTOR: "state_vectors",
    Kind.MISSION_REPORT: "mission_reports",
    Kind.ALARM: "alarms",
}

ITEM = "int64:record_id"


def blueprint() -> Blueprint:
    """Make the routes of all kinds."""
    routes = Blueprint("telemetry", __name__)
    for kind in TELEMETRY:
        _add_kind(routes, kind)
    return routes


def _add_kind(routes: Blueprint, kind: Kind) -> None:
    name, model, stored = kind.value, MODELS[kind], STORED_REPORTS[kind]
    errors = (409,) if kind is Kind.MISSION_REPORT else ()

    @allow(BROKER)
    @describe(Contract({201: stored}, body=model, repeatable=True, errors=errors))
    def create() -> ResponseReturnValue:
        """Store a report."""
        report = bodies.document(kind, Report)
        scopes.check(report.vehicle_id)
        kept = telemetry.ingest(bodies.context(), kind, report, caller())
        location = urls.path_of(f"telemetry.{name}_get", record_id=kept["id"])
        return kept, 201, {"Location": location}

    @allow(PEOPLE)
    @describe(Contract({200: stored}, is_list=True, query=PAGE))
    def page() -> list[dict[str, Any]]:
        """List the reports that the cloud has not confirmed."""
        after_id = bodies.query_after()
        limit = bodies.query_limit()
        since_s = bodies.query_time("since")

        def of(vehicle_id: int | None) -> list[dict[str, Any]]:
            return telemetry.page(
                bodies.context(),
                kind,
                after_id=after_id,
                limit=limit,
                vehicle_id=vehicle_id,
                since_s=since_s,
            )

        return scopes.pages(of, bodies.query_vehicle(), limit)

    @allow(PEOPLE)
    @describe(Contract({200: stored}, conditional=True))
    def get(record_id: int) -> ResponseReturnValue:
        """Give one report."""
        found = telemetry.find(bodies.context(), kind, record_id)
        return etags.tagged(scopes.permitted(found))

    @allow(ADMIN)
    @describe(Contract({200: stored}, body=model, conditional=True, errors=(409,)))
    def put(record_id: int) -> ResponseReturnValue:
        """Correct a report."""
        report = bodies.document(kind, Report)
        precondition = scopes.with_vehicle_check(etags.check_match)
        kept = telemetry.replace(bodies.context(), kind, record_id, report, precondition)
        audit(f"corrected {name} {record_id}")
        return etags.tagged(kept)

    @allow(ADMIN)
    @describe(Contract({204: None}))
    def delete(record_id: int) -> ResponseReturnValue:
        """Delete a report."""
        scopes.check_resource(lambda: telemetry.find(bodies.context(), kind, record_id))
        telemetry.remove(bodies.context(), kind, record_id)
        audit(f"deleted {name} {record_id}")
        return "", 204

    names = (name, PLURAL[kind])
    urls.add(routes, names, f"{name}_create", create, "POST")
    urls.add(routes, names, f"{name}_list", page, "GET")
    urls.add(routes, names, f"{name}_get", get, "GET", item=ITEM)
    urls.add(routes, names, f"{name}_put", put, "PUT", item=ITEM)
    urls.add(routes, names, f"{name}_delete", delete, "DELETE", item=ITEM)
