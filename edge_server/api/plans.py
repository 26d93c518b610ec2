"""`/plans/`: plans in, kept, shown with the live status of each mission and command."""

from typing import Any

from apiflask import APIBlueprint
from flask import url_for
from flask.typing import ResponseReturnValue
from werkzeug.exceptions import Forbidden

from afarcloud.plan import Plan
from afarcloud.wire import Kind
from edge_server.api import bodies, etags, plan_files, urls
from edge_server.api.auth import PLANNERS, READERS, allow, audit, caller
from edge_server.api.contract import PAGE, Contract, describe
from edge_server.services import plans
from edge_server.store.keys import Role

WORDS = ("plans", "plan")
BY_NUMBER = "int64:reference"
BY_ULID = "string(length=26):reference"
STORED = "StoredPlan"
EXAMPLE = {
    "name": "First flight",
    "missions": [
        {
            "mission_id": 1,
            "vehicle_id": 1,
            "maximum_speed": 5.0,
            "command_array": [
                {
                    "command_id": 1,
                    "command_type_id": 1,
                    "parameters": {"latitude": 40.4434, "longitude": -3.7382, "altitude": 5.0},
                },
                {"command_id": 2, "command_type_id": 11, "parameters": {"landing": True}},
            ],
        }
    ],
}
"""A plan to begin with, for the documentation."""


def blueprint() -> APIBlueprint:
    """Make the routes."""
    routes = APIBlueprint("plans", __name__)
    urls.add(routes, WORDS, "create", create, "POST")
    urls.add(routes, WORDS, "page", page, "GET")
    for item in (BY_NUMBER, BY_ULID):
        urls.add(routes, WORDS, "get", get, "GET", item=item)
        urls.add(routes, WORDS, "put", put, "PUT", item=item)
        urls.add(routes, WORDS, "delete", delete, "DELETE", item=item)
        urls.add(routes, WORDS, "dispatch", dispatch, "POST", item=item, action="dispatch")
    return routes


@allow(PLANNERS | {Role.FARMER})
@describe(Contract({201: STORED}, body="Plan", repeatable=True, errors=(409,), example=EXAMPLE))
def create() -> ResponseReturnValue:
    """Keep a plan and queue its missions; a farmer's waits for somebody who may dispatch it."""
    plan = _plan()
    if caller().role == Role.FARMER and plan.dispatch:
        raise Forbidden('a farmer may post drafts only: {"dispatch": false}')
    stored = plans.create(bodies.context(), plan, caller())
    audit(f"posted plan {stored['id']}")
    return stored, 201, {"Location": url_for("plans.get", reference=stored["id"])}


@allow(READERS)
@describe(Contract({200: STORED}, is_list=True, query=PAGE))
def page() -> list[dict[str, Any]]:
    """List plans."""
    return plans.page(
        bodies.context(),
        after_id=bodies.query_integer("after", 0, 0, 2**63 - 1),
        limit=bodies.query_integer("limit", bodies.PAGE_DEFAULT, 1, bodies.PAGE_LIMIT),
        since_s=bodies.query_time("since"),
        vehicle_id=bodies.query_vehicle(),
    )


@allow(READERS)
@describe(Contract({200: STORED}, query=("format:plan", "vehicle_id"), conditional=True))
def get(reference: int | str) -> ResponseReturnValue:
    """Give a plan with its live status, or a mission of it as a file of QGroundControl."""
    if plan_files.wants_plan_file():
        return plan_files.export(reference)
    return etags.tagged(plans.find(bodies.context(), reference))


@allow(PLANNERS)
@describe(Contract({200: STORED}, body="Plan", conditional=True, errors=(409,), example=EXAMPLE))
def put(reference: int | str) -> ResponseReturnValue:
    """Replace a plan that nobody has begun."""
    stored = plans.replace(bodies.context(), reference, _plan(), etags.check_match)
    audit(f"replaced plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS)
@describe(Contract({200: STORED}, errors=(409, 422)))
def dispatch(reference: int | str) -> ResponseReturnValue:
    """Let a plan that was posted with `"dispatch": false` be flown."""
    stored = plans.dispatch(bodies.context(), reference)
    audit(f"dispatched plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS)
@describe(Contract({204: None}, errors=(409,)))
def delete(reference: int | str) -> ResponseReturnValue:
    """Forget a plan and cancel what waits of it."""
    plans.remove(bodies.context(), reference)
    audit(f"deleted plan {reference}")
    return "", 204


def _plan() -> Plan:
    plan = bodies.document(Kind.PLAN)
    if not isinstance(plan, Plan):
        raise TypeError(type(plan))
    return plan
