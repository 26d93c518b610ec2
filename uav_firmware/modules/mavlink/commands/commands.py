"""One form of command for COMMAND_LONG and COMMAND_INT.

COMMAND_LONG carries parameters 5 and 6 as floats, COMMAND_INT as integers: degrees times 1e7
for a position, plain numbers otherwise. INT32_MAX, like NaN, means unset. As in PX4, NaN and 0
are accepted as unset where a command does not use the parameter.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.lib.payload_rules import unset
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import (
    MAV_CMD_DO_SET_STANDARD_MODE,
    MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME,
)
from uav_firmware.msg import status
from uav_firmware.msg.payload import PayloadCommand

Parameters: TypeAlias = tuple[float, float, float, float, float, float, float]

FRAME_AMSL: Final = 0
FRAME_MISSION: Final = 2
FRAME_RELATIVE: Final = 3
GLOBAL_FRAMES: Final[Mapping[int, int]] = {0: FRAME_AMSL, 5: FRAME_AMSL, 3: 3, 6: 3}
"""MAV_FRAMEs with a position, and the datum of their altitude."""

INT32_UNSET: Final = 0x7FFFFFFF
_NAN_AS_INT32: Final = -0x80000000
"""NaN of a ground station cast to an integer."""

BAD_FRAME: Final = MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME
"""Answer to a COMMAND_INT in an unsupported frame."""


class Command(NamedTuple):
    """A command from either message."""

    number: int  # MAV_CMD
    parameters: Parameters  # p5 and p6 in degrees if they are a position; NaN is unset
    frame: int  # FRAME_AMSL or FRAME_RELATIVE of p7; as sent where FRAME_KEPT

    def parameter(self, index: int) -> float:
        """Parameter by its MAVLink number, from 1."""
        return self.parameters[index - 1]


class Answer(NamedTuple):
    """Result of a command, and the requested messages."""

    result: int  # MAV_RESULT
    messages: tuple[Message, ...] = ()
    to_all: bool = False
    reason: str = ""  # Of one of REFUSALS, for the sender


REFUSALS: Final[Mapping[int, str]] = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "refused",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_FAILED: "failed",
}
"""Results that have a reason; a command or message that is not there is UNSUPPORTED without one."""


def denied(reason: str) -> Answer:
    """A parameter is wrong in any state."""
    return Answer(mavlink.MAV_RESULT_DENIED, reason=reason)


def temporarily_rejected(reason: str) -> Answer:
    """The parameters are valid, but the state of the vehicle does not allow the command now."""
    return Answer(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, reason=reason)


def failed(reason: str) -> Answer:
    """The parameters are valid, but what the command acts on does not exist."""
    return Answer(mavlink.MAV_RESULT_FAILED, reason=reason)


class PendingAnswer(NamedTuple):
    """The command is being executed; its answer is the VehicleCommandAck with this token."""

    token: int


FORWARDED: Final = frozenset(int(command) for command in status.Command)
"""Commands that the commander executes; it also checks their parameters."""

FOR_PAYLOAD: Final = frozenset(int(command) for command in PayloadCommand)
"""Commands that payload executes; it also checks their parameters."""

FOR_GIMBAL: Final = frozenset(
    {
        int(PayloadCommand.DO_MOUNT_CONFIGURE),
        int(PayloadCommand.DO_MOUNT_CONTROL),
        int(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW),
        int(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE),
    }
)
"""Gimbal commands of these; the autopilot is the gimbal manager."""

POSITIONAL: Final = frozenset(
    {
        status.Command.NAV_WAYPOINT,
        status.Command.NAV_LOITER_UNLIM,
        status.Command.NAV_LOITER_TIME,
        status.Command.NAV_LAND,
        status.Command.NAV_TAKEOFF,
        status.Command.DO_ORBIT,
        status.Command.DO_SET_ROI_LOCATION,
        status.Command.DO_SET_ROI,
        status.Command.DO_SET_HOME,
        status.Command.DO_REPOSITION,
    }
)
"""Commands whose parameters 5 and 6 are latitude and longitude."""

_ALL: Final = frozenset(range(1, 8))

HANDLED_HERE: Final[Mapping[int, frozenset[int]]] = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: frozenset({1, 2, 7}),
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: frozenset({1, 7}),
    mavlink.MAV_CMD_REQUEST_MESSAGE: _ALL,
    mavlink.MAV_CMD_GET_HOME_POSITION: frozenset(),
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: frozenset({1}),
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: frozenset({1}),
    mavlink.MAV_CMD_PREFLIGHT_STORAGE: frozenset({1, 2}),
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: frozenset({1, 2, 3, 4}),
    mavlink.MAV_CMD_LOGGING_START: frozenset({1}),
    mavlink.MAV_CMD_LOGGING_STOP: frozenset(),
    MAV_CMD_DO_SET_STANDARD_MODE: frozenset({1}),
}
"""Commands that this module executes, or translates to a forwarded one, with the parameters that
have an effect. A command that sets another parameter is refused."""

KNOWN: Final = FORWARDED | FOR_PAYLOAD | frozenset(HANDLED_HERE)


FRAME_KEPT: Final = frozenset({int(status.Command.DO_ORBIT), int(status.Command.DO_SET_HOME)})
"""Commands whose frame the commander must see as sent, because clients use it differently."""


def from_long(message: Message) -> Command:
    """Read COMMAND_LONG; its altitude is above mean sea level."""
    parameters = tuple(getattr(message, f"param{i}") for i in range(1, 8))
    return Command(message.command, parameters, FRAME_AMSL)


def from_int(message: Message) -> Command | None:
    """Read COMMAND_INT; None when its frame is not supported."""
    frame: int = message.frame
    if frame not in GLOBAL_FRAMES and frame != FRAME_MISSION:
        return None
    scale = 1e7 if message.command in POSITIONAL else 1.0
    kept = message.command in FRAME_KEPT and GLOBAL_FRAMES.get(frame) == FRAME_RELATIVE
    return Command(
        message.command,
        (
            message.param1,
            message.param2,
            message.param3,
            message.param4,
            _unscaled(message.x, scale),
            _unscaled(message.y, scale),
            message.z,
        ),
        frame if kept else GLOBAL_FRAMES.get(frame, FRAME_AMSL),
    )


def _unscaled(value: int, scale: float) -> float:
    return math.nan if value in {INT32_UNSET, _NAN_AS_INT32} else value / scale


def ignored_parameter(command: Command) -> int | None:
    """The first parameter that is set without an effect, as far as this module can decide."""
    supported = HANDLED_HERE.get(command.number, _ALL)
    ignored = ((i, p) for i, p in enumerate(command.parameters, 1) if i not in supported)
    return next((i for i, value in ignored if not unset(value)), None)


def name_of(number: int) -> str:
    """Name of a command without MAV_CMD_."""
    entry = mavlink.enums["MAV_CMD"].get(number)
    return f"command {number}" if entry is None else entry.name.removeprefix("MAV_CMD_")


def as_index(value: float) -> int | None:
    """Convert a message id or index; None unless it is an integer from 0."""
    if not math.isfinite(value) or value != int(value) or not 0.0 <= value <= 0xFFFFFF:
        return None
    return int(value)
