"""Mission items for vehicles that know no integer ones."""

from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

_PLAIN_FRAMES: Final = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}
POSITION_STEP_DEG: Final = 1.6e-5
"""Single precision beyond 128 degrees; some 1.8 m."""
_FLOATS: Final[int] = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
_INTEGERS: Final[int] = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT


def floats_only(capabilities: int) -> bool:
    """Whether a vehicle says in AUTOPILOT_VERSION that it knows items as floats, and only so.

    One that says neither is taken for a usual one: asking by MISSION_REQUEST(40) proves nothing.
    """
    return capabilities & (_FLOATS | _INTEGERS) == _FLOATS


def in_floats(item: Message) -> Message:
    """Give the MISSION_ITEM(39) that says the same as a MISSION_ITEM_INT(73), less exactly."""
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
