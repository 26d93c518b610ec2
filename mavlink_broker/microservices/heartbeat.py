"""When our own heartbeat is due, and whether a vehicle's is still heard.

Type 18, onboard controller, unless a vehicle asks for a ground station, 6: one that loses its last
ground station may be told to return home, but a mission must survive a broker that dies.
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
"""MAV_TYPE of what sends heartbeats and cannot fly a mission."""


class LinkState(StrEnum):
    """How fresh a vehicle's heartbeat is; the values are the edge server's."""

    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


AUTOPILOT: Final[int] = mavlink.MAV_COMP_ID_AUTOPILOT1
_OF_USERS: Final = re.compile("MAV_COMP_ID_(USER[0-9]+|AUTOPILOT1)")
OTHER_PARTS: Final = frozenset(
    number
    for number, entry in mavlink.enums["MAV_COMPONENT"].items()
    if _OF_USERS.fullmatch(entry.name) is None
)
"""Component ids that belong to something else than an autopilot: companions, cameras, gimbals."""


def is_vehicle(message: Message) -> bool:
    """Whether a HEARTBEAT is that of an autopilot which flies.

    A companion computer may call itself a generic autopilot; its component id says what it is.
    """
    is_autopilot = message.autopilot != mavlink.MAV_AUTOPILOT_INVALID
    is_part = message.get_srcComponent() in OTHER_PARTS
    return is_autopilot and not is_part and message.type not in NOT_VEHICLES


def is_elected(component: int, before: int | None) -> bool:
    """Whether a component is the system's autopilot, instead of the one that was taken for it."""
    return before is None or (component == AUTOPILOT and before != AUTOPILOT)


def own_heartbeat(kind: int = mavlink.MAV_TYPE_ONBOARD_CONTROLLER) -> Message:
    """HEARTBEAT(0) of the broker, as a MAV_TYPE."""
    return mavlink.MAVLink_heartbeat_message(
        kind,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )


class OwnHeartbeat:
    """Gives our heartbeat once a second."""

    def __init__(self) -> None:
        self._due_at: float | None = None
        self._kind: int | None = None

    def tick(self, now: float, kind: int = mavlink.MAV_TYPE_ONBOARD_CONTROLLER) -> list[Message]:
        """Send it if it is time, or if we are something else now."""
        if self._due_at is not None and now < self._due_at and kind == self._kind:
            return []
        self._due_at, self._kind = now + INTERVAL_S, kind
        return [own_heartbeat(kind)]


class LinkWatch:
    """Judges one vehicle's link by the age of its own heartbeat, and by nothing else.

    A radio modem that goes on talking must not make a dead vehicle look alive.
    """

    def __init__(self) -> None:
        self._heard_at: float | None = None

    def heard(self, now: float) -> None:
        """Take a heartbeat of the vehicle."""
        self._heard_at = now

    def state(self, now: float) -> LinkState:
        """Judge the link; before the first heartbeat it is lost."""
        if self._heard_at is None or now - self._heard_at > LOST_AFTER_S:
            return LinkState.LOST
        if now - self._heard_at > STALE_AFTER_S:
            return LinkState.STALE
        return LinkState.CONNECTED
