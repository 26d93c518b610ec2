"""A ground station over an in-memory link: heartbeats, commands and mission uploads.

Encodes and decodes with pymavlink's own dialect, not with the firmware's code.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

from pymavlink.dialects.v20 import common

from uav_firmware.cal.link import Address

ADDRESS: Final[Address] = ("192.0.2.2", 14550)
SYSTEM: Final = 255
NAN: Final = math.nan
_HEARD: Final = frozenset(
    {
        common.MAVLINK_MSG_ID_COMMAND_ACK,
        common.MAVLINK_MSG_ID_MISSION_ACK,
        common.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
        common.MAVLINK_MSG_ID_MISSION_REQUEST,
        common.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        common.MAVLINK_MSG_ID_STATUSTEXT,
    }
)
_OVERHEAD_V2: Final = 12
_SIGNATURE: Final = 13
_REQUESTS: Final = frozenset({"MISSION_REQUEST_INT", "MISSION_REQUEST"})


class MemoryLink:
    """Implements `uav_firmware.cal.link.Link` without a socket."""

    def __init__(self) -> None:
        self.to_vehicle: list[bytes] = []
        self.from_vehicle: list[bytes] = []

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """What the ground station has sent since the last call."""
        datagrams = [(datagram, ADDRESS) for datagram in self.to_vehicle]
        self.to_vehicle.clear()
        return datagrams

    def send(self, datagram: bytes, address: Address) -> None:
        """Keep what is meant for the ground station."""
        assert address == ADDRESS
        self.from_vehicle.append(datagram)

    def refused_addresses(self) -> Sequence[Address]:
        """No address refuses datagrams."""
        return ()

    def close(self) -> None:
        """Nothing to release."""


class GroundStation:
    """Talks MAVLink to one vehicle; `receive` must be called as time passes."""

    def __init__(self, link: MemoryLink, vehicle_system: int) -> None:
        self._link = link
        self._target = vehicle_system
        self._codec = common.MAVLink(None, srcSystem=SYSTEM, srcComponent=190)
        self._codec.robust_parsing = True
        self._upload: list[Any] = []
        self.texts: list[str] = []
        self.acks: list[tuple[int, int]] = []  # command, result
        self.mission_ack: int | None = None
        self.items_reached: list[int] = []

    def sign(self, key: bytes) -> None:
        """Sign every frame from now on, and ignore frames that are not signed."""
        self._codec.signing.secret_key = key
        self._codec.signing.sign_outgoing = True

    def heartbeat(self) -> None:
        """Send a HEARTBEAT."""
        self.send(
            common.MAVLink_heartbeat_message(
                common.MAV_TYPE_GCS,
                common.MAV_AUTOPILOT_INVALID,
                0,
                0,
                common.MAV_STATE_ACTIVE,
                3,
            )
        )

    def command(self, command: int, *parameters: float) -> None:
        """Send a COMMAND_LONG; parameters not given are unset."""
        padded = [*parameters, *[NAN] * (7 - len(parameters))]
        self.send(common.MAVLink_command_long_message(self._target, 1, command, 0, *padded))

    def upload(self, items: Sequence[Any]) -> None:
        """Announce a mission; `receive` answers the vehicle's requests."""
        self._upload = list(items)
        self.mission_ack = None
        kind = items[0].mission_type if items else common.MAV_MISSION_TYPE_MISSION
        self.send(common.MAVLink_mission_count_message(self._target, 1, len(items), kind))

    def mission_item(
        self, seq: int, command: int, place: tuple[float, float, float], *parameters: float
    ) -> Any:
        """An item at latitude, longitude [deg] and height above home [m]."""
        padded = [*parameters, *[NAN] * (4 - len(parameters))]
        latitude, longitude, height = place
        return common.MAVLink_mission_item_int_message(
            self._target,
            1,
            seq,
            common.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            command,
            0,
            1,
            *padded,
            round(latitude * 1e7),
            round(longitude * 1e7),
            height,
            0,
        )

    def return_item(self, seq: int) -> Any:
        """An item that leads home."""
        return common.MAVLink_mission_item_int_message(
            self._target,
            1,
            seq,
            common.MAV_FRAME_MISSION,
            common.MAV_CMD_NAV_RETURN_TO_LAUNCH,
            0,
            1,
            *[0.0] * 4,
            0,
            0,
            0.0,
            0,
        )

    def receive(self) -> None:
        """Take in what the vehicle has sent."""
        for datagram in self._link.from_vehicle:
            if _is_one_frame(datagram) and _message_id(datagram) not in _HEARD:
                continue  # telemetry, which would take longer to decode than the flight to fly
            for message in self._codec.parse_buffer(datagram) or []:
                self._take(message)
        self._link.from_vehicle.clear()

    def _take(self, message: Any) -> None:
        match message.get_type():
            case "COMMAND_ACK":
                self.acks.append((message.command, message.result))
            case "MISSION_ACK":
                self.mission_ack = message.type
            case "STATUSTEXT":
                self.texts.append(message.text)
            case "MISSION_ITEM_REACHED":
                self.items_reached.append(message.seq)
            case kind if kind in _REQUESTS:
                self.send(self._upload[message.seq])

    def send(self, message: Any) -> None:
        """Send a message."""
        self._link.to_vehicle.append(message.pack(self._codec))


def _is_one_frame(datagram: bytes) -> bool:
    signature = _SIGNATURE if datagram[2] & 1 else 0
    return len(datagram) == _OVERHEAD_V2 + datagram[1] + signature


def _message_id(frame: bytes) -> int:
    return int.from_bytes(frame[7:10], "little")


def whole_texts(messages: Sequence[Any]) -> list[str]:
    """The texts of STATUSTEXTs, long ones put together from their chunks."""
    texts: dict[object, str] = {}
    for count, message in enumerate(messages):
        if message.get_type() == "STATUSTEXT":
            key = message.id or f"short {count}"
            texts[key] = texts.get(key, "") + message.text
    return list(texts.values())
