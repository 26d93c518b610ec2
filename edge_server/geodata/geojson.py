"""Field boundaries as GeoJSON (RFC 7946): longitude first, rings closed, WGS-84. Pure.

Every polygon is a field; points, lines and features without a place are left out. A feature's own
name becomes the field's; a MultiPolygon of several becomes several fields, numbered. Exclusions,
for which GeoJSON has no type, are in the property `exclusions` as rings like those of a polygon;
the property `entry` is a position.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from afarcloud.faults import Fault, InvalidError
from afarcloud.plan import Vertex
from edge_server.geodata.rings import (
    MOST_FIELDS,
    MOST_RINGS,
    Boundary,
    FieldFile,
    NoAreaError,
    field_file,
    fields_of,
)

MEDIA_TYPE: Final = "application/geo+json"
TYPES: Final = frozenset(
    {
        "Feature",
        "FeatureCollection",
        "GeometryCollection",
        "LineString",
        "MultiLineString",
        "MultiPoint",
        "MultiPolygon",
        "Point",
        "Polygon",
    }
)
_NO_AREAS: Final = frozenset({"Point", "MultiPoint", "LineString", "MultiLineString"})
_WGS84: Final = frozenset(
    {"urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:OGC::CRS84", "EPSG:4326"}
)
_FAR: Final = 1e12
_NAMES: Final = ("name", "Name", "title", "id")


def is_geojson(document: Any) -> bool:
    """Whether a parsed document claims to be GeoJSON."""
    kind = document.get("type") if isinstance(document, dict) else None
    return isinstance(kind, str) and kind in TYPES


def read(document: Any) -> FieldFile:
    """Read the boundaries of fields out of a parsed document.

    Raises:
        InvalidError: naming each area that is no boundary, and why; or if there is none.
    """
    if not isinstance(document, dict):
        raise InvalidError((Fault("", "must be a GeoJSON object"),))
    _check_reference_system(document)
    found: list[Boundary] = []
    left_out: list[Fault] = []
    faults: list[Fault] = []
    for path, feature, place in _features(document):
        try:
            found += _boundaries(feature, path, place)
        except NoAreaError as error:
            left_out += error.faults
        except InvalidError as error:
            faults += error.faults
        if len(found) > MOST_FIELDS:
            raise InvalidError((Fault("features", f"make more than {MOST_FIELDS} fields"),))
    return field_file(found, left_out, faults)


def _check_reference_system(document: Mapping[str, Any]) -> None:
    """Check the `crs` of GeoJSON 2008, which RFC 7946 has dropped; its default is accepted."""
    system = document.get("crs")
    if system is None:
        return
    properties = system.get("properties") if isinstance(system, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str) or name not in _WGS84:
        raise InvalidError((Fault("crs", "must be left out: GeoJSON is WGS-84, longitude first"),))


def _features(document: dict[str, Any]) -> Iterator[tuple[str, Any, str]]:
    """Every feature with its path and its geometry's; a bare geometry is a feature by itself."""
    kind = document.get("type")
    if kind == "Feature":
        yield "", document, "geometry."
    elif kind != "FeatureCollection":
        yield "", {"type": "Feature", "geometry": document}, ""
    else:
        features = document.get("features")
        if not isinstance(features, list) or not features:
            raise InvalidError((Fault("features", "must be a list of at least one feature"),))
        for index, feature in enumerate(features):
            yield f"features.{index}.", feature, f"features.{index}.geometry."


def _boundaries(feature: Any, path: str, place: str) -> list[Boundary]:
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise InvalidError((Fault(f"{path}type", "must be Feature"),))
    geometry = feature.get("geometry")
    if geometry is None:
        raise NoAreaError((Fault(f"{path}geometry", "must be a Polygon or MultiPolygon"),))
    if not isinstance(geometry, dict):
        raise InvalidError((Fault(f"{path}geometry", "must be a Polygon or MultiPolygon"),))
    polygons = list(_polygons(geometry, place))
    properties = feature.get("properties")
    properties = properties if isinstance(properties, dict) else {}
    exclusions = _exclusions(properties, f"{path}properties.exclusions")
    if exclusions and len(polygons) > 1:
        message = "applies to one polygon; give each polygon a feature of its own"
        raise InvalidError((Fault(f"{path}properties.exclusions", message),))
    entry = properties.get("entry")
    if entry is None:
        return fields_of(_name(properties, feature), polygons, exclusions)
    place = f"{path}properties.entry"
    if len(polygons) > 1:
        raise InvalidError(
            (Fault(place, "applies to one polygon; give each polygon a feature of its own"),)
        )
    position = (place, _corner(entry, place))
    return fields_of(_name(properties, feature), polygons, exclusions, position)


def _polygons(
    geometry: dict[str, Any], path: str
) -> Iterator[tuple[str, list[tuple[str, list[Vertex]]]]]:
    """Each polygon with its path: rings with theirs, the outer one first."""
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind == "Polygon":
        yield f"{path}coordinates", _rings(coordinates, f"{path}coordinates")
        return
    if kind != "MultiPolygon":
        is_no_area = isinstance(kind, str) and kind in _NO_AREAS
        refusal = NoAreaError if is_no_area else InvalidError
        raise refusal((Fault(f"{path}type", "must be Polygon or MultiPolygon"),))
    if not isinstance(coordinates, list) or not coordinates:
        raise InvalidError((Fault(f"{path}coordinates", "must be a list of polygons"),))
    for index, polygon in enumerate(coordinates):
        yield f"{path}coordinates.{index}", _rings(polygon, f"{path}coordinates.{index}")


def _rings(rings: Any, path: str) -> list[tuple[str, list[Vertex]]]:
    if not isinstance(rings, list) or not rings:
        raise InvalidError((Fault(path, "must be a list of rings, the outer one first"),))
    if len(rings) > MOST_RINGS:
        raise InvalidError((Fault(path, f"has more than {MOST_RINGS} rings"),))
    return [(f"{path}.{index}", _ring(ring, f"{path}.{index}")) for index, ring in enumerate(rings)]


def _ring(ring: Any, path: str) -> list[Vertex]:
    """A closed ring of positions as open ring of corners; RFC 7946, section 3.1.6."""
    if not isinstance(ring, list) or len(ring) < 4:
        raise InvalidError((Fault(path, "must be a list of four or more positions"),))
    corners = [_corner(position, f"{path}.{index}") for index, position in enumerate(ring)]
    if corners[0] != corners[-1]:
        raise InvalidError((Fault(path, "must end where it begins"),))
    return corners[:-1]


def _corner(position: Any, path: str) -> Vertex:
    """A position as (latitude, longitude); a height is passed over, for a field has none."""
    if not isinstance(position, list) or len(position) < 2 or not all(map(_is_number, position)):
        raise InvalidError((Fault(path, "must be a position: longitude, latitude in degrees"),))
    longitude, latitude = float(position[0]), float(position[1])
    if not -180.0 <= longitude <= 180.0:
        raise InvalidError((Fault(f"{path}.0", "must be a longitude, -180 to 180"),))
    if not -90.0 <= latitude <= 90.0:
        message = "must be a latitude, -90 to 90; GeoJSON has the longitude first"
        raise InvalidError((Fault(f"{path}.1", message),))
    return latitude, longitude


def _is_number(value: Any) -> bool:
    """Whether it is a finite number; a bool is none."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and -_FAR < value < _FAR


def _name(properties: Mapping[str, Any], feature: Mapping[str, Any]) -> str | None:
    wanted = [properties.get(name) for name in _NAMES] + [feature.get("id")]
    return next((str(one) for one in wanted if isinstance(one, (str, int)) and str(one)), None)


def _exclusions(properties: Mapping[str, Any], path: str) -> list[tuple[str, list[Vertex]]]:
    rings = properties.get("exclusions")
    return [] if rings in (None, []) else _rings(rings, path)


def write(fields: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Write fields as they are shown (id, name, boundary, ...) as a FeatureCollection."""
    return {"type": "FeatureCollection", "features": [write_one(field) for field in fields]}


def write_one(field: Mapping[str, Any]) -> dict[str, Any]:
    """Write one field as a Feature; everything but its rings becomes a property.

    The outer ring runs anticlockwise and holes clockwise, as RFC 7946 requires.
    """
    rings = [_closed(field["boundary"], anticlockwise=True)]
    rings += [_closed(ring, anticlockwise=False) for ring in field.get("holes", ())]
    shape = {"boundary", "holes", "exclusions", "entry"}
    properties = {name: value for name, value in field.items() if name not in shape | {"id"}}
    if exclusions := field.get("exclusions"):
        properties["exclusions"] = [_closed(ring, anticlockwise=True) for ring in exclusions]
    if (entry := field.get("entry")) is not None:
        properties["entry"] = [entry[1], entry[0]]
    return {
        "type": "Feature",
        "id": field["id"],
        "geometry": {"type": "Polygon", "coordinates": rings},
        "properties": properties,
    }


def _closed(ring: Sequence[Sequence[float]], *, anticlockwise: bool) -> list[list[float]]:
    corners = [[longitude, latitude] for latitude, longitude in ring]
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    turns_left = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) > 0.0
    if turns_left != anticlockwise:
        corners = [corners[0], *reversed(corners[1:])]
    return [*corners, corners[0]]
