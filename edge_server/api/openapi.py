"""The OpenAPI 3.1 document, made from the routes, their contracts and the vocabulary. Pure."""

import re
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Final, NamedTuple

from afarcloud.wire import TELEMETRY
from edge_server.api import schemas
from edge_server.api.contract import Contract
from edge_server.exchange import geojson

CONVERTER: Final = re.compile(r"<(?:(?P<kind>[^:<>]+):)?(?P<name>\w+)>")
_ERRORS: Final = {
    304: "What the caller has is what is here",
    400: "The body is not JSON",
    401: "No key, or a wrong one",
    403: "The key's role may not do this",
    404: "There is no such thing",
    409: "Not in the state that it is in",
    412: "It has changed since it was read",
    413: "The body is too large",
    415: "The body is not application/json",
    422: "It breaks the model or a rule",
    429: "Too many requests, or a bounded queue is full",
    503: "The database is busy or away",
    507: "The disk is full",
}
_INTEGER: Final = {"type": "integer", "minimum": 0, "maximum": 2**63 - 1}
_VEHICLE: Final = {"type": "integer", "minimum": 1, "maximum": 2**31 - 1}
_QUERY: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "after": ("Only what came after this id", _INTEGER),
    "limit": ("At most so many", {"type": "integer", "minimum": 1, "maximum": 1000}),
    "since": (
        "Only what was received from this time: RFC 3339, or epoch seconds",
        {
            "anyOf": [
                {"type": "string", "format": "date-time"},
                {"type": "number", "minimum": 0, "maximum": 1e11},
            ]
        },
    ),
    "vehicle_id": ("Only of this vehicle", _VEHICLE),
    "kind": ("Only of this kind", {"enum": [kind.value for kind in TELEMETRY]}),
    "vehicle_id:required": ("Whose mission it is", _VEHICLE),
    "dispatch": ("Fly it; else it is held", {"type": "boolean"}),
    "mission_id": ("Number of the mission", {"type": "integer", "minimum": 0}),
    "maximum_speed": (
        "In place of the file's own [m/s]",
        {"type": "number", "exclusiveMinimum": 0},
    ),
    "name": ("Name of the plan", {"type": "string", "minLength": 1, "maxLength": 255}),
    "format:plan": ("As JSON, or as a file of QGroundControl", {"enum": ["json", "plan"]}),
    "format:geojson": ("As JSON or as GeoJSON", {"enum": ["json", "geojson"]}),
    "preview": ("Only plan, keep nothing", {"type": "boolean"}),
    "wait": ("Seconds to wait for work", {"type": "number", "minimum": 0, "maximum": 25}),
}
_TAG: Final = {"type": "string"}
_KEY: Final = {"type": "string", "pattern": "^[!-~]{1,64}$"}


class Route(NamedTuple):
    """One method of one address; `roles` is empty where no key is needed."""

    rule: str
    method: str
    endpoint: str
    summary: str
    roles: tuple[str, ...]
    contract: Contract


def document(routes: Iterable[Route]) -> dict[str, Any]:
    """Write the document of these routes."""
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
            "version": _version(),
            "description": "Plans in; what vehicles report, kept until the cloud has it.",
        },
        "paths": paths,
        "components": {
            "schemas": schemas.components(),
            "securitySchemes": {
                "bearer": {"type": "http", "scheme": "bearer"},
                "header": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
            },
        },
    }


def _allow_either(operation: dict[str, Any], earlier: dict[str, Any]) -> None:
    """One address that names a thing in two ways: what is in the path may be either."""
    for new, old in zip(operation["parameters"], earlier["parameters"], strict=True):
        if new["schema"] != old["schema"]:
            new["schema"] = {"anyOf": [old["schema"], new["schema"]]}


def _version() -> str:
    try:
        return version("farm-flight-bridge")
    except PackageNotFoundError:
        return "unreleased"


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
    if contract.body is not None:
        content: dict[str, Any] = {"schema": _reference(contract.body)}
        if contract.example is not None:
            content["example"] = contract.example
        taken = {"application/json": content} | _files(contract)
        operation["requestBody"] = {"required": True, "content": taken}
    return operation


def _files(contract: Contract) -> dict[str, Any]:
    """Bodies that are files of other programs, alone or in a form."""
    if not contract.files:
        return {}
    file = {"type": "string", "format": "binary"}
    form = {"type": "object", "properties": {"file": file}, "required": ["file"]}
    alone: dict[str, Any] = {media_type: {"schema": file} for media_type in contract.files}
    if geojson.MEDIA_TYPE in alone:
        alone[geojson.MEDIA_TYPE] = {"schema": _reference("GeoJson")}
    return {**alone, "multipart/form-data": {"schema": form}}


def _responses(route: Route) -> dict[str, Any]:
    contract = route.contract
    answers: dict[str, Any] = {}
    for status, name in contract.answers.items():
        answers[str(status)] = {"description": "Done" if status < 300 else "Not now"}
        if name is not None:
            schema = _reference(name)
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
    if contract.body is not None:
        found |= {400, 413, 415, 422, 507}
    if contract.conditional:
        found.add(304 if route.method == "GET" else 412)
    return found


def _answer(status: int, *, with_body: bool) -> dict[str, Any]:
    answer: dict[str, Any] = {"description": _ERRORS[status]}
    if with_body:
        answer["content"] = {"application/json": {"schema": _reference("Error")}}
    return answer


def _path_parameters(rule: str) -> Iterable[dict[str, Any]]:
    for found in CONVERTER.finditer(rule):
        schema: dict[str, Any] = {"type": "string", "pattern": "^[0-9A-Z]{26}$"}
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


def _reference(name: str) -> dict[str, Any]:
    return {"$ref": schemas.REFERENCE.format(model=name)}
