"""Surveys: planned over a field, and kept as plans; all of them or none."""

from typing import Any

from afarcloud.faults import Fault, InvalidError
from afarcloud.numbers import INT32_MAX
from afarcloud.plan import Plan
from afarcloud.wire import write
from edge_server.services import plans
from edge_server.services.context import Caller, Context
from edge_server.store import vehicles
from edge_server.survey.planner import NoSurveyError, Survey, survey
from edge_server.survey.request import Place, SurveyRequest


def preview(context: Context, request: SurveyRequest) -> dict[str, Any]:
    """Plan a survey and keep nothing; raises InvalidError."""
    planned = _planned(context, request)
    return {**planned.figures, "plans": planned.plans}


def create(context: Context, request: SurveyRequest, caller: Caller) -> dict[str, Any]:
    """Plan a survey and keep its plans, in the order of flight.

    Raises:
        InvalidError: if it cannot be flown, or a plan breaks a rule.
        ConflictError: as for a plan.
        KeyReusedError: if the idempotency key belongs to another request.
    """
    planned = _planned(context, request)
    documents = [Plan.model_validate(plan) for plan in planned.plans]
    return {
        **planned.figures,
        "plans": plans.create_all(context, documents, caller, write(request)),
    }


def _planned(context: Context, request: SurveyRequest) -> Survey:
    first = request.first_mission_id
    if first is None:
        first = int(context.clock()) % INT32_MAX
    try:
        return survey(request, _home(context, request), first)
    except NoSurveyError as error:
        raise InvalidError((Fault(error.field, str(error)),)) from None


def _home(context: Context, request: SurveyRequest) -> Place:
    """Where the vehicles start: as said, else where the first one is, else the field's corner."""
    if request.home is not None:
        return request.home
    with context.database.read() as connection:
        known = vehicles.get(connection, request.vehicles[0])
    if known is not None and None not in (
        at := (known.state.get("latitude"), known.state.get("longitude"))
    ):
        return Place(latitude=at[0], longitude=at[1])
    latitude, longitude = request.boundary[0]
    return Place(latitude=latitude, longitude=longitude)
