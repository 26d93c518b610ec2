"""Commands as they arrive, brought to one form whether they came as LONG or INT.

COMMAND_LONG carries parameters 5 and 6 as floats, COMMAND_INT as integers: degrees times 1e7
for a position, plain numbers otherwise. INT32_MAX, like NaN, means "not set". PX4 takes NaN and
0 for not set where a command does not use the parameter.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple, TypeAlias

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
"""MAV_FRAMEs with a position, and what their altitude is relative to."""

INT32_UNSET: Final = 0x7FFFFFFF
_NAN_AS_INT32: Final = -0x80000000
"""What a ground station's NaN becomes when it is cast to an integer."""

BAD_FRAME: Final = MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME
"""The answer to a COMMAND_INT in a frame that the vehicle does not fly in."""


class Command(NamedTuple):
    """A command of either message."""

    number: int  # MAV_CMD
    parameters: Parameters  # p5 and p6 in degrees where they are a position; NaN is unset
    frame: int  # FRAME_AMSL or FRAME_RELATIVE of p7; as sent where FRAME_KEPT

    def parameter(self, index: int) -> float:
        """Parameter `index` counted from 1, as MAVLink counts."""
        return self.parameters[index - 1]


FORWARDED: Final = frozenset(int(command) for command in status.Command)
"""Commands that the commander carries out; it also judges their parameters."""

FOR_PAYLOAD: Final = frozenset(int(command) for command in PayloadCommand)
"""Commands that camera and gimbal carry out; payload judges their parameters."""

FOR_GIMBAL: Final = frozenset(
    {
        int(PayloadCommand.DO_MOUNT_CONFIGURE),
        int(PayloadCommand.DO_MOUNT_CONTROL),
        int(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW),
        int(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE),
    }
)
"""Those of them that concern the gimbal, whose manager is the autopilot."""

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

ANSWERED_HERE: Final[Mapping[int, frozenset[int]]] = {
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
"""Commands that concern the link or the parameters, or another spelling of a forwarded one: the
parameters that have an effect. Another one that is set is refused, since it is not honoured."""

KNOWN: Final = FORWARDED | FOR_PAYLOAD | ANSWERED_HERE.keys()


FRAME_KEPT: Final = frozenset({int(status.Command.DO_ORBIT), int(status.Command.DO_SET_HOME)})
"""Commands of which the commander has to see the very frame: not all clients mean what they say."""


def from_long(message: Message) -> Command:
    """Read COMMAND_LONG; an altitude in it is above mean sea level."""
    parameters = tuple(getattr(message, f"param{i}") for i in range(1, 8))
    return Command(message.command, parameters, FRAME_AMSL)


def from_int(message: Message) -> Command | None:
    """Read COMMAND_INT; None when its frame is not one that the vehicle flies in."""
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


def is_honoured(command: Command) -> bool:
    """Whether every parameter that is set has an effect, as far as this module can tell."""
    honoured = ANSWERED_HERE.get(command.number, _ALL)
    ignored = (p for i, p in enumerate(command.parameters, 1) if i not in honoured)
    return all(math.isnan(parameter) or parameter == 0.0 for parameter in ignored)
