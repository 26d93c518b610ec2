"""`/plans/import`, and a plan as `.plan` or `.waypoints`: mission files of ground stations."""

import re
from typing import Any, Final

from flask import Blueprint, make_response, request
from flask.typing import ResponseReturnValue
from werkzeug.exceptions import Forbidden

from afarcloud.faults import Fault, InvalidError
from afarcloud.wire import read_as
from edge_server.api import bodies, planning_schemas, schemas, uploads, urls
from edge_server.api.access import scopes
from edge_server.api.access.auth import PLANNERS, allow, audit, caller
from edge_server.api.contract import Contract, describe
from edge_server.api.errors import RequestError
from edge_server.exchange import qgc_plan, waypoint_list
from edge_server.exchange.mission_item import MissionFile
from edge_server.services.planning import plan_files
from edge_server.services.planning.plan_files import Exported, ImportOrder
from edge_server.store.rows.keys import Role

FILES: Final = ("text/plain", uploads.UNSPECIFIED)
EXAMPLE: Final[dict[str, Any]] = {
    "fileType": "Plan",
    "version": 1,
    "groundStation": "QGroundControl",
    "mission": {
        "version": 2,
        "firmwareType": 12,
        "vehicleType": 2,
        "cruiseSpeed": 15,
        "hoverSpeed": 5,
        "plannedHomePosition": [40.4434, -3.7382, 650],
        "items": [
            {
                "type": "SimpleItem",
                "autoContinue": True,
                "command": 22,
                "doJumpId": 1,
                "frame": 3,
                "params": [0, 0, 0, None, 40.4434, -3.7382, 10],
            },
            {
                "type": "SimpleItem",
                "autoContinue": True,
                "command": 20,
                "doJumpId": 2,
                "frame": 2,
                "params": [0, 0, 0, 0, 0, 0, 0],
            },
        ],
    },
    "geoFence": {"version": 2, "circles": [], "polygons": []},
    "rallyPoints": {"version": 2, "points": []},
}
ORDER: Final = ("vehicle_id:required", "dispatch", "mission_id", "maximum_speed", "name")
_JSON: Final = "json"
_FORMATS: Final = (_JSON, "plan", "waypoints")
_WHOLE: Final = re.compile(r"\d{1,10}")
_FRACTION: Final = re.compile(r"\d{1,6}(\.\d{1,6})?")
_FLAGS: Final = {"true": True, "false": False}


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("plan_files", __name__)
    urls.add(routes, ("plans", "plan"), "create", create, "POST", action="import")
    return routes


@allow(PLANNERS | {Role.FARMER})
@describe(
    Contract(
        {201: schemas.StoredPlan},
        body=planning_schemas.QGroundControlPlan,
        query=ORDER,
        repeatable=True,
        errors=(409,),
        files=FILES,
        example=EXAMPLE,
    )
)
def create() -> ResponseReturnValue:
    """Import a QGroundControl `.plan` or `QGC WPL 110` file as a plan, which is held."""
    upload = uploads.upload((uploads.JSON, *FILES))
    order = _order()
    if caller().role == Role.FARMER and order.dispatch:
        raise Forbidden("a farmer may post drafts only: dispatch=false")
    scopes.check(order.vehicle_id)
    stored = plan_files.create(bodies.context(), _file(upload), order, caller())
    audit(f"imported plan {stored['id']}")
    return stored, 201, {"Location": urls.path_of("plans.get", reference=stored["id"])}


def _file(upload: uploads.Upload) -> MissionFile:
    """Read a file of either kind; raises DocumentError."""
    if waypoint_list.is_waypoint_list(upload.raw):
        return waypoint_list.read(upload.raw)
    return qgc_plan.read(uploads.parsed(upload, "is not a .plan or QGC WPL 110 file"))


def wanted_file() -> str | None:
    """Return which mission file the query asks for, if any; raises 422 for an unknown format."""
    form = request.args.get("format", _JSON)
    if form not in _FORMATS:
        fault = Fault("format", f"must be {', '.join(_FORMATS[:-1])} or {_FORMATS[-1]}")
        raise RequestError(422, "the query cannot be used", (fault,))
    return None if form == _JSON else form


def export(reference: int | str, form: str) -> ResponseReturnValue:
    """Export one mission of a plan as a mission file of this format."""
    vehicle_id = bodies.query_vehicle()
    try:
        exported = plan_files.export(bodies.context(), reference, vehicle_id)
    except InvalidError as error:
        raise RequestError(422, "the query cannot be used", error.faults) from None
    scopes.check(exported.vehicle_id)
    response = make_response(_written(exported, form))
    if form != "plan":
        response.content_type = "text/plain; charset=utf-8"
    name = f"plan-{reference}-vehicle-{exported.vehicle_id}.{form}"
    response.headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return response


def _written(one: Exported, form: str) -> dict[str, Any] | str:
    if form != "plan":
        return waypoint_list.write(one.items, one.home)
    return qgc_plan.write(one.items, one.home, one.speed_m_s, one.geofence, one.rally_points)


def _order() -> ImportOrder:
    """Read from query or form what the file does not contain; raises RequestError."""
    given = request.form.to_dict() | request.args.to_dict()
    known = {name: given[name] for name in ImportOrder.model_fields if name in given}
    values: dict[str, Any] = {name: _value(name, text) for name, text in known.items()}
    try:
        return read_as(ImportOrder, values)
    except InvalidError as error:
        raise RequestError(422, "the query cannot be used", error.faults) from None


def _value(name: str, text: str) -> Any:
    """Convert a text to the JSON value that it represents; the model validates it."""
    if name == "name":
        return text
    if name == "dispatch":
        return _FLAGS.get(text, text)
    if _WHOLE.fullmatch(text):
        return int(text)
    return float(text) if _FRACTION.fullmatch(text) else text
