"""The OpenAPI 3.1 document, made from the routes, their contracts and their types. Pure."""

import re
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from afarcloud.wire import TELEMETRY
from edge_server.api import planning_schemas, schemas
from edge_server.api.contract import Contract
from edge_server.geodata import geojson
from farm_flight_bridge import VERSION

REFERENCE: Final = "#/components/schemas/{model}"
CONVERTER: Final = re.compile(r"<(?:(?P<kind>[^:<>]+):)?(?P<name>\w+)>")
_ULID: Final = "^[0-9A-Z]{26}$"
_PATTERNS: Final = {
    "prefix": "^[0-9a-f]{8}$",
    "name": "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$",
    "file_name": "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$",
}
"""Of the parameters in paths that are no ULID."""
_ERRORS: Final = {
    304: "Not modified",
    400: "The body is not JSON",
    401: "No access key, or an unknown one",
    403: "The key has no permission for this",
    404: "Not found",
    409: "Not possible in the present state",
    412: "Changed since it was read",
    413: "The body is too large",
    415: "The body is not application/json",
    416: "The file has no such range of bytes",
    422: "A field violates the model or a rule",
    429: "Too many requests, or a bounded queue is full",
    503: "The database is busy or unavailable",
    507: "The disk is full",
}
_INTEGER: Final = {"type": "integer", "minimum": 0, "maximum": 2**63 - 1}
_VEHICLE: Final = {"type": "integer", "minimum": 1, "maximum": 2**31 - 1}
_QUERY: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "after": ("Only items after this id", _INTEGER),
    "limit": ("Number of items, at most", {"type": "integer", "minimum": 1, "maximum": 1000}),
    "since": (
        "Only items received since this time: RFC 3339, or epoch seconds",
        {
            "anyOf": [
                {"type": "string", "format": "date-time"},
                {"type": "number", "minimum": 0, "maximum": 1e11},
            ]
        },
    ),
    "vehicle_id": ("Only items of this vehicle", _VEHICLE),
    "kind": ("Only items of this kind", {"enum": [kind.value for kind in TELEMETRY]}),
    "vehicle_id:required": ("Vehicle of the mission", _VEHICLE),
    "dispatch": ("Queue it; else it is held", {"type": "boolean"}),
    "mission_id": ("Number of the mission", {"type": "integer", "minimum": 0}),
    "maximum_speed": (
        "Replaces the file's [m/s]",
        {"type": "number", "exclusiveMinimum": 0},
    ),
    "name": ("Name of the plan", {"type": "string", "minLength": 1, "maxLength": 255}),
    "format:plan": (
        "JSON, a .plan file of QGroundControl, or a QGC WPL 110 file",
        {"enum": ["json", "plan", "waypoints"]},
    ),
    "band": (
        "what the pictures show: colours (without it), near infrared or the vegetation index",
        {"enum": ["rgb", "nir", "ndvi"]},
    ),
    "format:geojson": ("JSON or GeoJSON", {"enum": ["json", "geojson"]}),
    "format:csv": ("JSON or CSV", {"enum": ["json", "csv"]}),
    "format:log": (
        "a log of this format; without it the vehicle's own, ULog or DataFlash",
        {"enum": ["ulg", "bin", "tlog"]},
    ),
    "format:track": ("GeoJSON, CSV or GPX", {"enum": ["geojson", "csv", "gpx"]}),
    "preview": ("Plan only, store nothing", {"type": "boolean"}),
    "offset:required": ("First byte of the part in the file", _INTEGER),
    "is_last": ("The part is the last one: the file is complete", {"type": "boolean"}),
    "wait": ("Seconds to wait for work", {"type": "number", "minimum": 0, "maximum": 25}),
}
_TAG: Final = {"type": "string"}
_FILE: Final = {"type": "string", "format": "binary"}
_KEY: Final = {"type": "string", "pattern": "^[!-~]{1,64}$"}


class Route(NamedTuple):
    """One method of one path; `roles` is empty where no key is needed."""

    rule: str
    method: str
    endpoint: str
    summary: str
    roles: tuple[str, ...]
    contract: Contract


def document(routes: Iterable[Route]) -> dict[str, Any]:
    """Write the document of these routes."""
    routes = list(routes)
    paths: dict[str, dict[str, Any]] = {}
    for route in routes:
        path = CONVERTER.sub(lambda found: f"{{{found['name']}}}", route.rule)
        operations = paths.setdefault(path, {})
        operation = _operation(route)
        if (earlier := operations.get(route.method.lower())) is not None:
            _allow_either(operation, earlier)
        operations[route.method.lower()] = operation
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "Edge server",
            "version": VERSION,
            "description": "Flight plans, and vehicles' reports, stored until the cloud has them.",
        },
        "paths": paths,
        "components": {
            "schemas": _components(routes),
            "securitySchemes": {
                "bearer": {"type": "http", "scheme": "bearer"},
                "header": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
            },
        },
    }


def _components(routes: Iterable[Route]) -> dict[str, Any]:
    """Schemas of all bodies, and of the types in them, by name."""
    models: dict[type[BaseModel], None] = {schemas.Error: None, planning_schemas.GeoJson: None}
    for route in routes:
        bodies = [route.contract.body, *route.contract.answers.values()]
        models |= dict.fromkeys(model for model in bodies if model is not None)
    _, found = models_json_schema(
        [(model, "validation") for model in models], ref_template=REFERENCE
    )
    definitions: dict[str, Any] = found["$defs"]
    return definitions


def _allow_either(operation: dict[str, Any], earlier: dict[str, Any]) -> None:
    """Join two routes of one path, whose parameter may be of either type."""
    for new, old in zip(operation["parameters"], earlier["parameters"], strict=True):
        if new["schema"] != old["schema"]:
            new["schema"] = {"anyOf": [old["schema"], new["schema"]]}


def _operation(route: Route) -> dict[str, Any]:
    contract = route.contract
    operation: dict[str, Any] = {
        "operationId": route.endpoint.replace(".", "_") + f"_{route.method.lower()}",
        "summary": route.summary,
        "responses": _responses(route),
    }
    if route.roles:
        operation["description"] = "Roles: " + ", ".join(route.roles) + "."
        operation["security"] = [{"bearer": []}, {"header": []}]
    if parameters := [*_path_parameters(route.rule), *_other_parameters(route)]:
        operation["parameters"] = parameters
    if contract.body is None and contract.files:
        operation["requestBody"] = {"required": True, "content": _raw_files(contract)}
    if contract.body is not None:
        content: dict[str, Any] = {"schema": _reference(contract.body)}
        if contract.example is not None:
            content["example"] = contract.example
        taken = {"application/json": content} | _files(contract)
        operation["requestBody"] = {"required": True, "content": taken}
    return operation


def _files(contract: Contract) -> dict[str, Any]:
    """Media types of files: as the body, or in a form."""
    if not contract.files:
        return {}
    form = {"type": "object", "properties": {"file": _FILE}, "required": ["file"]}
    alone = _raw_files(contract)
    if geojson.MEDIA_TYPE in alone:
        alone[geojson.MEDIA_TYPE] = {"schema": _reference(planning_schemas.GeoJson)}
    return {**alone, "multipart/form-data": {"schema": form}}


def _raw_files(contract: Contract) -> dict[str, Any]:
    """Media types of files as the body."""
    return {media_type: {"schema": _FILE} for media_type in contract.files}


def _responses(route: Route) -> dict[str, Any]:
    contract = route.contract
    answers: dict[str, Any] = {}
    for status, model in contract.answers.items():
        answers[str(status)] = {"description": "Done" if status < 300 else "Not now"}
        if model is not None:
            schema = _reference(model)
            if contract.is_list:
                schema = {"type": "array", "items": schema}
            content: dict[str, Any] = {"application/json": {"schema": schema}}
            content |= {media_type: {} for media_type in contract.other_answers}
            answers[str(status)]["content"] = content
    for status in _error_statuses(route):
        answers[str(status)] = _answer(status, with_body=status >= 400)
    return dict(sorted(answers.items()))


def _error_statuses(route: Route) -> set[int]:
    contract = route.contract
    found = set(contract.errors)
    if route.roles:
        found |= {401, 403, 429, 503}
    if "<" in route.rule:
        found.add(404)
    if contract.query:
        found.add(422)
    if contract.body is not None or contract.files:
        found |= {400, 413, 415, 422, 507}
    if contract.conditional:
        found.add(304 if route.method == "GET" else 412)
    return found


def _answer(status: int, *, with_body: bool) -> dict[str, Any]:
    answer: dict[str, Any] = {"description": _ERRORS[status]}
    if with_body:
        answer["content"] = {"application/json": {"schema": _reference(schemas.Error)}}
    return answer


def _path_parameters(rule: str) -> Iterable[dict[str, Any]]:
    for found in CONVERTER.finditer(rule):
        schema: dict[str, Any] = {"type": "string", "pattern": _PATTERNS.get(found["name"], _ULID)}
        if found["kind"] == "int64":
            schema = dict(_VEHICLE if found["name"] == "vehicle_id" else _INTEGER)
        yield {"name": found["name"], "in": "path", "required": True, "schema": schema}


def _other_parameters(route: Route) -> Iterable[dict[str, Any]]:
    contract = route.contract
    for name in contract.query:
        text, schema = _QUERY[name]
        parameter, _, kind = name.partition(":")
        found = {"name": parameter, "in": "query", "description": text, "schema": schema}
        yield {**found, "required": True} if kind == "required" else found
    if contract.conditional:
        name = "If-None-Match" if route.method == "GET" else "If-Match"
        yield {"name": name, "in": "header", "schema": _TAG}
    if contract.repeatable:
        yield {"name": "Idempotency-Key", "in": "header", "schema": _KEY}


def _reference(model: type[BaseModel]) -> dict[str, Any]:
    return {"$ref": REFERENCE.format(model=model.__name__)}
