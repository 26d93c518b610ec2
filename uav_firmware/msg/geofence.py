"""Where the vehicle may be, and whether it is there."""

from enum import IntEnum
from typing import NamedTuple

from uav_firmware.msg.mission import MissionItem


class Fence(NamedTuple):
    """A complete, accepted geofence; replaces the former one at once."""

    time_us: int  # [us] Of acceptance
    fence_id: int  # [-] CRC32 over the items; 0 when empty
    items: tuple[MissionItem, ...]


class RallyPoints(NamedTuple):
    """Complete, accepted rally points; replace the former ones at once."""

    time_us: int  # [us] Of acceptance
    rally_id: int  # [-] CRC32 over the items; 0 when empty
    items: tuple[MissionItem, ...]


class FenceBreach(IntEnum):
    """MAVLink's FENCE_BREACH."""

    NONE = 0
    MIN_ALTITUDE = 1
    MAX_ALTITUDE = 2
    BOUNDARY = 3


class FenceAction(IntEnum):
    """What a breach asks for; the numbers of GF_ACTION are PX4's."""

    NONE = 0
    WARN = 1
    HOLD = 2
    RETURN = 3
    TERMINATE = 4
    LAND = 5


class GeofenceStatus(NamedTuple):
    """Whether the vehicle is where it may be. Written by navigator; read by commander, mavlink.

    `breach` and `predicted` are not set on the ground.
    """

    time_us: int  # [us]
    breach: FenceBreach  # Present; NONE inside
    predicted: FenceBreach  # Where a stop from the present motion would end, else the present
    action: FenceAction  # Of GF_ACTION
    margin_m: float  # [m] To the nearest horizontal boundary, negative beyond; inf without one
    breach_count: int  # [-] Breaches since the start
    breach_time_us: int  # [us] Of the last one; 0 when there was none
    enabled: bool = True  # Not switched off by DO_FENCE_ENABLE
