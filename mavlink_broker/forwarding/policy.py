"""Judges a ground station's message to one vehicle.

Who sets how often a message comes is settled here too: ground stations and broker share one link
of the vehicle, and each SET_MESSAGE_INTERVAL overrides the one before. A ground station may have
the messages that the broker lives on faster, never slower; all others as it likes.
"""

from collections.abc import Mapping
from typing import Final

from mavlink_broker.forwarding import allowed
from mavlink_broker.forwarding.verdict import (
    Answer,
    Later,
    Pass,
    Refuse,
    Tenure,
    Verdict,
)
from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of

SLOWEST_STREAMS_HZ: Final = 2.0
"""Of REQUEST_DATA_STREAM, which sets whole groups of messages: slower ones would starve us."""
LARGEST_MESSAGE_ID: Final = 0xFFFFFF
HASH_CHECK: Final = "_HASH_CHECK"
"""PX4's parameter that is none: setting it says that the parameters are known already."""
FILE_PROTECTED: Final = 9
_NAK, _OPCODE_AT, _SESSION_AT = 129, 3, 2
_PAYLOAD_LENGTH: Final = 251


def judge(message: Message, tenure: Tenure, lived_on_us: Mapping[int, float]) -> Verdict:
    """Say what becomes of a message; `lived_on_us` are the broker's own streams' intervals."""
    kind = message.get_type()
    if kind in allowed.NEVER:
        return Refuse()
    if kind in {"COMMAND_LONG", "COMMAND_INT"}:
        return _judge_command(message, tenure, lived_on_us)
    if kind == "REQUEST_DATA_STREAM":
        is_fast = message.start_stop == 1 and message.req_message_rate >= SLOWEST_STREAMS_HZ
        return Pass() if is_fast else Later()
    if tenure is Tenure.FREE or kind in allowed.MESSAGES:
        return Pass()
    if kind in allowed.MISSION_READS:
        return Later() if tenure is Tenure.TRANSFER else Pass()
    return _judge_write(message, kind)


def _judge_command(message: Message, tenure: Tenure, lived_on_us: Mapping[int, float]) -> Verdict:
    if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
        return _judge_interval(message, lived_on_us)
    if tenure is Tenure.FREE or message.command in allowed.COMMANDS:
        return Pass()
    return Refuse(_command_ack(message, mavlink.MAV_RESULT_TEMPORARILY_REJECTED))


def _judge_interval(message: Message, lived_on_us: Mapping[int, float]) -> Verdict:
    """Let nothing that the broker lives on become slower; it is accepted, for it comes."""
    number = message.param1
    ours_us = lived_on_us.get(int(number)) if is_message_id(number) else None
    is_camera = message.target_component not in {0, mavlink.MAV_COMP_ID_AUTOPILOT1}
    if ours_us is None or is_camera or 0.0 < message.param2 <= ours_us:
        return Pass()
    return Answer(_command_ack(message, mavlink.MAV_RESULT_ACCEPTED))


def _judge_write(message: Message, kind: str) -> Verdict:
    """Refuse what would change something, in the words that its sender waits for."""
    if kind in allowed.MISSION_WRITES:
        return Refuse(_mission_ack(message))
    match kind:
        case "PARAM_SET" if message.param_id == HASH_CHECK:
            return Pass()
        case "PARAM_SET":
            return Refuse(instead=_read_instead(message))
        case "PARAM_EXT_SET":
            return Refuse(_parameter_ack(message))
        case "FILE_TRANSFER_PROTOCOL":
            opcode = message.payload[_OPCODE_AT]
            return Pass() if opcode in allowed.FILE_READS else Refuse(_file_refusal(message))
        case _:
            return Refuse()


def _command_ack(message: Message, result: int) -> Message:
    return mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *source_of(message))


def _mission_ack(message: Message) -> Message:
    return mavlink.MAVLink_mission_ack_message(
        *source_of(message), mavlink.MAV_MISSION_DENIED, getattr(message, "mission_type", 0)
    )


def _read_instead(message: Message) -> Message:
    """The answer to PARAM_SET is the value that the parameter has: so it is asked for."""
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
    """NAK of MAVLink's file transfer: the file is protected."""
    request = message.payload
    number = (request[0] | request[1] << 8) + 1 & 0xFFFF
    reply = [number & 0xFF, number >> 8, request[_SESSION_AT], _NAK, 1, request[_OPCODE_AT]]
    reply += [0] * 6 + [FILE_PROTECTED]
    reply += [0] * (_PAYLOAD_LENGTH - len(reply))
    return mavlink.MAVLink_file_transfer_protocol_message(0, *source_of(message), reply)


def _name(text: str) -> bytes:
    return text.encode("ascii", "replace")


def is_message_id(number: float) -> bool:
    """Whether a command's parameter can be the number of a message."""
    return 0.0 <= number <= LARGEST_MESSAGE_ID


def target_of(message: Message) -> int:
    """System that a message is meant for; 0 for all."""
    target: int = getattr(message, "target_system", getattr(message, "target", 0))
    return target


def answers_as(message: Message) -> Source:
    """In whose name a message to a vehicle is answered."""
    component = getattr(message, "target_component", 0) or mavlink.MAV_COMP_ID_AUTOPILOT1
    return Source(target_of(message), component)
