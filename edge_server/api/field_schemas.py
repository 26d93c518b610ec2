"""JSON Schemas of fields, surveys and the files of other programs. Pure."""

from typing import Any, Final

_NUMBER: Final = {"type": "number"}
_POSITION: Final = {
    "type": "array",
    "prefixItems": [
        {"type": "number", "minimum": -180, "maximum": 180},
        {"type": "number", "minimum": -90, "maximum": 90},
    ],
    "minItems": 2,
}
_RINGS: Final = {
    "type": "array",
    "items": {"type": "array", "items": _POSITION, "minItems": 4, "maxItems": 1001},
    "minItems": 1,
    "maxItems": 51,
}


def _object(kind: str, **properties: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": {"type": {"const": kind}, **properties},
        "required": ["type", *properties],
    }


_GEOMETRY: Final = {
    "anyOf": [
        _object("Polygon", coordinates=_RINGS),
        _object(
            "MultiPolygon",
            coordinates={"type": "array", "items": _RINGS, "minItems": 1, "maxItems": 100},
        ),
    ]
}
_FEATURE: Final = _object("Feature", geometry=_GEOMETRY)
GEOJSON: Final[dict[str, Any]] = {
    "description": "A boundary as RFC 7946 writes it: longitude first, rings closed.",
    "anyOf": [
        _GEOMETRY,
        _FEATURE,
        _object(
            "FeatureCollection",
            features={"type": "array", "items": _FEATURE, "minItems": 1, "maxItems": 100},
        ),
    ],
}


SURVEY: Final[dict[str, Any]] = {
    "type": "object",
    "description": "Figures of a survey, and its plans in the order of flight.",
    "properties": {
        "area_m2": {"type": "number"},
        "angle_deg": {"type": "number"},
        "lines": {"type": "integer"},
        "line_spacing_m": {"type": "number"},
        "picture_spacing_m": {"type": ["number", "null"]},
        "pictures": {"type": "integer"},
        "flights": {"type": "integer"},
        "length_m": {"type": "number"},
        "duration_s": {"type": "number"},
        "plans": {"type": "array", "items": {"type": "object"}},
    },
    "required": ["area_m2", "angle_deg", "lines", "flights", "length_m", "duration_s", "plans"],
}

PLAN_FILE: Final[dict[str, Any]] = {
    "type": "object",
    "description": "A .plan file of QGroundControl; its own documentation says more.",
    "properties": {
        "fileType": {"const": "Plan"},
        "version": {"const": 1},
        "mission": {
            "type": "object",
            "properties": {
                "version": {"const": 2},
                "items": {"type": "array", "items": {"type": "object"}, "minItems": 1},
            },
            "required": ["version", "items"],
        },
        "geoFence": {"type": "object"},
        "rallyPoints": {"type": "object"},
    },
    "required": ["fileType", "version", "mission"],
}


def components(field: dict[str, Any], reference: str) -> dict[str, Any]:
    """Give the schemas that belong to the one of a field, by name."""
    moment = {"type": "string", "format": "date-time"}
    corner = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}
    ring = {"type": "array", "items": corner, "minItems": 3}
    added = {
        "boundary": ring,
        "holes": {"type": "array", "items": ring},
        "exclusions": {"type": "array", "items": ring},
        "id": {"type": "integer", "minimum": 1},
        "area_m2": _NUMBER,
        "received_at": moment,
        "updated_at": moment,
    }
    stored: dict[str, Any] = {
        "type": "object",
        "properties": {**field["properties"], **added},
        "required": list(added),
    }
    one = {"$ref": reference.format(model="StoredField")}
    several = {
        "type": "object",
        "properties": {"fields": {"type": "array", "items": one, "minItems": 2}},
        "required": ["fields"],
    }
    return {
        "GeoJson": GEOJSON,
        "QGroundControlPlan": PLAN_FILE,
        "Survey": SURVEY,
        "FieldOrGeoJson": {
            "anyOf": [{"$ref": reference.format(model=name)} for name in ("Field", "GeoJson")]
        },
        "StoredField": stored,
        "StoredFields": {"anyOf": [one, several]},
    }
