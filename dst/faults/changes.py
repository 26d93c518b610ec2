"""Moments at which the state of a flight changes: what was true before is not true behind them.

They are read from what the programs send each other, so that a fault can come before the receiver
has it, or before its answer. Frames are read by their place in MAVLink 2, without a codec.
"""

from collections.abc import Mapping
from enum import StrEnum
from http import HTTPStatus
from typing import Final

from mavlink_broker.edge.outbox import Post

_MAGIC: Final = 0xFD
_HEADER_BYTES: Final = 10
_COMMAND_AT: Final = 28
"""Offset of the command in COMMAND_LONG and COMMAND_INT, behind seven values of four bytes."""
_COMMANDS: Final = frozenset({75, 76})  # COMMAND_INT, COMMAND_LONG


class Change(StrEnum):
    """What changes."""

    ARMING = "arming"
    START = "start"
    WAYPOINT = "waypoint"
    UPLOAD = "upload"
    PAUSE = "pause"
    ACCEPTANCE = "acceptance"
    REPORT = "report"


_BY_COMMAND: Final[Mapping[int, Change]] = {
    176: Change.START,  # MAV_CMD_DO_SET_MODE
    193: Change.PAUSE,  # MAV_CMD_DO_PAUSE_CONTINUE
    300: Change.START,  # MAV_CMD_MISSION_START
    400: Change.ARMING,  # MAV_CMD_COMPONENT_ARM_DISARM, also to disarm
}
_BY_MESSAGE: Final[Mapping[int, Change]] = {
    11: Change.START,  # SET_MODE
    44: Change.UPLOAD,  # MISSION_COUNT
    46: Change.WAYPOINT,  # MISSION_ITEM_REACHED
    47: Change.UPLOAD,  # MISSION_ACK
}


def of_frame(frame: bytes) -> Change | None:
    """Give the change that a frame orders or reports; None if it is none."""
    if len(frame) < _HEADER_BYTES or frame[0] != _MAGIC:
        return None
    message = int.from_bytes(frame[7:10], "little")
    if message in _COMMANDS:
        place = _HEADER_BYTES + _COMMAND_AT
        return _BY_COMMAND.get(int.from_bytes(frame[place : place + 2], "little"))
    return _BY_MESSAGE.get(message)


def of_post(post: Post, status: int) -> Change | None:
    """Give the change of a post that the edge server has answered; None if it is none."""
    if status >= HTTPStatus.BAD_REQUEST:
        return None
    if post.is_acceptance:
        return Change.ACCEPTANCE
    is_answer = post.path.endswith("/ack")
    return Change.REPORT if is_answer or "mission_status_id" in post.body else None
