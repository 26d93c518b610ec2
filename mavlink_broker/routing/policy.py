"""Decides whether a ground station's message to a vehicle is forwarded, answered or refused.

Message rates are decided here too: ground stations and broker share one link of the vehicle, and
each SET_MESSAGE_INTERVAL overrides the one before. A ground station may set a higher rate of the
messages that the broker requires, never a lower one; it may set any rate of the others.

While a mission of the broker runs, ground stations may send messages that read, none that changes
a flight. Everything else, including messages without a definition, is refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, TypeAlias

from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of


class BrokerControl(Enum):
    """How the broker uses a vehicle."""

    FREE = auto()  # No mission of the broker runs on it
    MISSION = auto()  # A mission of the broker runs
    TRANSFER = auto()  # A mission of the broker is being uploaded or read back


@dataclass(frozen=True, slots=True)
class Forward:
    """Forward the message unchanged."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Do not forward it; send this answer in the vehicle's name."""

    message: Message


@dataclass(frozen=True, slots=True)
class Drop:
    """Drop it without an answer; ground stations repeat it."""


@dataclass(frozen=True, slots=True)
class Refuse:
    """Refuse it, because a mission of the broker runs."""

    answer: Message | None = None  # To the ground station in the vehicle's name
    instead: Message | None = None  # To the vehicle in the ground station's name


Decision: TypeAlias = Forward | Answer | Drop | Refuse


ALLOWED_MESSAGES: Final = frozenset(
    {
        "PING",
        "TIMESYNC",
        "PARAM_REQUEST_READ",
        "PARAM_REQUEST_LIST",
        "PARAM_EXT_REQUEST_READ",
        "PARAM_EXT_REQUEST_LIST",
        "LOG_REQUEST_LIST",
        "LOG_REQUEST_DATA",
        "LOG_REQUEST_END",
        "REQUEST_EVENT",
        "GPS_RTCM_DATA",  # Corrections: a receiver that loses them loses its fix
        "OPEN_DRONE_ID_BASIC_ID",  # Remote identification is required by law
        "OPEN_DRONE_ID_OPERATOR_ID",
        "OPEN_DRONE_ID_SELF_ID",
        "OPEN_DRONE_ID_SYSTEM",
        "OPEN_DRONE_ID_SYSTEM_UPDATE",
    }
)

MISSION_READS: Final = frozenset(
    {"MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"}
)
"""Allowed except during a mission transfer of the broker."""

MISSION_WRITES: Final = frozenset(
    {
        "MISSION_COUNT",
        "MISSION_ITEM",
        "MISSION_ITEM_INT",
        "MISSION_WRITE_PARTIAL_LIST",
        "MISSION_CLEAR_ALL",
        "MISSION_SET_CURRENT",
    }
)

ALLOWED_COMMANDS: Final = frozenset(
    {
        mavlink.MAV_CMD_GET_HOME_POSITION,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS,
        mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS,
        mavlink.MAV_CMD_REQUEST_FLIGHT_INFORMATION,
        mavlink.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_STREAMING,  # Live video; recording is another command
        mavlink.MAV_CMD_VIDEO_STOP_STREAMING,
        mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION,
        mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS,
    }
)
"""In addition to SET_MESSAGE_INTERVAL, which depends on the interval."""

FILE_READS: Final = frozenset({0, 1, 2, 3, 4, 5, 14, 15, 16})
"""Opcodes of MAVLink FTP that only read: none, terminate, reset, list, open to read, read,
checksum, burst read, list with time."""

NEVER_FORWARDED: Final = frozenset({"SETUP_SIGNING", "AUTH_KEY"})
"""Never forwarded: signing keys are set over trusted links only, not through the broker."""

SLOWEST_STREAMS_HZ: Final = 2.0
"""Lowest rate of REQUEST_DATA_STREAM, which sets groups of messages that the broker requires."""
LARGEST_MESSAGE_ID: Final = 0xFFFFFF
HASH_CHECK: Final = "_HASH_CHECK"
"""Not a real parameter of PX4: setting it says that the parameters are known already."""
FILE_PROTECTED: Final = 9
_NAK, _OPCODE_AT, _SESSION_AT = 129, 3, 2
_PAYLOAD_LENGTH: Final = 251


def decide(
    message: Message, control: BrokerControl, required_intervals_us: Mapping[int, float]
) -> Decision:
    """Decide on a message; `required_intervals_us` are the intervals of the broker's streams."""
    kind = message.get_type()
    if kind in NEVER_FORWARDED:
        return Refuse()
    if kind in {"COMMAND_LONG", "COMMAND_INT"}:
        return _decide_command(message, control, required_intervals_us)
    if kind == "REQUEST_DATA_STREAM":
        is_fast = message.start_stop == 1 and message.req_message_rate >= SLOWEST_STREAMS_HZ
        return Forward() if is_fast else Drop()
    if control is BrokerControl.FREE or kind in ALLOWED_MESSAGES:
        return Forward()
    if kind in MISSION_READS:
        return Drop() if control is BrokerControl.TRANSFER else Forward()
    return _decide_write(message, kind)


def _decide_command(
    message: Message, control: BrokerControl, required_intervals_us: Mapping[int, float]
) -> Decision:
    if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
        return _decide_interval(message, required_intervals_us)
    if control is BrokerControl.FREE or message.command in ALLOWED_COMMANDS:
        return Forward()
    return Refuse(_command_ack(message, mavlink.MAV_RESULT_TEMPORARILY_REJECTED))


def _decide_interval(message: Message, required_intervals_us: Mapping[int, float]) -> Decision:
    """Accept a lower rate of a required message without forwarding it."""
    number = message.param1
    ours_us = required_intervals_us.get(int(number)) if is_message_id(number) else None
    is_camera = message.target_component not in {0, mavlink.MAV_COMP_ID_AUTOPILOT1}
    if ours_us is None or is_camera or 0.0 < message.param2 <= ours_us:
        return Forward()
    return Answer(_command_ack(message, mavlink.MAV_RESULT_ACCEPTED))


def _decide_write(message: Message, kind: str) -> Decision:
    """Refuse a message that changes something, with the answer of its protocol."""
    if kind in MISSION_WRITES:
        return Refuse(_mission_ack(message))
    match kind:
        case "PARAM_SET" if message.param_id == HASH_CHECK:
            return Forward()
        case "PARAM_SET":
            return Refuse(instead=_read_instead(message))
        case "PARAM_EXT_SET":
            return Refuse(_parameter_ack(message))
        case "FILE_TRANSFER_PROTOCOL":
            opcode = message.payload[_OPCODE_AT]
            return Forward() if opcode in FILE_READS else Refuse(_file_refusal(message))
        case _:
            return Refuse()


def _command_ack(message: Message, result: int) -> Message:
    return mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *source_of(message))


def _mission_ack(message: Message) -> Message:
    return mavlink.MAVLink_mission_ack_message(
        *source_of(message), mavlink.MAV_MISSION_DENIED, getattr(message, "mission_type", 0)
    )


def _read_instead(message: Message) -> Message:
    """Request the value: PARAM_SET is answered by the value that the parameter has."""
    return mavlink.MAVLink_param_request_read_message(
        message.target_system, message.target_component, _name(message.param_id), -1
    )


def _parameter_ack(message: Message) -> Message:
    return mavlink.MAVLink_param_ext_ack_message(
        _name(message.param_id),
        _name(message.param_value),
        message.param_type,
        mavlink.PARAM_ACK_FAILED,
    )


def _file_refusal(message: Message) -> Message:
    """NAK of MAVLink FTP: the file is protected."""
    request = message.payload
    number = (request[0] | request[1] << 8) + 1 & 0xFFFF
    reply = [number & 0xFF, number >> 8, request[_SESSION_AT], _NAK, 1, request[_OPCODE_AT]]
    reply += [0] * 6 + [FILE_PROTECTED]
    reply += [0] * (_PAYLOAD_LENGTH - len(reply))
    return mavlink.MAVLink_file_transfer_protocol_message(0, *source_of(message), reply)


def _name(text: str) -> bytes:
    return text.encode("ascii", "replace")


def is_message_id(number: float) -> bool:
    """Whether a command's parameter can be a message id."""
    return 0.0 <= number <= LARGEST_MESSAGE_ID


def target_of(message: Message) -> int:
    """Target system of a message; 0 for all."""
    target: int = getattr(message, "target_system", getattr(message, "target", 0))
    return target


def answering_source(message: Message) -> Source:
    """Source of the answer to a message to a vehicle."""
    component = getattr(message, "target_component", 0) or mavlink.MAV_COMP_ID_AUTOPILOT1
    return Source(target_of(message), component)
