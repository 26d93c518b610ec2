"""The farm as GeoJSON (RFC 7946): boundaries, crop rows, drip lines, tracks, buildings, trees."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final, NamedTuple

from sim.world.farm import Farm
from sim.world.geometry import chord
from sim.world.layout import BUILDINGS, TRACKS, TREES, YARD, Building, Field
from sim.world.plane import Place, Plane

_DECIMALS: Final = 8  # 1 mm
_SHORTEST_ROW_SPACING_M: Final = 0.5  # Grain is drilled so closely that no map shows its rows


class Row(NamedTuple):
    """A straight line across a field, from edge to edge."""

    number: int  # [-] Row k lies at k row spacings across, counted from the map's origin
    start: Place  # [m]
    end: Place  # [m]
    irrigated: bool  # A drip line lies along it


def rows(field: Field) -> Iterator[Row]:
    """The rows of a field, from left to right of their bearing; none where nothing is sown so."""
    if field.row_spacing_m <= 0.0:
        return
    east, north = field.across
    offsets = [corner.east_m * east + corner.north_m * north for corner in field.boundary]
    first = math.ceil(min(offsets) / field.row_spacing_m)
    last = math.floor(max(offsets) / field.row_spacing_m)
    for number in range(first, last + 1):
        offset = number * field.row_spacing_m
        ends = chord(field.boundary, Place(offset * east, offset * north), field.row_bearing_deg)
        if ends is not None:
            yield Row(number, *ends, irrigated=is_irrigated(field, number))


def is_irrigated(field: Field, number: int) -> bool:
    """Whether a drip line lies along a row."""
    return field.drip_every > 0 and number % field.drip_every == 0


def farm_geojson(farm: Farm) -> dict[str, Any]:
    """A FeatureCollection of everything that stays in its place."""
    features = [
        *_fields(farm),
        *_rows(farm),
        *_surroundings(farm.plane),
    ]
    return {"type": "FeatureCollection", "features": features}


def _fields(farm: Farm) -> Iterator[dict[str, Any]]:
    for field in farm.fields:
        yield _feature(
            _polygon(farm.plane, field.boundary),
            kind="field",
            name=field.name,
            number=field.number,
            cover=field.cover.value,
            area_ha=round(field.area_m2 * 1e-4, 3),
            row_bearing_deg=field.row_bearing_deg,
            row_spacing_m=field.row_spacing_m,
        )


def _rows(farm: Farm) -> Iterator[dict[str, Any]]:
    for field in farm.fields:
        if field.row_spacing_m < _SHORTEST_ROW_SPACING_M:
            continue
        for row in rows(field):
            line = _line(farm.plane, (row.start, row.end))
            yield _feature(line, kind="crop_row", field=field.number, row=row.number)
            if row.irrigated:
                yield _feature(line, kind="drip_line", field=field.number, row=row.number)


def _surroundings(plane: Plane) -> Iterator[dict[str, Any]]:
    yield _feature(_polygon(plane, YARD), kind="yard", name="Yard")
    for track in TRACKS:
        yield _feature(
            _line(plane, track.centre_line), kind="track", name=track.name, width_m=track.width_m
        )
    for building in BUILDINGS:
        yield _feature(
            _polygon(plane, _outline(building)),
            kind="building",
            name=building.name,
            height_m=building.height_m,
        )
    for tree in TREES:
        point = {"type": "Point", "coordinates": _position(plane, tree.middle)}
        yield _feature(point, kind="tree", height_m=tree.height_m, radius_m=round(tree.radius_m, 2))


def _outline(building: Building) -> Sequence[Place]:
    bearing = math.radians(building.bearing_deg)
    sine, cosine = math.sin(bearing), math.cos(bearing)
    half_length, half_width = 0.5 * building.length_m, 0.5 * building.width_m
    corners = ((1, 1), (1, -1), (-1, -1), (-1, 1))  # Along, to the right
    return [
        Place(
            building.middle.east_m + a * half_length * sine + b * half_width * cosine,
            building.middle.north_m + a * half_length * cosine - b * half_width * sine,
        )
        for a, b in corners
    ]


def _feature(geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _polygon(plane: Plane, ring: Sequence[Place]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [_positions(plane, [*ring, ring[0]])]}


def _line(plane: Plane, line: Iterable[Place]) -> dict[str, Any]:
    return {"type": "LineString", "coordinates": _positions(plane, line)}


def _positions(plane: Plane, places: Iterable[Place]) -> list[list[float]]:
    return [_position(plane, place) for place in places]


def _position(plane: Plane, place: Place) -> list[float]:
    latitude_deg, longitude_deg = plane.geodetic(place)
    return [round(longitude_deg, _DECIMALS), round(latitude_deg, _DECIMALS)]
