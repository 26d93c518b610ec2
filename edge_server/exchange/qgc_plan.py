"""QGroundControl's `.plan`: JSON with a mission, a fence and rally points. Pure.

File format: docs.qgroundcontrol.com, "Plan File Format". A survey or corridor carries the items
that it expands to, and these are read; other complex items carry none and are refused.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from afarcloud.faults import Fault, InvalidError
from edge_server.exchange import qgc_fence
from edge_server.exchange.mission_item import EXTRA, Home, Item, MissionFile

FILE_TYPE: Final = "Plan"
EXPANDED: Final = frozenset({"survey", "CorridorScan"})
MISSION_VERSION: Final = 2
PX4: Final = 12
ARDUPILOT: Final = 3
_NUMBERS: Final = 7
_FARTHEST: Final = 1e9
_LARGEST_CODE: Final = 65_535
_LONGEST_NAME: Final = 40


def read(document: Any) -> MissionFile:
    """Read a parsed file.

    Raises:
        InvalidError: naming each part that is wrong, and why.
    """
    if not isinstance(document, dict) or document.get("fileType") != FILE_TYPE:
        raise InvalidError((Fault("fileType", f"must be {FILE_TYPE}"),))
    if document.get("version") != 1:
        raise InvalidError((Fault("version", "must be version 1"),))
    mission = document.get("mission")
    if not isinstance(mission, dict) or mission.get("version") != MISSION_VERSION:
        raise InvalidError((Fault("mission.version", f"must be version {MISSION_VERSION}"),))
    geofence, warnings = qgc_fence.read(document.get("geoFence"))
    missing: list[Fault] = []
    return MissionFile(
        _items(mission.get("items"), missing),
        _home(mission.get("plannedHomePosition")),
        _speed(mission.get("hoverSpeed")),
        zero_yaw_is_unset=mission.get("firmwareType") == ARDUPILOT,
        geofence=geofence,
        rally_points=qgc_fence.read_rally(document.get("rallyPoints")),
        warnings=tuple(warnings),
        missing=tuple(missing),
    )


def _home(position: Any) -> Home | None:
    if position is None:
        return None
    if (
        not isinstance(position, list)
        or len(position) != 3
        or not all(_is_number(one) for one in position[:2])
        or not (position[2] is None or _is_number(position[2]))
    ):
        message = "must be latitude, longitude and altitude above sea level"
        raise InvalidError((Fault("mission.plannedHomePosition", message),))
    return Home(*position)


def _speed(value: Any) -> float | None:
    return float(value) if _is_number(value) and value > 0 else None


def _is_number(value: Any) -> bool:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and -_FARTHEST < value < _FARTHEST


def _items(raw: Any, missing: list[Fault]) -> list[Item]:
    """Every simple item, those inside of complex ones in their place; what is missing is noted."""
    if not isinstance(raw, list):
        raise InvalidError((Fault("mission.items", "must be a list of items"),))
    items: list[Item] = []
    faults: list[Fault] = []
    for path, simple in _flat(raw, faults, missing):
        try:
            items.append(_item(simple, path, len(items) + 1))
        except ValueError as error:
            faults.append(Fault(path, f"item {len(items) + 1} {error}"))
    if faults:
        raise InvalidError(tuple(faults))
    return items


def _flat(raw: list[Any], faults: list[Fault], missing: list[Fault]) -> Iterator[tuple[str, Any]]:
    for index, item in enumerate(raw):
        path = f"mission.items.{index}"
        kind = item.get("type") if isinstance(item, dict) else None
        if kind == "SimpleItem":
            yield path, item
        elif kind != "ComplexItem":
            faults.append(Fault(f"{path}.type", "must be SimpleItem or ComplexItem"))
        else:
            inner = _inside(item)
            if inner is None:
                found = missing if _kind(item) in EXPANDED else faults
                found.append(Fault(path, _why_not(item, index + 1)))
                continue
            for place, one in enumerate(inner):
                yield f"{path}.TransectStyleComplexItem.Items.{place}", one


def _inside(item: Mapping[str, Any]) -> list[Any] | None:
    """Return the items that a complex one expands to; None if it does not list them."""
    if _kind(item) not in EXPANDED:
        return None
    transects = item.get("TransectStyleComplexItem")
    inner = transects.get("Items") if isinstance(transects, dict) else None
    return inner if isinstance(inner, list) and inner else None


def _why_not(item: Mapping[str, Any], number: int) -> str:
    kind = _kind(item)
    if kind in EXPANDED:
        return f"item {number} ({kind}) has no items inside; save it with a newer QGroundControl"
    return f"item {number} ({kind}) does not carry the items that it expands to"


def _kind(item: Mapping[str, Any]) -> str:
    kind = item.get("complexItemType")
    is_name = isinstance(kind, str) and kind.isalnum() and len(kind) < _LONGEST_NAME
    return str(kind) if is_name else "unknown"


def _item(simple: Any, path: str, number: int) -> Item:
    """Read a simple item; raises ValueError with the reason."""
    if not isinstance(simple, dict):
        raise ValueError("must be an object")  # noqa: TRY004  # one kind of error for all reasons
    command, frame = _whole(simple, "command"), _whole(simple, "frame")
    parameters = simple.get("params")
    if not isinstance(parameters, list) or len(parameters) != _NUMBERS:
        raise ValueError(f"must have {_NUMBERS} params")
    if not all(one is None or _is_number(one) for one in parameters):
        raise ValueError("must have numbers or null for params")
    extra = simple.get(EXTRA)
    return Item(
        path=path,
        number=number,
        command=command,
        frame=frame,
        parameters=tuple(None if one is None else float(one) for one in parameters),
        auto_continue=simple.get("autoContinue", True) is True,
        extra=extra if isinstance(extra, dict) else {},
    )


def _whole(simple: Mapping[str, Any], name: str) -> int:
    value = simple.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _LARGEST_CODE:
        raise ValueError(f"must have a whole number for {name}")
    return value


def write(
    items: list[Item],
    home: Home,
    speed_m_s: float,
    geofence: Mapping[str, Any] | None,
    rally_points: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Write a file that QGroundControl opens."""
    return {
        "fileType": FILE_TYPE,
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": MISSION_VERSION,
            "firmwareType": PX4,
            "vehicleType": 2,
            "cruiseSpeed": 15,
            "hoverSpeed": speed_m_s,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.altitude_amsl_m],
            "items": [_simple(item) for item in items],
        },
        "geoFence": qgc_fence.write(geofence),
        "rallyPoints": qgc_fence.write_rally(rally_points),
    }


def _simple(item: Item) -> dict[str, Any]:
    simple: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": int(item.command),
        "doJumpId": item.number,
        "frame": int(item.frame),
        "params": list(item.parameters),
    }
    if item.has_place:
        simple |= {
            "AMSLAltAboveTerrain": None,
            "Altitude": item.parameters[6],
            "AltitudeMode": 1,
        }
    return {**simple, EXTRA: dict(item.extra)} if item.extra else simple
