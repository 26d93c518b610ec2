"""The fence of a `.plan`, its circles as polygons on the safe side, and its rally points. Pure."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeGuard

from afarcloud.faults import Fault, InvalidError
from edge_server.exchange.mission_item import EXTRA, Place

VERSION: Final = 2
_OLDEST: Final = 1
CORNERS_OF_A_CIRCLE: Final = 72
_SMALLEST_M, _LARGEST_M = 0.1, 1e6
_RALLY: Final = ("latitude", "longitude", "altitude")


def read(fence: Any) -> tuple[dict[str, Any] | None, list[Fault]]:
    """Return a geofence as a document, None for none; and warnings about what is changed.

    Raises:
        InvalidError: naming each part that is wrong.
    """
    if fence is None:
        return None, []
    version = fence.get("version", _OLDEST) if isinstance(fence, dict) else None
    if version == _OLDEST and not isinstance(version, bool):
        message = "is of an old version, which QGroundControl ignores: the plan has no geofence"
        return None, [Fault("geoFence", message)]
    if not isinstance(fence, dict) or version != VERSION:
        raise InvalidError((Fault("geoFence.version", f"must be version {VERSION}"),))
    found: dict[str, Any] = {"inclusion": [], "exclusion": []}
    warnings: list[Fault] = []
    for index, polygon in enumerate(_list(fence, "polygons")):
        path = f"geoFence.polygons.{index}"
        found[_side(polygon, path)].append(_polygon(polygon, path))
    for index, circle in enumerate(_list(fence, "circles")):
        path = f"geoFence.circles.{index}"
        side = _side(circle, path)
        found[side].append(_circle(circle, path, is_inner=side == "inclusion"))
        message = f"becomes a polygon of {CORNERS_OF_A_CIRCLE} corners on the safe side"
        warnings.append(Fault(path, message))
    if fence.get("breachReturn") is not None:
        warnings.append(Fault("geoFence.breachReturn", "is left out: a plan has no such place"))
    extra = fence.get(EXTRA)
    height = extra.get("max_altitude") if isinstance(extra, dict) else None
    if height is not None:
        found["max_altitude"] = height
    return (found if any(found.values()) else None), warnings


def _list(part: Mapping[str, Any], name: str, path: str = "geoFence") -> list[Any]:
    found = part.get(name, [])
    if not isinstance(found, list):
        raise InvalidError((Fault(f"{path}.{name}", "must be a list"),))
    return found


def _side(area: Any, path: str) -> str:
    inclusion = area.get("inclusion") if isinstance(area, dict) else None
    if not isinstance(inclusion, bool):
        raise InvalidError((Fault(f"{path}.inclusion", "must be true or false"),))
    return "inclusion" if inclusion else "exclusion"


def _polygon(area: Mapping[str, Any], path: str) -> Any:
    """The corners as they are; the model validates them."""
    polygon = area.get("polygon")
    if not isinstance(polygon, list):
        raise InvalidError((Fault(f"{path}.polygon", "must be a list of corners"),))
    return polygon


def _circle(area: Mapping[str, Any], path: str, *, is_inner: bool) -> list[list[float]]:
    """Corners on the circle where one stays inside, around it where one stays outside."""
    circle = area.get("circle")
    given = circle if isinstance(circle, dict) else {}
    centre, radius = given.get("center"), given.get("radius")
    if not _is_place(centre) or not _is_number(radius) or not _SMALLEST_M <= radius <= _LARGEST_M:
        message = "must have a center of latitude and longitude and a radius [m]"
        raise InvalidError((Fault(f"{path}.circle", message),))
    step = math.tau / CORNERS_OF_A_CIRCLE
    reach = radius if is_inner else radius / math.cos(step / 2.0)
    middle = Place(centre[0], centre[1], 0.0)
    corners = [
        middle.moved(reach * math.cos(number * step), reach * math.sin(number * step))
        for number in range(CORNERS_OF_A_CIRCLE)
    ]
    return [[corner.latitude_deg, corner.longitude_deg] for corner in corners]


def _is_place(value: Any) -> TypeGuard[list[float]]:
    if not isinstance(value, list) or len(value) != 2 or not all(map(_is_number, value)):
        return False
    latitude, longitude = value
    return bool(-89.9 <= latitude <= 89.9 and -180.0 <= longitude <= 180.0)


def _is_number(value: Any) -> TypeGuard[float]:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and -_LARGEST_M <= value <= _LARGEST_M


def read_rally(rally: Any) -> list[dict[str, Any]]:
    """Give rally points as documents; the model validates their numbers.

    Raises:
        InvalidError: naming each part that is wrong.
    """
    points = _list(rally, "points", "rallyPoints") if isinstance(rally, dict) else []
    return [_rally_point(point, f"rallyPoints.points.{i}") for i, point in enumerate(points)]


def _rally_point(point: Any, path: str) -> dict[str, Any]:
    if not isinstance(point, list) or len(point) != len(_RALLY):
        raise InvalidError((Fault(path, "must be latitude, longitude and altitude"),))
    return dict(zip(_RALLY, point, strict=True))


def write_rally(points: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Write rally points."""
    return {"version": VERSION, "points": [[point[name] for name in _RALLY] for point in points]}


def write(geofence: Mapping[str, Any] | None) -> dict[str, Any]:
    """Write a geofence; its height, which the file has no place for, in a member of our own."""
    fence = geofence or {}
    polygons = [
        {"version": 1, "inclusion": side == "inclusion", "polygon": [list(one) for one in polygon]}
        for side in ("inclusion", "exclusion")
        for polygon in fence.get(side, ())
    ]
    written: dict[str, Any] = {"version": VERSION, "circles": [], "polygons": polygons}
    if fence.get("max_altitude") is not None:
        written[EXTRA] = {"max_altitude": fence["max_altitude"]}
    return written
