"""Missions as the navigator flies them. Written by mavlink, read by navigator."""

from typing import NamedTuple


class MissionItem(NamedTuple):
    """One item in degrees and metres, with MAVLink's numbers for command and frame.

    Positional parameters hold NaN where the uploader left them unset.
    """

    seq: int  # [-] From 0, contiguous
    command: int  # [-] MAV_CMD
    frame: int  # [-] MAV_FRAME, one of 0 AMSL, 3 relative to home, 2 no position
    current: bool
    autocontinue: bool
    param1: float
    param2: float
    param3: float
    param4: float
    x: float  # [deg] Latitude in a global frame, else parameter 5
    y: float  # [deg] Longitude in a global frame, else parameter 6
    z: float  # [m] Altitude by frame, else parameter 7


class Mission(NamedTuple):
    """A complete, accepted mission; replaces the former one at once."""

    time_us: int  # [us] Of acceptance
    mission_id: int  # [-] CRC32 over the items, MAVLink opaque id; 0 when empty
    items: tuple[MissionItem, ...]


class MissionRejection(NamedTuple):
    """Why a mission cannot be flown: becomes MISSION_ACK and STATUSTEXT."""

    seq: int  # [-] Of the faulty item
    result: int  # [-] MAV_MISSION_RESULT
    reason: str


class MissionProgress(NamedTuple):
    """Where the mission is. Written by navigator on change; read by mavlink, commander."""

    time_us: int  # [us]
    mission_id: int  # [-] Of the mission meant
    seq_current: int  # [-] Item being flown or next to fly
    seq_total: int  # [-] Number of items
    seq_reached: int  # [-] Last item reached, -1 for none
    reached_count: int  # [-] Grows at each item reached
    state: int  # [-] MISSION_STATE: 1 none, 2 not started, 3 active, 4 paused, 5 complete
