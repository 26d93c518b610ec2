"""`/surveys/`: plans that cover a field or a boundary with pictures."""

from typing import Final

from flask import Blueprint
from flask.typing import ResponseReturnValue
from werkzeug.exceptions import Forbidden

from edge_server.api import bodies, planning_schemas, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import PLANNERS, allow, audit, caller
from edge_server.api.contract import Contract, describe
from edge_server.services.planning import surveys
from edge_server.store.rows.keys import Role
from edge_server.survey.request import SurveyOrder

EXAMPLE: Final = {
    "name": "North field",
    "boundary": [
        [40.4430, -3.7392],
        [40.4440, -3.7392],
        [40.4440, -3.7380],
        [40.4430, -3.7380],
    ],
    "camera": {"sensor_width_mm": 13.2, "sensor_height_mm": 8.8, "focal_length_mm": 8.8},
    "altitude": 30.0,
    "vehicles": [1],
}


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("surveys", __name__)
    urls.add(routes, ("surveys", "survey"), "create", create, "POST")
    return routes


@allow(PLANNERS | {Role.FARMER})
@describe(
    Contract(
        {200: planning_schemas.Survey, 201: planning_schemas.Survey},
        body=SurveyOrder,
        query=("preview",),
        repeatable=True,
        errors=(409,),
        example=EXAMPLE,
    )
)
def create() -> ResponseReturnValue:
    """Plan a survey of a field; with `preview=true` nothing is stored."""
    wanted = bodies.model(SurveyOrder)
    scopes.check(*wanted.vehicles)
    requester = caller()
    is_preview = bodies.query_boolean("preview")
    if requester.role == Role.FARMER and wanted.dispatch:
        raise Forbidden('a farmer may post drafts only: {"dispatch": false}')
    if is_preview:
        return surveys.preview(bodies.context(), wanted), 200
    planned = surveys.create(bodies.context(), wanted, requester)
    audit(f"planned a survey: plans {[plan['id'] for plan in planned['plans']]}")
    return planned, 201
