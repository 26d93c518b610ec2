"""File format of a plan in the vehicle's storage. Pure.

    magic "UAVP" | version | mission type | number of items | items | CRC32 over all before

Little-endian. An item has the layout of `mission_items.plan_id` plus its `current` flag.
"""

import struct
import zlib
from collections.abc import Sequence
from typing import Final

from uav_firmware.modules.mavlink.missions.mission_items import StoredItem

_MAGIC: Final = b"UAVP"
_VERSION: Final = 1
_HEADER: Final = struct.Struct("<4sBBH")
_ITEM: Final = struct.Struct("<BHBB4fiif")
_CHECKSUM: Final = struct.Struct("<I")


class PlanFileError(ValueError):
    """The file is not a valid plan of this type; the message says why."""


def encode(mission_type: int, items: Sequence[StoredItem]) -> bytes:
    """Encode a plan of a MAV_MISSION_TYPE."""
    body = _HEADER.pack(_MAGIC, _VERSION, mission_type, len(items)) + b"".join(
        _ITEM.pack(
            item.frame,
            item.command,
            item.current,
            item.autocontinue,
            *item.parameters,
            item.x,
            item.y,
            item.z,
        )
        for item in items
    )
    return body + _CHECKSUM.pack(zlib.crc32(body))


def decode(mission_type: int, contents: bytes) -> tuple[StoredItem, ...]:
    """Decode the items of a plan.

    Raises:
        PlanFileError: if the file is truncated, damaged, or of another type.
    """
    if len(contents) < _HEADER.size + _CHECKSUM.size:
        raise PlanFileError("the file is truncated")
    body = contents[: -_CHECKSUM.size]
    magic, version, kind, count = _HEADER.unpack_from(body)
    if magic != _MAGIC:
        raise PlanFileError("the file is not a plan")
    if version != _VERSION:
        raise PlanFileError(f"the file has version {version}, not {_VERSION}")
    if len(body) != _HEADER.size + count * _ITEM.size:
        raise PlanFileError("the file is truncated")
    if _CHECKSUM.unpack(contents[-_CHECKSUM.size :]) != (zlib.crc32(body),):
        raise PlanFileError("the file is damaged")
    if kind != mission_type:
        raise PlanFileError(f"the file holds a plan of type {kind}, not {mission_type}")
    return tuple(_item(*fields) for fields in _ITEM.iter_unpack(body[_HEADER.size :]))


def _item(
    frame: int,
    command: int,
    current: int,
    autocontinue: int,
    p1: float,
    p2: float,
    p3: float,
    p4: float,
    x: int,
    y: int,
    z: float,
) -> StoredItem:
    return StoredItem(
        frame=frame,
        command=command,
        current=bool(current),
        autocontinue=autocontinue,
        parameters=(p1, p2, p3, p4),
        x=x,
        y=y,
        z=z,
    )
