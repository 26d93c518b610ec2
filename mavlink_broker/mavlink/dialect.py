"""MAVLink as bytes and messages: the broker's only importer of pymavlink.

The shipped `all` dialect is the codec: it encodes version 2 and decodes both versions. Messages are
pymavlink's generated classes `mavlink.MAVLink_<name>_message`; `get_type()` returns their name.
Three of them are replaced here, because the shipped dialect lacks
the opaque plan ids of the current message definitions (extension fields: the checksum seed and
the older fields stay as they are, and a sender without them is read as id 0, "not supported").

"""

import struct
from typing import Any, Final, NamedTuple, TypeAlias

from pymavlink.dialects.v20 import all as mavlink

__all__ = [
    "ADDRESSED",
    "MISSION_RESULT_NAMES",
    "RESULT_NAMES",
    "Message",
    "MissionAck",
    "MissionCount",
    "MissionCurrent",
    "Source",
    "mavlink",
    "source_of",
]
Message: TypeAlias = Any
"""An instance of one of pymavlink's generated message classes."""
RESULT_NAMES: Final[dict[int, str]] = {
    **{number: entry.name for number, entry in mavlink.enums["MAV_RESULT"].items()},
    6: "MAV_RESULT_CANCELLED",
    9: "MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME",
    10: "MAV_RESULT_NOT_IN_CONTROL",
}
"""Answers to commands; the shipped dialect lacks the names of 6, 9 and 10."""
MISSION_RESULT_NAMES: Final[dict[int, str]] = {
    number: entry.name for number, entry in mavlink.enums["MAV_MISSION_RESULT"].items()
}
"""Answers to mission transfers."""


class MissionAck(mavlink.MAVLink_mission_ack_message):  # type: ignore[misc]  # codec is untyped
    """MISSION_ACK(47) with the id that the vehicle gave to the stored plan; 0 for none."""

    fieldnames: Final = ["target_system", "target_component", "type", "mission_type", "opaque_id"]
    ordered_fieldnames: Final = fieldnames
    orders: Final = [0, 1, 2, 3, 4]
    lengths: Final = [1] * 5
    array_lengths: Final = [0] * 5
    unpacker: Final = struct.Struct("<BBBBI")

    def __init__(  # the codec fixes names and order
        self,
        target_system: int,
        target_component: int,
        type: int,  # noqa: A002  # MAVLink's name of the field
        mission_type: int = 0,
        opaque_id: int = 0,
    ) -> None:
        super().__init__(target_system, target_component, type, mission_type)
        self._fieldnames = self.fieldnames
        self.opaque_id = opaque_id

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: FBT001, FBT002  # codec
        """Return the frame, with the signature that the codec requires."""
        payload = self.unpacker.pack(
            self.target_system,
            self.target_component,
            self.type,
            self.mission_type,
            self.opaque_id,
        )
        frame: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return frame


class MissionCount(mavlink.MAVLink_mission_count_message):  # type: ignore[misc]  # codec is untyped
    """MISSION_COUNT(44) with the id of the plan that is about to be read; 0 for none."""

    fieldnames: Final = ["target_system", "target_component", "count", "mission_type", "opaque_id"]
    ordered_fieldnames: Final = [
        "count",
        "target_system",
        "target_component",
        "mission_type",
        "opaque_id",
    ]
    orders: Final = [1, 2, 0, 3, 4]
    lengths: Final = [1] * 5
    array_lengths: Final = [0] * 5
    unpacker: Final = struct.Struct("<HBBBI")

    def __init__(
        self,
        target_system: int,
        target_component: int,
        count: int,
        mission_type: int = 0,
        opaque_id: int = 0,
    ) -> None:
        super().__init__(target_system, target_component, count, mission_type)
        self._fieldnames = self.fieldnames
        self.opaque_id = opaque_id

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: FBT001, FBT002  # codec
        """Return the frame, with the signature that the codec requires."""
        payload = self.unpacker.pack(
            self.count,
            self.target_system,
            self.target_component,
            self.mission_type,
            self.opaque_id,
        )
        frame: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return frame


class MissionCurrent(mavlink.MAVLink_mission_current_message):  # type: ignore[misc]  # as above
    """MISSION_CURRENT(42) with the ids of the stored mission, fence and rally points."""

    fieldnames: Final = [
        "seq",
        "total",
        "mission_state",
        "mission_mode",
        "mission_id",
        "fence_id",
        "rally_points_id",
    ]
    ordered_fieldnames: Final = fieldnames
    orders: Final = list(range(7))
    lengths: Final = [1] * 7
    array_lengths: Final = [0] * 7
    unpacker: Final = struct.Struct("<HHBBIII")

    def __init__(
        self,
        seq: int,
        total: int = 0,
        mission_state: int = 0,
        mission_mode: int = 0,
        mission_id: int = 0,
        fence_id: int = 0,
        rally_points_id: int = 0,
    ) -> None:
        super().__init__(seq, total, mission_state, mission_mode)
        self._fieldnames = self.fieldnames
        self.mission_id = mission_id
        self.fence_id = fence_id
        self.rally_points_id = rally_points_id

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: FBT001, FBT002  # codec
        """Return the frame, with the signature that the codec requires."""
        payload = self.unpacker.pack(
            self.seq,
            self.total,
            self.mission_state,
            self.mission_mode,
            self.mission_id,
            self.fence_id,
            self.rally_points_id,
        )
        frame: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return frame


for _message_class in (MissionAck, MissionCount, MissionCurrent):
    mavlink.mavlink_map[_message_class.id] = _message_class

ADDRESSED: Final = frozenset(
    number for number, kind in mavlink.mavlink_map.items() if "target_system" in kind.fieldnames
)
"""Ids of the messages that name a target system."""


class Source(NamedTuple):
    """Who sent a message."""

    system: int
    component: int


def source_of(message: Message) -> Source:
    """Read the sender from a decoded message."""
    return Source(message.get_srcSystem(), message.get_srcComponent())


class Route(NamedTuple):
    """The broker's own ids and those of one vehicle's autopilot."""

    own_system: int
    own_component: int
    target_system: int
    target_component: int

    def is_for_us(self, message: Message) -> bool:
        """Whether a message addresses the broker; 0 or a missing field addresses everybody."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self.own_system} and component in {0, self.own_component}
