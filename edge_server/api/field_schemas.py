"""JSON Schemas of fields and of the GeoJSON that is taken for one. Pure."""

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
        "FieldOrGeoJson": {
            "anyOf": [{"$ref": reference.format(model=name)} for name in ("Field", "GeoJson")]
        },
        "StoredField": stored,
        "StoredFields": {"anyOf": [one, several]},
    }
