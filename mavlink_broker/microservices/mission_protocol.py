"""What all transfers of the mission protocol share: kinds of plan, and float items.

A vehicle holds three kinds of plan, by MAV_MISSION_TYPE, each with its own transfers.
"""

from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

MISSION: Final[int] = mavlink.MAV_MISSION_TYPE_MISSION
FENCE: Final[int] = mavlink.MAV_MISSION_TYPE_FENCE
RALLY: Final[int] = mavlink.MAV_MISSION_TYPE_RALLY

PLAN_NAMES: Final = {MISSION: "mission", FENCE: "geofence", RALLY: "rally points"}
ID_NAMES: Final = {MISSION: "mission_id", FENCE: "fence_id", RALLY: "rally_points_id"}
"""Fields of MISSION_CURRENT with the id of each."""


_PLAIN_FRAMES: Final = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}
POSITION_STEP_DEG: Final = 1.6e-5
"""Resolution of single precision beyond 128 degrees; some 1.8 m."""
_FLOATS: Final[int] = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
_INTEGERS: Final[int] = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT


def supports_only_float_items(capabilities: int) -> bool:
    """Whether AUTOPILOT_VERSION reports float items only.

    A vehicle that reports neither kind supports integers: MISSION_REQUEST(40) proves nothing.
    """
    return capabilities & (_FLOATS | _INTEGERS) == _FLOATS


def to_float_item(item: Message) -> Message:
    """Convert a MISSION_ITEM_INT(73) to a MISSION_ITEM(39), which is less precise."""
    scale = 1.0 if item.frame == mavlink.MAV_FRAME_MISSION else 1e7
    return mavlink.MAVLink_mission_item_message(
        item.target_system,
        item.target_component,
        item.seq,
        _PLAIN_FRAMES.get(item.frame, item.frame),
        item.command,
        item.current,
        item.autocontinue,
        *(item.param1, item.param2, item.param3, item.param4),
        *(item.x / scale, item.y / scale, item.z),
        item.mission_type,
    )
