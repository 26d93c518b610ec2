"""Parameters given by place instead of by name: `p1` to `p11`, and `param_array`.

AFarCloud's planner writes longitude first, its information model latitude first, so an array
with a position in it must state which: `"param_order": "lat_lon"` or `"lon_lat"`.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Final, TypeVar

from afarcloud.enumerations import CommandType, EventType
from afarcloud.faults import Fault
from afarcloud.importers.document import Imported

_Kind = TypeVar("_Kind", CommandType, EventType)

UNSET_FROM: Final = 1e308
"""AFarCloud's middleware writes Double.MAX_VALUE where a number was not given."""

LATITUDE, LONGITUDE = "latitude", "longitude"
ORDERS: Final = {"lat_lon": (LATITUDE, LONGITUDE), "lon_lat": (LONGITUDE, LATITUDE)}
_CORNERS: Final = 4

PARAMETERS: Final[dict[CommandType, tuple[str, ...]]] = {
    CommandType.NAV_TAKEOFF: ("minimum_pitch", "yaw_angle", LATITUDE, LONGITUDE, "altitude"),
    CommandType.NAV_LAND: (
        "minimum_target_altitude",
        "precision_land_mode",
        "desired_yaw_angle",
        LATITUDE,
        LONGITUDE,
        "landing_altitude",
    ),
    CommandType.NAV_WAYPOINT: (
        "hold_time",
        "acceptance_radius",
        "trajectory_control",
        "desired_yaw_angle",
        LATITUDE,
        LONGITUDE,
        "altitude",
    ),
    CommandType.CAMERA_IMAGE: ("yaw_angle", "pitch_angle", "photo_count", "time_interval"),
    CommandType.VIDEO_START_CAPTURE: ("video_stream_id", "freq"),
    CommandType.VIDEO_STOP_CAPTURE: ("video_stream_id",),
    CommandType.NAV_HOTPOINT: (
        LATITUDE,
        LONGITUDE,
        "orbit_altitude",
        "radius",
        "angular_velocity",
        "is_clockwise",
        "start_point",
        "orbit_type",
    ),
    CommandType.NAV_FOLLOW_TARGET: (LATITUDE, LONGITUDE, "altitude", "heading"),
    CommandType.NAV_TRACK_SUBJECT: ("left", "top", "right", "bottom", "track_mode"),
    CommandType.CAMERA_PANORAMA: ("panorama_mode",),
    CommandType.NAV_HOME: ("landing",),
}
"""Names in the order of `param_array`, latitude first."""

_ABORT: Final = (LATITUDE, LONGITUDE, "altitude")
_BOOLEANS: Final = frozenset({"is_clockwise", "landing"})
_SLOTS: Final = tuple(f"p{number}" for number in range(1, len(CommandType) + 1))
_EVENT_SLOTS: Final = ("p1", "p2")


def import_command(command: dict[str, Any], path: str, imported: Imported) -> None:
    """Give a command its `parameters` by name; faults and new names go to `imported`."""
    kind = _type_of(command, "command_type_id", CommandType)
    if kind is None:
        return  # The model reports the fault of the type
    own = f"p{kind.value}"
    for slot in _SLOTS:
        if slot in command and slot != own and command.pop(slot) is not None:
            imported.refuse(f"{path}.{slot}", f"goes with command_type_id {slot[1:]}")
    forms = [name for name in ("parameters", own, "param_array") if name in command]
    if len(forms) > 1:
        imported.refuse(f"{path}.{forms[1]}", f"means the same as {forms[0]}: give one of them")
    elif forms == [own]:
        command["parameters"] = command.pop(own)
        imported.rename(f"{path}.parameters", f"{path}.{own}")
    elif forms == ["param_array"]:
        _import_array(command, PARAMETERS[kind], path, imported)


def _import_array(
    command: dict[str, Any], names: Sequence[str], path: str, imported: Imported
) -> None:
    values, order = command.pop("param_array"), command.pop("param_order", None)
    fault = _array_fault(values, order, names, path)
    if fault is not None:
        imported.refuse(fault.path, fault.message, unread=f"{path}.parameters")
        return
    parameters: dict[str, Any] = {}
    for index, (name, value) in enumerate(zip(_ordered(names, order), values, strict=True)):
        if not is_unset(value):
            parameters[name] = bool(value) if name in _BOOLEANS and value in (0, 1) else value
        imported.rename(f"{path}.parameters.{name}", f"{path}.param_array.{index}")
    if "left" in names:
        corners = [parameters.pop(name, None) for name in names[:_CORNERS]]
        parameters["corners"] = [corners[:2], corners[2:]]
    command["parameters"] = parameters
    imported.rename(f"{path}.parameters", f"{path}.param_array")


def _array_fault(values: Any, order: Any, names: Sequence[str], path: str) -> Fault | None:
    """What is wrong with an array as a whole."""
    if not isinstance(values, list):
        return Fault(f"{path}.param_array", "must be an array of numbers")
    if len(values) != len(names):
        return Fault(f"{path}.param_array", f"must have {len(names)} numbers, not {len(values)}")
    if order is None and LATITUDE in names:
        return Fault(f"{path}.param_order", "is required with param_array: lat_lon or lon_lat")
    if order is not None and order not in ORDERS:
        return Fault(f"{path}.param_order", "must be lat_lon or lon_lat")
    return None


def _ordered(names: Sequence[str], order: str | None) -> Iterator[str]:
    """The names with latitude and longitude as the sender orders them."""
    pair = iter(ORDERS[order or "lat_lon"])
    for name in names:
        yield next(pair) if name in {LATITUDE, LONGITUDE} else name


def is_unset(value: Any) -> bool:
    """Whether a number of an array means "not given"."""
    if value is None:
        return True
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and abs(value) >= UNSET_FROM


def import_event(event: dict[str, Any], imported: Imported) -> None:
    """Give an event its `abort` or `maximum_speed` by name."""
    kind = _type_of(event, "event_type_id", EventType)
    if kind is None:
        return
    wants_speed = kind is EventType.DRONE_SPEED
    if "param_array" in event:
        _import_event_array(event, imported, wants_speed=wants_speed)
    for slot, name in zip(_EVENT_SLOTS, ("abort", "maximum_speed"), strict=True):
        if slot not in event:
            continue
        value = event.pop(slot)
        if value is None or (slot == "p1" and _is_nowhere(value)):
            continue
        if name in event:
            imported.refuse(slot, f"means the same as {name}: give one of them")
            continue
        event[name] = value
        imported.rename(name, slot)


def _import_event_array(event: dict[str, Any], imported: Imported, *, wants_speed: bool) -> None:
    values, order = event.pop("param_array"), event.pop("param_order", None)
    if not isinstance(values, list) or len(values) != len(_ABORT):
        fault = f"must be an array of {len(_ABORT)} numbers"
        imported.refuse("param_array", fault, unread="maximum_speed")
    elif wants_speed:
        event.setdefault("maximum_speed", values[0])
        imported.rename("maximum_speed", "param_array.0")
    elif all(is_unset(value) or value == 0 for value in values):
        return  # AFarCloud sends zeros for an abort without a place
    elif order not in ORDERS:
        imported.refuse("param_order", "is required with param_array: lat_lon or lon_lat")
    else:
        names = list(_ordered(_ABORT, order))
        event.setdefault("abort", dict(zip(names, values, strict=True)))
        imported.rename("abort", "param_array")
        for index, name in enumerate(names):
            imported.rename(f"abort.{name}", f"param_array.{index}")


def _is_nowhere(point: Any) -> bool:
    """Whether a point is the (0, 0, 0) that means none."""
    return isinstance(point, dict) and all(point.get(name) in (0, None) for name in _ABORT)


def _type_of(document: dict[str, Any], name: str, kinds: type[_Kind]) -> _Kind | None:
    number = document.get(name)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        return None
    return next((kind for kind in kinds if kind.value == number), None)
