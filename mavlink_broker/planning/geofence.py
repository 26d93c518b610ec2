"""A plan's geofence and rally points as mission items. Pure.

Areas are items of mission type FENCE, rally points of type RALLY. Each corner of a polygon
carries the number of corners, in the order of the outline. Heights are not items: see
`mavlink_broker.autopilots.geofence_parameters`.
"""

from collections.abc import Sequence
from typing import Final

from afarcloud.plan import Geofence, RallyPoint
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem, from_message
from mavlink_broker.microservices.mission_protocol import FENCE, RALLY

CAPABILITIES: Final = {
    FENCE: mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE,
    RALLY: mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY,
}
"""Bits of AUTOPILOT_VERSION for vehicles that store such items."""

TOLERANCE_DEG: Final = 1.5e-7
_ALTITUDE_TOLERANCE_M: Final = 0.011
_HAS_RADIUS: Final = frozenset(
    {mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION}
)


def fence_items(geofence: Geofence | None) -> tuple[MissionItem, ...]:
    """Give the areas of a geofence, inclusions first."""
    if geofence is None:
        return ()
    inclusion: int = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    exclusion: int = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    outlines = [(inclusion, outline) for outline in geofence.inclusion]
    outlines += [(exclusion, outline) for outline in geofence.exclusion]
    return tuple(
        MissionItem(
            command=command,
            frame=mavlink.MAV_FRAME_GLOBAL,
            parameters=(float(len(outline)), 0.0, 0.0, 0.0),
            latitude_deg=latitude,
            longitude_deg=longitude,
        )
        for command, outline in outlines
        for latitude, longitude in outline
    )


def rally_items(points: Sequence[RallyPoint]) -> tuple[MissionItem, ...]:
    """Give rally points, their heights above home."""
    return tuple(
        MissionItem(
            command=mavlink.MAV_CMD_NAV_RALLY_POINT,
            frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
            latitude_deg=point.latitude,
            longitude_deg=point.longitude,
            altitude_m=point.altitude,
        )
        for point in points
    )


def items_of(messages: Sequence[Message]) -> tuple[MissionItem, ...]:
    """Parse downloaded items."""
    return tuple(map(from_message, messages))


def difference(
    wanted: Sequence[MissionItem],
    held: Sequence[MissionItem],
    *,
    tolerance_deg: float = TOLERANCE_DEG,
    altitude_step_m: float = 0.0,
) -> str | None:
    """Name the first difference that matters, or None.

    Frame and altitude of an area have no meaning and may differ; its first parameter is a number of
    corners or a radius. A rally point's altitude may be rounded to steps.
    """
    if len(wanted) != len(held):
        return f"the vehicle holds {len(held)} items instead of {len(wanted)}"
    altitude_m = max(_ALTITUDE_TOLERANCE_M, altitude_step_m)
    for number, (one, other) in enumerate(zip(wanted, held, strict=True)):
        is_rally = one.command == mavlink.MAV_CMD_NAV_RALLY_POINT
        tolerance_m = 0.01 if one.command in _HAS_RADIUS else 0.0
        same = {
            "command": one.command == other.command,
            "parameter 1": abs(one.parameters[0] - other.parameters[0]) <= tolerance_m,
            "latitude": abs(one.latitude_deg - other.latitude_deg) <= tolerance_deg,
            "longitude": abs(one.longitude_deg - other.longitude_deg) <= tolerance_deg,
            "altitude": not is_rally or abs(one.altitude_m - other.altitude_m) <= altitude_m,
        }
        name = next((name for name, is_same in same.items() if not is_same), None)
        if name is not None:
            return f"item {number} on the vehicle differs in {name}"
    return None
