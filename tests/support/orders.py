"""What a vehicle was ordered, of all that it was sent.

Heartbeats, requests and the messages of a download are no orders: they change nothing.
"""

from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink
from tests.support.scripted_vehicle import ScriptedVehicle

SET_MODE: Final = mavlink.MAV_CMD_DO_SET_MODE
ASKING: Final = {511, 512, 2003, 2504}  # Intervals and messages, of a camera too
READING: Final = {
    "HEARTBEAT",
    "REQUEST_DATA_STREAM",
    "PARAM_REQUEST_READ",
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST_INT",
    "MISSION_ACK",
    "TIMESYNC",
}
"""Messages that are no orders."""


def orders(vehicle: ScriptedVehicle, since: int) -> list[str]:
    """What the vehicle was ordered, of all that it was sent behind the first so many frames."""

    def is_order(message: Message) -> bool:
        kind = message.get_type()
        if kind in {"COMMAND_LONG", "COMMAND_INT"}:
            return message.command not in ASKING
        return kind not in READING

    return [str(message) for message in vehicle.frames[since:] if is_order(message)]


def commands(vehicle: ScriptedVehicle, since: int) -> list[str]:
    """Orders behind the first so many frames; parameters are given back to whoever flies it."""
    return [one for one in orders(vehicle, since) if one.startswith("COMMAND")]
