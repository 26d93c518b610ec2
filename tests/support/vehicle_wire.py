"""The wire of the vehicles in the broker's tests: pymavlink's `ardupilotmega` dialect, unchanged.

The broker reads and writes with a dialect and a codec of its own. What is wrong there must not be
right here by the same mistake, so nothing of the broker is imported. The dialect lacks the plan
ids that PX4 sends since 1.15; they are appended to the payload by hand (MAVLink common.xml:
MISSION_CURRENT 42, MISSION_COUNT 44 and MISSION_ACK 47, extension fields behind all others).
"""

import struct
from typing import Any, Final, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = ["Message", "VehicleWire", "mavlink", "with_plan_ids"]

Message: TypeAlias = Any

_VERSION_1, _VERSION_2 = 0xFE, 0xFD
_FRAME_OVERHEAD: Final = {_VERSION_1: 8, _VERSION_2: 12}
_SIGNATURE_SIZE: Final = 13
_SIGNED: Final = 0x01  # MAVLINK_IFLAG_SIGNED
_PLAN_IDS: Final = "_plan_ids"


def with_plan_ids(message: Message, *plan_ids: int) -> Message:
    """Append the ids of stored plans (0: none) to a message, in the order of its extensions."""
    setattr(message, _PLAN_IDS, struct.pack(f"<{len(plan_ids)}I", *plan_ids))
    return message


class VehicleWire:
    """Frames and reads MAVLink 2 for one component; version 1 is read too."""

    def __init__(self, system: int, component: int) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)

    def encode(self, message: Message) -> bytes:
        """Give the next frame of this component."""
        plan_ids = getattr(message, _PLAN_IDS, b"")
        frame: bytes
        if plan_ids:
            fields = [getattr(message, name) for name in message.ordered_fieldnames]
            payload = message.unpacker.pack(*fields) + plan_ids
            frame = message._pack(self._codec, message.crc_extra, payload)
        else:
            frame = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        return frame

    def decode(self, datagram: bytes) -> list[Message]:
        """Read every whole frame of a datagram; what is broken is skipped."""
        messages = []
        start = 0
        while start < len(datagram):
            size = _frame_size(datagram[start:])
            if size is None:
                start += 1
                continue
            try:
                messages.append(self._codec.decode(bytearray(datagram[start : start + size])))
            except mavlink.MAVError:
                start += 1
                continue
            start += size
        return [message for message in messages if message.get_msgId() >= 0]


def _frame_size(data: bytes) -> int | None:
    if data[0] not in _FRAME_OVERHEAD or len(data) < _FRAME_OVERHEAD[data[0]]:
        return None
    is_signed = data[0] == _VERSION_2 and data[2] & _SIGNED
    size = _FRAME_OVERHEAD[data[0]] + data[1] + (_SIGNATURE_SIZE if is_signed else 0)
    return size if size <= len(data) else None
