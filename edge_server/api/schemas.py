"""JSON Schemas of what comes in and goes out: the vocabulary's own, and what we add to it. Pure."""

from collections.abc import Mapping
from typing import Any, Final

from pydantic.json_schema import models_json_schema

from afarcloud.model import Model
from afarcloud.state import Report
from afarcloud.wire import MODELS, TELEMETRY, Kind
from edge_server.api import field_schemas
from edge_server.api.broker import Acknowledged
from edge_server.api.plans import Closing
from edge_server.api.vehicles import Release
from edge_server.exchange.field import Field
from edge_server.services.event_states import State
from edge_server.services.keys import KeyRequest
from edge_server.services.vehicles import VehicleState
from edge_server.survey.request import SurveyOrder

REFERENCE: Final = "#/components/schemas/{model}"
_TIME: Final = {"type": "string", "format": "date-time"}
_ID: Final = {"type": "integer", "minimum": 1}
_TEXT: Final = {"type": "string"}
_STATUS: Final = {"$ref": REFERENCE.format(model="Status")}

_HELD: Final = {
    "type": ["object", "null"],
    "description": "Why its missions wait for an operator; null: they do not.",
    "properties": {
        "reason": _TEXT,
        "since": _TIME,
        "mission_id": {"type": ["integer", "null"]},
        "plan_id": {"type": ["string", "null"]},
    },
    "required": ["reason", "since", "mission_id", "plan_id"],
}

ERROR: Final[dict[str, Any]] = {
    "type": "object",
    "description": "What is wrong, with each faulty field by its path.",
    "properties": {
        "message": _TEXT,
        "detail": {
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "additionalProperties": {"type": "array", "items": _TEXT},
            },
        },
        "errors": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {"code": {"type": "integer"}, "name": _TEXT, "path": _TEXT},
                "required": ["code", "name", "path"],
            },
        },
        "request_id": _TEXT,
    },
    "required": ["message", "detail"],
}


def name_of(kind: Kind) -> str:
    """Name of the schema of a kind."""
    return MODELS[kind].__name__


def stored_name(kind: Kind) -> str:
    """Name of the schema of a kind as it is answered."""
    return f"Stored{name_of(kind)}"


def components() -> dict[str, Any]:
    """Give every schema by name."""
    own: list[type[Model]] = [
        Field,
        KeyRequest,
        VehicleState,
        Release,
        Closing,
        Acknowledged,
        SurveyOrder,
    ]
    _, document = models_json_schema(
        [(model, "validation") for model in [*MODELS.values(), *own]], ref_template=REFERENCE
    )
    found: dict[str, Any] = document["$defs"]
    found["Error"] = ERROR
    found |= {stored_name(kind): _stored_report(found[name_of(kind)]) for kind in TELEMETRY}
    found["StoredPlan"] = _stored_plan(found["Plan"])
    found["StoredEvent"] = _stored_event(found["Event"])
    found["Vehicle"] = _with(
        found["VehicleState"],
        {"vehicle_id": _ID, "held": _HELD, "registered_at": _TIME, "updated_at": _TIME},
        closed=False,
    )
    found |= _bulk() | _work() | _dead_letters()
    found |= _keys()
    found |= field_schemas.components(found["Field"], REFERENCE)
    return found


def _with(
    schema: Mapping[str, Any], properties: Mapping[str, Any], *, closed: bool = True
) -> dict[str, Any]:
    """A schema with more properties, all of them required; open unless `closed`."""
    joined = {
        **schema,
        "properties": {**schema["properties"], **properties},
        "required": list(dict.fromkeys([*schema.get("required", []), *properties])),
    }
    if not closed:
        joined.pop("additionalProperties", None)
    return joined


def _stored_report(schema: Mapping[str, Any]) -> dict[str, Any]:
    stored = _with(schema, {"id": _ID, "message_id": _TEXT, "received_at": _TIME}, closed=False)
    if "frame" in stored["properties"]:  # Lists of pictures leave it out
        stored["required"] = [name for name in stored["required"] if name != "frame"]
    return stored


def _stored_plan(schema: Mapping[str, Any]) -> dict[str, Any]:
    warning = {"type": "object", "properties": {"path": _TEXT, "message": _TEXT}}
    command = {
        "type": "object",
        "properties": {
            "command_id": {"type": "integer"},
            "command_status_id": _STATUS,
            "command_status_name": _TEXT,
            "message": _TEXT,
        },
        "required": ["command_id", "command_status_id", "command_status_name"],
    }
    mission = {
        "type": "object",
        "properties": {
            "mission_id": {"type": "integer"},
            "vehicle_id": {"type": "integer"},
            "dispatch_state": {"enum": ["held", "queued", "accepted", "closed"]},
            "waiting": {**_TEXT, "description": "Why it is not handed out to the broker."},
            "mission_status_id": _STATUS,
            "mission_status_name": _TEXT,
            "message": _TEXT,
            "command_array": {"type": "array", "items": command},
        },
        "required": ["mission_id", "vehicle_id", "dispatch_state", "mission_status_id"],
    }
    return _with(
        schema,
        {
            "id": _ID,
            "plan_id": _TEXT,
            "received_at": _TIME,
            "expires_at": _TIME,
            "plan_status_id": _STATUS,
            "plan_status_name": _TEXT,
            "missions": {"type": "array", "items": mission},
            "warnings": {"type": "array", "items": warning},
        },
        closed=False,
    )


def _stored_event(schema: Mapping[str, Any]) -> dict[str, Any]:
    return _with(
        schema,
        {
            "id": _ID,
            "event_type_name": _TEXT,
            "received_at": _TIME,
            "expires_at": _TIME,
            "state": {"enum": [state.value for state in State]},
        },
        closed=False,
    )


def _bulk() -> dict[str, Any]:
    """Schemas of `/telemetry/`."""
    envelopes = [
        {
            "type": "object",
            "properties": {
                kind.value: {"$ref": REFERENCE.format(model=name_of(kind))},
                "idempotency_key": {"type": "string", "pattern": "^[!-~]{1,64}$"},
            },
            "required": [kind.value],
            "additionalProperties": False,
        }
        for kind in TELEMETRY
        if issubclass(MODELS[kind], Report)
    ]
    judged_alone = {"description": "Anything else: it spoils nothing but its own entry."}
    receipt = {
        "type": "object",
        "properties": {"status": {"enum": [201, 403, 409, 422, 507]}},
        "required": ["status"],
    }
    return {
        "Reports": {
            "type": "object",
            "properties": {
                "records": {
                    "type": "array",
                    "items": {"anyOf": [*envelopes, judged_alone]},
                    "minItems": 1,
                    "maxItems": 500,
                }
            },
            "required": ["records"],
            "additionalProperties": False,
        },
        "Receipts": {
            "type": "object",
            "properties": {"records": {"type": "array", "items": receipt}},
            "required": ["records"],
        },
    }


def _keys() -> dict[str, Any]:
    """Schemas of `/keys/`."""
    moment = {"type": ["string", "null"], "format": "date-time"}
    key: dict[str, Any] = {
        "type": "object",
        "properties": {
            "prefix": _TEXT,
            "name": _TEXT,
            "role": {"$ref": REFERENCE.format(model="Role")},
            "scopes": {"type": "array", "items": {"$ref": REFERENCE.format(model="Scope")}},
            "vehicle_ids": {"type": ["array", "null"], "items": _ID},
            "state": {"enum": ["active", "expired", "revoked"]},
            "created_at": _TIME,
            "expires_at": moment,
            "revoked_at": moment,
        },
    }
    key["required"] = list(key["properties"])
    return {"AccessKey": key, "NewAccessKey": _with(key, {"key": _TEXT}, closed=False)}


def _dead_letters() -> dict[str, Any]:
    """Schemas of `/dead_letters/`."""
    record = {
        "type": "object",
        "properties": {"id": _ID, "message_id": _TEXT, "received_at": _TIME},
        "required": ["id", "message_id", "received_at"],
    }
    letter = {
        "type": "object",
        "properties": {
            "id": _ID,
            "kind": {"enum": [*(kind.value for kind in TELEMETRY), "gap"]},
            "vehicle_id": _ID,
            "attempts": {"type": "integer", "minimum": 0},
            "reason": _TEXT,
            "report": {"$ref": REFERENCE.format(model="Record")},
        },
        "required": ["id", "kind", "vehicle_id", "attempts", "reason", "report"],
    }
    names = [name_of(kind) for kind in TELEMETRY]
    return {
        "Record": record,
        "DeadLetter": letter,
        "AnyReport": {"anyOf": [{"$ref": REFERENCE.format(model=name)} for name in names]},
        "Retried": {
            "type": "object",
            "properties": {"retried": {"type": "integer", "minimum": 0}},
            "required": ["retried"],
        },
    }


def _work() -> dict[str, Any]:
    """Schemas of the broker's door and of health."""
    return {
        "Work": {
            "type": "object",
            "properties": {
                "cursor": {"type": "integer", "minimum": 0},
                "commands": {"type": "array", "items": {"type": "object"}},
            },
            "required": ["cursor", "commands"],
        },
        "WorkState": {
            "type": "object",
            "properties": {"id": _ID, "state": {"enum": ["queued", "accepted", "closed"]}},
            "required": ["id", "state"],
        },
        "StateVectorRequest": {
            "type": "object",
            "properties": {"id": _ID, "expires_at": _TIME},
            "required": ["id", "expires_at"],
        },
        "Health": {
            "type": "object",
            "properties": {
                "status": _TEXT,
                "database": _TEXT,
                "uplink": {"type": "string", "enum": ["stopped", "open", "blocked", "paused"]},
                "relay_deaths": {"type": "integer", "minimum": 0},
            },
            "required": ["status", "database"],
        },
        "OpenApi": {"type": "object"},
    }
