"""The broker's heartbeat, and the link state of a vehicle by its heartbeats.

The broker is an onboard controller (type 18), unless a vehicle requires a ground station (type 6):
a vehicle may return home when it loses its last ground station, but a mission must survive a broker
that dies.
"""

import re
from enum import StrEnum
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

INTERVAL_S: Final = 1.0
STALE_AFTER_S: Final = 2.0
LOST_AFTER_S: Final = 5.0

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


class LinkState(StrEnum):
    """State of a vehicle's link by the age of its heartbeat; the values are the edge server's."""

    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


AUTOPILOT: Final[int] = mavlink.MAV_COMP_ID_AUTOPILOT1
_USER_COMPONENT: Final = re.compile("MAV_COMP_ID_(USER[0-9]+|AUTOPILOT1)")
NON_AUTOPILOT_COMPONENTS: Final = frozenset(
    number
    for number, entry in mavlink.enums["MAV_COMPONENT"].items()
    if _USER_COMPONENT.fullmatch(entry.name) is None
)
"""Component ids of companions, cameras, gimbals and other parts that are not an autopilot."""


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


def own_heartbeat(kind: int = mavlink.MAV_TYPE_ONBOARD_CONTROLLER) -> Message:
    """HEARTBEAT(0) of the broker with a MAV_TYPE."""
    return mavlink.MAVLink_heartbeat_message(
        kind,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )


class OwnHeartbeat:
    """Sends the broker's heartbeat once a second."""

    def __init__(self) -> None:
        self._due_at: float | None = None
        self._kind: int | None = None

    def tick(self, now: float, kind: int = mavlink.MAV_TYPE_ONBOARD_CONTROLLER) -> list[Message]:
        """Send it if it is due, or if the type has changed."""
        if self._due_at is not None and now < self._due_at and kind == self._kind:
            return []
        self._due_at, self._kind = now + INTERVAL_S, kind
        return [own_heartbeat(kind)]


class LinkMonitor:
    """State of one vehicle's link by the age of its heartbeat only.

    A radio that continues to send must not make a dead vehicle look connected.
    """

    def __init__(self) -> None:
        self._received_at: float | None = None

    def heartbeat_received(self, now: float) -> None:
        """Take a heartbeat of the vehicle."""
        self._received_at = now

    def state(self, now: float) -> LinkState:
        """Return the state; LOST before the first heartbeat."""
        if self._received_at is None or now - self._received_at > LOST_AFTER_S:
            return LinkState.LOST
        if now - self._received_at > STALE_AFTER_S:
            return LinkState.STALE
        return LinkState.CONNECTED
