"""Which components of a MAVLink system are autopilots, by their ids and heartbeats."""

import re
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

AUTOPILOT: Final[int] = mavlink.MAV_COMP_ID_AUTOPILOT1
_USER_COMPONENT: Final = re.compile("MAV_COMP_ID_(USER[0-9]+|AUTOPILOT1)")
NON_AUTOPILOT_COMPONENTS: Final = frozenset(
    number
    for number, entry in mavlink.enums["MAV_COMPONENT"].items()
    if _USER_COMPONENT.fullmatch(entry.name) is None
)
"""Component ids of companions, cameras, gimbals and other parts that are not an autopilot."""
NOT_VEHICLES: Final = frozenset(
    {
        mavlink.MAV_TYPE_ANTENNA_TRACKER,
        mavlink.MAV_TYPE_GCS,
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_TYPE_GIMBAL,
        mavlink.MAV_TYPE_ADSB,
        mavlink.MAV_TYPE_CAMERA,
        mavlink.MAV_TYPE_CHARGING_STATION,
        mavlink.MAV_TYPE_FLARM,
        mavlink.MAV_TYPE_SERVO,
        mavlink.MAV_TYPE_ODID,
        mavlink.MAV_TYPE_BATTERY,
        mavlink.MAV_TYPE_LOG,
        mavlink.MAV_TYPE_OSD,
        mavlink.MAV_TYPE_IMU,
        mavlink.MAV_TYPE_GPS,
        mavlink.MAV_TYPE_WINCH,
    }
)
"""MAV_TYPEs that send heartbeats and cannot fly a mission."""


def is_vehicle(message: Message) -> bool:
    """Whether a HEARTBEAT is that of a flying vehicle's autopilot.

    A companion computer may report a generic autopilot; its component id distinguishes them.
    """
    is_autopilot = message.autopilot != mavlink.MAV_AUTOPILOT_INVALID
    is_part = message.get_srcComponent() in NON_AUTOPILOT_COMPONENTS
    return is_autopilot and not is_part and message.type not in NOT_VEHICLES


def replaces_autopilot(component: int, before: int | None) -> bool:
    """Whether a component becomes the system's autopilot instead of the one known before."""
    return before is None or (component == AUTOPILOT and before != AUTOPILOT)
