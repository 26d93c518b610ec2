"""Conversion of mission items between messages, storage and navigator.

A stored item has the numbers as uploaded, so that a download returns them bit for bit. The
navigator gets degrees and metres, with NaN where the uploader left a coordinate
unset (INT32_MAX or INT32_MIN).
"""

import math
import struct
import zlib
from collections.abc import Sequence
from typing import Final, NamedTuple

from uav_firmware.modules.mavlink.commands.commands import FRAME_MISSION, GLOBAL_FRAMES, INT32_UNSET
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.msg.mission import MissionItem

_UNSET: Final = frozenset({INT32_UNSET, -0x80000000})
_LAYOUT: Final = struct.Struct("<BHB4fiif")
_INVALID_PARAM1: Final[int] = mavlink.MAV_MISSION_INVALID_PARAM1
_INVALID_X: Final[int] = mavlink.MAV_MISSION_INVALID_PARAM5_X
_INVALID_Y: Final[int] = mavlink.MAV_MISSION_INVALID_PARAM6_Y
_INVALID_Z: Final[int] = mavlink.MAV_MISSION_INVALID_PARAM7


class StoredItem(NamedTuple):
    """Contents of a MISSION_ITEM_INT, without target and sequence number."""

    frame: int  # MAV_FRAME
    command: int  # MAV_CMD
    current: bool
    autocontinue: int
    parameters: tuple[float, float, float, float]
    x: int  # [1e-7 deg] Latitude in a global frame, else parameter 5; see _UNSET
    y: int  # [1e-7 deg] Longitude in a global frame, else parameter 6; see _UNSET
    z: float  # [m] Altitude by frame, else parameter 7


class ItemFault(NamedTuple):
    """Why an item cannot be stored."""

    result: int  # MAV_MISSION_RESULT
    reason: str


def read_item(message: Message) -> StoredItem | ItemFault:
    """Read MISSION_ITEM_INT, or the deprecated MISSION_ITEM with float coordinates."""
    is_global = message.frame in GLOBAL_FRAMES
    if not is_global and message.frame != FRAME_MISSION:
        return ItemFault(
            mavlink.MAV_MISSION_UNSUPPORTED_FRAME, f"frame {message.frame} is not supported"
        )
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        x, y = _as_integer(x, is_global=is_global), _as_integer(y, is_global=is_global)
    item = StoredItem(
        frame=message.frame,
        command=message.command,
        current=bool(message.current),
        autocontinue=message.autocontinue,
        parameters=(message.param1, message.param2, message.param3, message.param4),
        x=x,
        y=y,
        z=message.z,
    )
    return _fault(item, is_global=is_global) or item


def _as_integer(value: float, *, is_global: bool) -> int:
    """Convert a float coordinate to an integer; a value that does not fit becomes invalid."""
    if math.isnan(value):
        return INT32_UNSET
    scaled = value * (1e7 if is_global else 1.0)
    return round(min(max(scaled, -0x80000000 + 1), INT32_UNSET - 1))


def _fault(item: StoredItem, *, is_global: bool) -> ItemFault | None:
    """Invalid number of an item, or None."""
    for i, parameter in enumerate(item.parameters):
        if math.isinf(parameter):
            return ItemFault(_INVALID_PARAM1 + i, f"parameter {i + 1} is infinite")
    if math.isinf(item.z):
        return ItemFault(_INVALID_Z, "parameter 7 is infinite")
    if is_global and item.x not in _UNSET and abs(item.x) > 900_000_000:
        return ItemFault(_INVALID_X, f"latitude {item.x / 1e7} is outside -90..90")
    if is_global and item.y not in _UNSET and abs(item.y) > 1_800_000_000:
        return ItemFault(_INVALID_Y, f"longitude {item.y / 1e7} is outside -180..180")
    return None


def to_message(item: StoredItem, seq: int, *, current: bool, mission_type: int) -> Message:
    """MISSION_ITEM_INT of a stored item; the caller sets the target."""
    return mavlink.MAVLink_mission_item_int_message(
        target_system=0,
        target_component=0,
        seq=seq,
        frame=item.frame,
        command=item.command,
        current=int(current),
        autocontinue=item.autocontinue,
        param1=item.parameters[0],
        param2=item.parameters[1],
        param3=item.parameters[2],
        param4=item.parameters[3],
        x=item.x,
        y=item.y,
        z=item.z,
        mission_type=mission_type,
    )


def for_navigator(items: Sequence[StoredItem]) -> tuple[MissionItem, ...]:
    """Convert items to degrees and metres."""
    return tuple(item_for_navigator(seq, item) for seq, item in enumerate(items))


def item_for_navigator(seq: int, item: StoredItem) -> MissionItem:
    """Convert an item to degrees and metres."""
    scale = 1e7 if item.frame in GLOBAL_FRAMES else 1.0
    return MissionItem(
        seq=seq,
        command=item.command,
        frame=GLOBAL_FRAMES.get(item.frame, FRAME_MISSION),
        current=item.current,
        autocontinue=bool(item.autocontinue),
        param1=item.parameters[0],
        param2=item.parameters[1],
        param3=item.parameters[2],
        param4=item.parameters[3],
        x=math.nan if item.x in _UNSET else item.x / scale,
        y=math.nan if item.y in _UNSET else item.y / scale,
        z=item.z,
    )


def plan_id(items: Sequence[StoredItem]) -> int:
    """MAVLink's opaque id: CRC32 over the items; 0 only for an empty plan.

    The `current` flag is excluded, because it changes while the plan stays the same.
    """
    if not items:
        return 0
    checksum = 0
    for item in items:
        numbers = [math.nan if math.isnan(p) else p for p in (*item.parameters, item.z)]
        packed = _LAYOUT.pack(
            item.frame, item.command, item.autocontinue, *numbers[:4], item.x, item.y, numbers[4]
        )
        checksum = zlib.crc32(packed, checksum)
    return checksum or 1
