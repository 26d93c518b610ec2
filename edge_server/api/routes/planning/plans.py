"""`/plans/`: plans, with the live status of each mission and command."""

from typing import Any

from flask import Blueprint
from flask.typing import ResponseReturnValue

from afarcloud.numbers import Model, ShortText, VehicleId
from afarcloud.plan import Plan
from afarcloud.wire import Kind
from edge_server.api import bodies, etags, freshness, schemas, urls
from edge_server.api.access.auth import PLANNERS, READERS, allow, audit, caller, refusal
from edge_server.api.access.scopes import (
    check,
    check_resource,
    own_missions,
    pages,
    with_vehicle_check,
)
from edge_server.api.contract import PAGE, Contract, describe
from edge_server.api.routes.planning import plan_files
from edge_server.services.planning import plans
from edge_server.store.rows.keys import Role


class Closing(Model):
    """Body of a close: the reason, and the vehicle where the plan has several."""

    reason: ShortText
    vehicle_id: VehicleId | None = None


NAMES = ("plans", "plan")
_UNATTENDED = 'a farmer or the cloud may post drafts only: {"dispatch": false}'
BY_NUMBER = "int64:reference"
BY_ULID = "string(length=26):reference"
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
"""Example in the documentation."""


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("plans", __name__)
    urls.add(routes, NAMES, "create", create, "POST")
    urls.add(routes, NAMES, "page", page, "GET")
    for item in (BY_NUMBER, BY_ULID):
        urls.add(routes, NAMES, "get", get, "GET", item=item)
        urls.add(routes, NAMES, "put", put, "PUT", item=item)
        urls.add(routes, NAMES, "delete", delete, "DELETE", item=item)
        urls.add(routes, NAMES, "dispatch", dispatch, "POST", item=item, action="dispatch")
        urls.add(routes, NAMES, "close", close, "POST", item=item, action="close")
    return routes


@allow(PLANNERS | {Role.FARMER, Role.CLOUD})
@describe(
    Contract({201: schemas.StoredPlan}, body=Plan, repeatable=True, errors=(409,), example=EXAMPLE)
)
def create() -> ResponseReturnValue:
    """Store a plan and queue its missions; those of a farmer or the cloud are held."""
    plan = _held_unless_allowed(bodies.document(Kind.PLAN, Plan))
    check(*(mission.vehicle_id for mission in plan.missions))
    if plan.dispatch:
        freshness.check()
    stored = plans.create(bodies.context(), plan, caller())
    audit(f"posted plan {stored['id']}")
    return stored, 201, {"Location": urls.path_of("plans.get", reference=stored["id"])}


@allow(READERS)
@describe(Contract({200: schemas.StoredPlan}, is_list=True, query=PAGE))
def page() -> list[dict[str, Any]]:
    """List plans."""
    after_id = bodies.query_after()
    limit = bodies.query_limit()
    since_s = bodies.query_time("since")

    def of(vehicle_id: int | None) -> list[dict[str, Any]]:
        return plans.page(
            bodies.context(),
            after_id=after_id,
            limit=limit,
            since_s=since_s,
            vehicle_id=vehicle_id,
        )

    return [own_missions(plan) for plan in pages(of, bodies.query_vehicle(), limit)]


@allow(READERS)
@describe(
    Contract(
        {200: schemas.StoredPlan},
        query=("format:plan", "vehicle_id"),
        conditional=True,
        other_answers=("text/plain",),
    )
)
def get(reference: int | str) -> ResponseReturnValue:
    """Give a plan with its live status, or one of its missions as a mission file."""
    if (form := plan_files.wanted_file()) is not None:
        return plan_files.export(reference, form)
    return etags.tagged(own_missions(plans.find(bodies.context(), reference)))


@allow(PLANNERS | {Role.FARMER, Role.CLOUD})
@describe(
    Contract({200: schemas.StoredPlan}, body=Plan, conditional=True, errors=(409,), example=EXAMPLE)
)
def put(reference: int | str) -> ResponseReturnValue:
    """Replace a plan that the broker has not accepted; a farmer or the cloud a held one only."""
    plan = _held_unless_allowed(bodies.document(Kind.PLAN, Plan))
    check(*(mission.vehicle_id for mission in plan.missions))
    precondition = with_vehicle_check(_check_draft if _needs_dispatcher() else etags.check_match)
    stored = plans.replace(bodies.context(), reference, plan, precondition)
    audit(f"replaced plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS | {Role.CLOUD})
@describe(Contract({200: schemas.StoredPlan}, conditional=True, errors=(409, 422)))
def dispatch(reference: int | str) -> ResponseReturnValue:
    """Queue a plan that was posted with `"dispatch": false`."""
    if _needs_dispatcher():
        raise refusal(_UNATTENDED)
    check_resource(lambda: plans.find(bodies.context(), reference))
    freshness.check()
    stored = plans.dispatch(bodies.context(), reference, etags.check_match)
    audit(f"dispatched plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS)
@describe(Contract({200: schemas.StoredPlan}, body=Closing, errors=(409,)))
def close(reference: int | str) -> ResponseReturnValue:
    """Abort accepted missions of a lost broker; their vehicles must be silent."""
    closing = bodies.model(Closing)
    check_resource(lambda: plans.find(bodies.context(), reference))
    stored = plans.close(bodies.context(), reference, closing.reason, closing.vehicle_id)
    audit(f"closed plan {stored['id']}")
    return etags.tagged(stored)


@allow(PLANNERS)
@describe(Contract({204: None}, conditional=True, errors=(409,)))
def delete(reference: int | str) -> ResponseReturnValue:
    """Delete a plan and cancel its queued missions."""
    check_resource(lambda: plans.find(bodies.context(), reference))
    plans.remove(bodies.context(), reference, etags.check_match)
    audit(f"deleted plan {reference}")
    return "", 204


def _needs_dispatcher() -> bool:
    """Whether another role must dispatch the caller's plans."""
    role = caller().role
    if role == Role.CLOUD:
        return not bodies.context().config.cloud_may_dispatch
    return role == Role.FARMER


def _held_unless_allowed(plan: Plan) -> Plan:
    """Hold a plan that the caller may not dispatch; raises 403 if it asks to dispatch it."""
    if not plan.dispatch or not _needs_dispatcher():
        return plan
    if caller().role == Role.FARMER or "dispatch" in plan.model_fields_set:
        raise refusal(_UNATTENDED)
    return plan.model_copy(update={"dispatch": False})


def _check_draft(shown: dict[str, Any]) -> None:
    if any(mission["dispatch_state"] != "held" for mission in shown["missions"]):
        raise refusal(_UNATTENDED)
    etags.check_match(shown)
