"""MAVLink as bytes and messages: the broker's only importer of pymavlink.

The shipped `all` dialect is the codec: it encodes version 2 and decodes both versions. Messages are
pymavlink's generated classes `mavlink.MAVLink_<name>_message`; `get_type()` returns their name.
Three of them are replaced here, because the shipped dialect lacks the opaque plan ids of the
current message definitions (extension fields: the checksum seed and the older fields stay as they
are, and a sender without them is read as id 0, "not supported").

Who has sent a message, whom it addresses, which senders are autopilots and which messages are
orders is here too.
"""

import re
import struct
from typing import Any, ClassVar, Final, NamedTuple, TypeAlias

from pymavlink.dialects.v20 import all as mavlink

__all__ = [
    "ADDRESSED",
    "AUTOPILOT",
    "BOOT_MS_VALUES",
    "MISSION_RESULT_NAMES",
    "NOT_VEHICLES",
    "ONBOARD_COMPUTER",
    "RESULT_NAMES",
    "Message",
    "MissionAck",
    "MissionCount",
    "MissionCurrent",
    "Route",
    "Source",
    "boot_ms_of",
    "is_order",
    "is_vehicle",
    "mav_cmd_name",
    "mavlink",
    "name_in",
    "replaces_autopilot",
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


def name_in(enumeration: str, number: int) -> str | None:
    """Name of an entry of an enumeration, without the enumeration's own; None if it has none."""
    entry = mavlink.enums[enumeration].get(number)
    return None if entry is None else str(entry.name).removeprefix(f"{enumeration}_")


def mav_cmd_name(number: int) -> str:
    """Name of a MAV_CMD with its prefix; its number behind the prefix if it has none."""
    name = name_in("MAV_CMD", number)
    return f"MAV_CMD {number}" if name is None else f"MAV_CMD_{name}"


class _WithPlanIds(mavlink.MAVLink_message):  # type: ignore[misc]  # codec is untyped
    """A message of the shipped dialect, and the ids of plans behind its fields; 0 for none."""

    plan_ids: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls) -> None:
        cls.fieldnames = [*cls.fieldnames, *cls.plan_ids]
        cls.ordered_fieldnames = [*cls.ordered_fieldnames, *cls.plan_ids]
        cls.orders = [*cls.orders, *range(len(cls.orders), len(cls.fieldnames))]
        cls.lengths = [1] * len(cls.fieldnames)
        cls.array_lengths = [0] * len(cls.fieldnames)
        cls.unpacker = struct.Struct(cls.unpacker.format + "I" * len(cls.plan_ids))

    def __init__(self, *values: int, **ids: int) -> None:
        """Take the fields in their order; those of `plan_ids` also by name.

        Raises:
            TypeError: for a field that the message does not have, or has by its place alone.
        """
        surplus = sorted(ids.keys() - set(self.plan_ids))
        if surplus or len(values) > len(self.fieldnames):
            raise TypeError(
                f"{type(self).__name__} takes {self.fieldnames}, not {surplus or values}"
            )
        shipped = len(self.fieldnames) - len(self.plan_ids)
        super().__init__(*values[:shipped])
        self._fieldnames = self.fieldnames
        ids.update(zip(self.plan_ids, values[shipped:], strict=False))
        for name in self.plan_ids:
            setattr(self, name, ids.get(name, 0))

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: FBT001, FBT002  # codec
        """Return the frame, with the signature that the codec requires."""
        payload = self.unpacker.pack(*(getattr(self, name) for name in self.ordered_fieldnames))
        frame: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return frame


class MissionAck(_WithPlanIds, mavlink.MAVLink_mission_ack_message):  # type: ignore[misc]  # as above
    """MISSION_ACK(47) with the id that the vehicle gave to the stored plan."""

    plan_ids = ("opaque_id",)


class MissionCount(_WithPlanIds, mavlink.MAVLink_mission_count_message):  # type: ignore[misc]
    """MISSION_COUNT(44) with the id of the plan that is about to be read."""

    plan_ids = ("opaque_id",)


class MissionCurrent(_WithPlanIds, mavlink.MAVLink_mission_current_message):  # type: ignore[misc]
    """MISSION_CURRENT(42) with the ids of the stored mission, fence and rally points."""

    plan_ids = ("mission_id", "fence_id", "rally_points_id")


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


BOOT_MS_VALUES: Final = 1 << 32
"""Number of values of `time_boot_ms`, which overflows after 49.7 days."""


def boot_ms_of(message: Message) -> int | None:
    """Read its sender's time since boot [ms]; None if it has none of now."""
    if message.get_type() == "CAMERA_IMAGE_CAPTURED":
        return None  # It is that of the picture, which may be long ago
    boot_ms: int | None = getattr(message, "time_boot_ms", None)
    return boot_ms


class Route(NamedTuple):
    """The broker's own ids and those of one vehicle's autopilot."""

    own_system: int
    own_component: int
    target_system: int
    target_component: int

    @property
    def target(self) -> tuple[int, int]:
        """Target system and component, as most messages begin with them."""
        return self.target_system, self.target_component

    def is_for_us(self, message: Message) -> bool:
        """Whether a message addresses the broker; 0 or a missing field addresses everybody."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self.own_system} and component in {0, self.own_component}

    def other_addressee(self, message: Message) -> int | None:
        """Give the system that the vehicle addresses, if that is neither the broker nor itself.

        PX4 acknowledges what its own modules order too. None if it addresses everybody.
        """
        system = int(getattr(message, "target_system", 0))
        return None if system in {0, self.own_system, self.target_system} else system


AUTOPILOT: Final[int] = mavlink.MAV_COMP_ID_AUTOPILOT1
ONBOARD_COMPUTER: Final[int] = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""The broker's own component id."""
_USER_COMPONENT: Final = re.compile("MAV_COMP_ID_(USER[0-9]+|AUTOPILOT1)")
_NON_AUTOPILOT_COMPONENTS: Final = frozenset(
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
    is_part = message.get_srcComponent() in _NON_AUTOPILOT_COMPONENTS
    return is_autopilot and not is_part and message.type not in NOT_VEHICLES


def replaces_autopilot(component: int, before: int | None) -> bool:
    """Whether a component becomes the system's autopilot instead of the one known before."""
    return before is None or (component == AUTOPILOT and before != AUTOPILOT)


_READS: Final = frozenset(
    {
        "HEARTBEAT",
        "PING",
        "TIMESYNC",
        "REQUEST_DATA_STREAM",
        "PARAM_REQUEST_READ",
        "PARAM_REQUEST_LIST",
        "MISSION_REQUEST_LIST",
        "MISSION_REQUEST",
        "MISSION_REQUEST_INT",
        "MISSION_ACK",
        "FILE_TRANSFER_PROTOCOL",
        "LOG_REQUEST_LIST",
        "LOG_REQUEST_DATA",
        "LOG_REQUEST_END",
    }
)
"""Messages that read from a vehicle, or end a transfer; the broker writes no file."""
_READ_COMMANDS: Final = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_HOME_POSITION,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS,
        mavlink.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE,
    }
)


def is_order(message: Message) -> bool:
    """Whether a message changes what a vehicle does or keeps, rather than asks for telemetry."""
    kind = message.get_type()
    if kind in {"COMMAND_LONG", "COMMAND_INT"}:
        return message.command not in _READ_COMMANDS
    return kind not in _READS
