"""Commands as they arrive, brought to one form whether they came as LONG or INT.

COMMAND_LONG carries parameters 5 and 6 as floats, COMMAND_INT as integers: degrees times 1e7
for a position, plain numbers otherwise. INT32_MAX, like NaN, means "not set". PX4 takes NaN and
0 for not set where a command does not use the parameter.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.modules.mavlink.dialect import Message, mavlink
from uav_firmware.modules.mavlink.dialect_extensions import (
    MAV_CMD_DO_SET_STANDARD_MODE,
    MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME,
)

Parameters: TypeAlias = tuple[float, float, float, float, float, float, float]

FRAME_AMSL: Final = 0
FRAME_MISSION: Final = 2
FRAME_RELATIVE: Final = 3
GLOBAL_FRAMES: Final[Mapping[int, int]] = {0: FRAME_AMSL, 5: FRAME_AMSL, 3: 3, 6: 3}
"""MAV_FRAMEs with a position, and what their altitude is relative to."""

INT32_UNSET: Final = 0x7FFFFFFF
_FORCE_ARM_MAGIC: Final = 21196.0


class Command(NamedTuple):
    """A command of either message."""

    number: int  # MAV_CMD
    parameters: Parameters  # p5 and p6 in degrees where they are a position; NaN is unset
    frame: int  # FRAME_AMSL or FRAME_RELATIVE, of p7

    def parameter(self, index: int) -> float:
        """Parameter `index` counted from 1, as MAVLink counts."""
        return self.parameters[index - 1]


def _any_value(_command: Command) -> bool:
    return True


@dataclass(frozen=True, slots=True)
class Rule:
    """What is known about a command before the commander sees it."""

    honoured: frozenset[int]  # Parameters that have an effect; another one set is refused
    positional: bool = False  # p5 and p6 are latitude and longitude
    accepts: Callable[[Command], bool] = _any_value  # Whether the values can be meant


def _is_one_of(value: float, *allowed: float) -> bool:
    """Whether a parameter has one of some values; unset counts as 0."""
    return (0.0 if math.isnan(value) else value) in allowed


def _arm_values(command: Command) -> bool:
    return command.parameter(1) in {0.0, 1.0} and _is_one_of(
        command.parameter(2), 0.0, _FORCE_ARM_MAGIC
    )


def _switch_value(command: Command) -> bool:
    return command.parameter(1) in {0.0, 1.0}


def _current_item_values(command: Command) -> bool:
    """DO_SET_MISSION_CURRENT: a whole number from -1, and reset 0 or 1."""
    seq = command.parameter(1)
    whole = math.isfinite(seq) and seq == int(seq) and seq >= -1.0
    return whole and _is_one_of(command.parameter(2), 0.0, 1.0)


def _speed_values(command: Command) -> bool:
    return command.parameter(1) in {0.0, 1.0, 2.0, 3.0} and math.isfinite(command.parameter(2))


_ALL: Final = frozenset(range(1, 8))

FORWARDED: Final[Mapping[int, Rule]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: Rule(frozenset({1, 2}), accepts=_arm_values),
    mavlink.MAV_CMD_DO_SET_MODE: Rule(frozenset({1, 2, 3})),
    mavlink.MAV_CMD_NAV_TAKEOFF: Rule(frozenset({1, 4, 5, 6, 7}), positional=True),
    mavlink.MAV_CMD_NAV_LAND: Rule(frozenset({4, 5, 6, 7}), positional=True),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: Rule(frozenset()),
    mavlink.MAV_CMD_DO_REPOSITION: Rule(frozenset({1, 2, 4, 5, 6, 7}), positional=True),
    mavlink.MAV_CMD_DO_CHANGE_SPEED: Rule(frozenset({1, 2, 3}), accepts=_speed_values),
    mavlink.MAV_CMD_DO_SET_HOME: Rule(_ALL, positional=True, accepts=_switch_value),
    mavlink.MAV_CMD_DO_FLIGHTTERMINATION: Rule(frozenset({1}), accepts=_switch_value),
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: Rule(frozenset({1}), accepts=_switch_value),
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: Rule(frozenset({1, 2}), accepts=_current_item_values),
    mavlink.MAV_CMD_MISSION_START: Rule(frozenset({1, 2})),
}
"""Commands that the commander carries out."""

ANSWERED_HERE: Final[Mapping[int, Rule]] = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: Rule(frozenset({1, 2, 7})),
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: Rule(frozenset({1, 7})),
    mavlink.MAV_CMD_REQUEST_MESSAGE: Rule(_ALL),
    mavlink.MAV_CMD_GET_HOME_POSITION: Rule(frozenset()),
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: Rule(frozenset({1})),
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: Rule(frozenset({1})),
    MAV_CMD_DO_SET_STANDARD_MODE: Rule(frozenset({1})),
}
"""Commands that concern the link itself, or another spelling of a forwarded one."""

RULES: Final[Mapping[int, Rule]] = {**FORWARDED, **ANSWERED_HERE}


def from_long(message: Message) -> Command:
    """Read COMMAND_LONG; an altitude in it is above mean sea level."""
    parameters = tuple(getattr(message, f"param{i}") for i in range(1, 8))
    return Command(message.command, parameters, FRAME_AMSL)


def from_int(message: Message) -> Command | None:
    """Read COMMAND_INT; None when its frame is not one that the vehicle flies in."""
    frame: int = message.frame
    if frame not in GLOBAL_FRAMES and frame != FRAME_MISSION:
        return None
    rule = RULES.get(message.command)
    scale = 1e7 if rule is not None and rule.positional else 1.0
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
        GLOBAL_FRAMES.get(frame, FRAME_AMSL),
    )


def _unscaled(value: int, scale: float) -> float:
    return math.nan if value == INT32_UNSET else value / scale


def refusal(command: Command) -> int | None:
    """MAV_RESULT of a command of `RULES` that cannot be meant, whatever the vehicle's state.

    None for a command that may go on to whoever carries it out.
    """
    rule = RULES[command.number]
    ignored = (p for i, p in enumerate(command.parameters, 1) if i not in rule.honoured)
    if any(_is_set(parameter) for parameter in ignored):
        return int(mavlink.MAV_RESULT_DENIED)
    if any(math.isinf(parameter) for parameter in command.parameters):
        return int(mavlink.MAV_RESULT_DENIED)
    if rule.positional and not _is_on_earth(command.parameter(5), command.parameter(6)):
        return int(mavlink.MAV_RESULT_DENIED)
    return None if rule.accepts(command) else int(mavlink.MAV_RESULT_DENIED)


def _is_set(parameter: float) -> bool:
    return not math.isnan(parameter) and parameter != 0.0


def _is_on_earth(latitude_deg: float, longitude_deg: float) -> bool:
    """Whether a position is one; an unset coordinate is."""
    return not (abs(latitude_deg) > 90.0 or abs(longitude_deg) > 180.0)


BAD_FRAME: Final = MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME
