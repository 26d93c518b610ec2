"""`/plans/`: plans in, kept, shown with the live status of each mission and command."""

from typing import Any

from apiflask import APIBlueprint
from flask import url_for
from flask.typing import ResponseReturnValue
from werkzeug.exceptions import Forbidden

from afarcloud.plan import Plan
from afarcloud.wire import Kind
from edge_server.api import bodies, etags, urls
from edge_server.api.auth import PLANNERS, READERS, allow, audit, caller
from edge_server.services import plans
from edge_server.store.keys import Role

WORDS = ("plans", "plan")
BY_NUMBER = "int64:reference"
BY_ULID = "string(length=26):reference"


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
def create() -> ResponseReturnValue:
    """Keep a plan and queue its missions; a farmer's waits for somebody who may dispatch it."""
    plan = _plan()
    if caller().role == Role.FARMER and plan.dispatch:
        raise Forbidden('a farmer may post drafts only: {"dispatch": false}')
    stored = plans.create(bodies.context(), plan, caller())
    audit(f"posted plan {stored['id']}")
    return stored, 201, {"Location": url_for("plans.get", reference=stored["id"])}


@allow(READERS)
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
def get(reference: int | str) -> ResponseReturnValue:
    """Give a plan with its live status."""
    return etags.tagged(plans.find(bodies.context(), reference))


@allow(PLANNERS)
def put(reference: int | str) -> ResponseReturnValue:
    """Replace a plan that nobody has begun."""
    stored = plans.replace(bodies.context(), reference, _plan(), etags.check_match)
    audit(f"replaced plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS)
def dispatch(reference: int | str) -> ResponseReturnValue:
    """Let a plan that was posted with `"dispatch": false` be flown."""
    stored = plans.dispatch(bodies.context(), reference)
    audit(f"dispatched plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS)
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
