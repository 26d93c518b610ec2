"""Flight modes in PX4's encoding, and the commands that set them.

`custom_mode` is a 32-bit number with the main mode in its third byte and the sub mode in its
fourth (PX4's `px4_custom_mode`). Standard modes are MAVLink's MAV_STANDARD_MODE.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from uav_firmware.modules.mavlink.commands.commands import FRAME_AMSL, Command
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.status import NavigationState

_AUTO: Final = 4
_POSCTL: Final = 3

_PILOTED: Final = (
    mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
)
_GUIDED: Final = mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
_AUTONOMOUS: Final = _GUIDED | mavlink.MAV_MODE_FLAG_AUTO_ENABLED

PROPERTY_AUTO_MODE: Final = 4
"""MAV_MODE_PROPERTY_AUTO_MODE, which the shipped dialect lacks."""
_STATE = NavigationState
_NON_STANDARD: Final = mavlink.MAV_STANDARD_MODE_NON_STANDARD
_CUSTOM_MODE_ENABLED: Final = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_SMALLEST_PACKED: Final = 0x10000


class Mode(NamedTuple):
    """Encoding of a navigation state."""

    main: int
    sub: int
    base_flags: int  # MAV_MODE_FLAG without ARMED and CUSTOM_MODE_ENABLED
    standard: int  # MAV_STANDARD_MODE
    name: str
    offered: bool = False  # Listed by AVAILABLE_MODES: the vehicle can fly it

    @property
    def custom_mode(self) -> int:
        """Value of HEARTBEAT.custom_mode."""
        return self.main << 16 | self.sub << 24


MODES: Final[Mapping[NavigationState, Mode]] = {
    _STATE.MANUAL: Mode(1, 0, _PILOTED, _NON_STANDARD, "Manual"),
    _STATE.ALTCTL: Mode(
        2, 0, _PILOTED, mavlink.MAV_STANDARD_MODE_ALTITUDE_HOLD, "Altitude", offered=True
    ),
    _STATE.POSCTL: Mode(
        _POSCTL,
        0,
        _PILOTED | _GUIDED,
        mavlink.MAV_STANDARD_MODE_POSITION_HOLD,
        "Position",
        offered=True,
    ),
    _STATE.AUTO_MISSION: Mode(
        _AUTO, 4, _AUTONOMOUS, mavlink.MAV_STANDARD_MODE_MISSION, "Mission", offered=True
    ),
    _STATE.AUTO_LOITER: Mode(_AUTO, 3, _AUTONOMOUS, _NON_STANDARD, "Hold", offered=True),
    _STATE.AUTO_RTL: Mode(
        _AUTO, 5, _AUTONOMOUS, mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY, "Return", offered=True
    ),
    _STATE.ACRO: Mode(
        5, 0, mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED, _NON_STANDARD, "Acro", offered=True
    ),
    _STATE.TERMINATION: Mode(10, 0, 0, _NON_STANDARD, "Termination"),
    _STATE.OFFBOARD: Mode(6, 0, _GUIDED, _NON_STANDARD, "Offboard", offered=True),
    _STATE.STAB: Mode(7, 0, _PILOTED, _NON_STANDARD, "Stabilized", offered=True),
    _STATE.AUTO_TAKEOFF: Mode(
        _AUTO, 2, _AUTONOMOUS, mavlink.MAV_STANDARD_MODE_TAKEOFF, "Takeoff", offered=True
    ),
    _STATE.AUTO_LAND: Mode(
        _AUTO, 6, _AUTONOMOUS, mavlink.MAV_STANDARD_MODE_LAND, "Land", offered=True
    ),
    _STATE.AUTO_FOLLOW_TARGET: Mode(
        _AUTO, 8, _AUTONOMOUS, _NON_STANDARD, "Follow me", offered=True
    ),
    _STATE.AUTO_PRECLAND: Mode(_AUTO, 9, _AUTONOMOUS, _NON_STANDARD, "Precision land"),
    _STATE.ORBIT: Mode(
        _POSCTL, 1, _AUTONOMOUS, mavlink.MAV_STANDARD_MODE_ORBIT, "Orbit", offered=True
    ),
}

OFFERED: Final[tuple[NavigationState, ...]] = tuple(
    state for state, mode in MODES.items() if mode.offered
)
"""Modes of AVAILABLE_MODES in the order of their index, which begins at 1."""

_BY_MAIN_AND_SUB: Final = {(mode.main, mode.sub): state for state, mode in MODES.items()}
_BY_STANDARD: Final = {
    mode.standard: state for state, mode in MODES.items() if mode.standard != _NON_STANDARD
}


def state_from_main_and_sub(main: int, sub: int) -> NavigationState | None:
    """Navigation state of PX4's main and sub mode, or None."""
    return _BY_MAIN_AND_SUB.get((main, sub))


def state_from_custom_mode(custom_mode: int) -> NavigationState | None:
    """Navigation state of a packed custom mode, or None."""
    if custom_mode & 0xFFFF:
        return None
    return state_from_main_and_sub(custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)


def state_from_standard_mode(standard: int) -> NavigationState | None:
    """Navigation state of a MAV_STANDARD_MODE that the vehicle can fly, or None."""
    state = _BY_STANDARD.get(standard)
    return state if state in OFFERED else None


def command_for(state: NavigationState) -> Command:
    """DO_SET_MODE in the form of the commander: p1 1, p2 main mode, p3 sub mode."""
    mode = MODES[state]
    return Command(
        mavlink.MAV_CMD_DO_SET_MODE,
        (1.0, float(mode.main), float(mode.sub), 0.0, 0.0, 0.0, 0.0),
        FRAME_AMSL,
    )


def command_from_do_set_mode(command: Command) -> Command | str:
    """Read DO_SET_MODE; the reason when it names no mode.

    p1 has the custom-mode flag, alone (MAVSDK) or with others (pymavlink's 29). p2 is the main mode
    and p3 the sub mode, or p2 is the packed custom mode (old QGroundControl).
    """
    flags, main, sub, *rest = command.parameters
    if not all(math.isnan(value) or value == 0.0 for value in rest):
        return "one of the parameters 4 to 7 is set but has no effect"
    sub = 0.0 if math.isnan(sub) else sub
    if not (_is_uint32(flags) and int(flags) & _CUSTOM_MODE_ENABLED):
        return f"parameter 1 is {flags:g}, without the flag of a custom mode (1)"
    if main >= _SMALLEST_PACKED and _is_uint32(main) and sub == 0.0:
        state = state_from_custom_mode(int(main))
    else:
        is_pair = _is_uint32(main) and _is_uint32(sub)
        state = state_from_main_and_sub(int(main), int(sub)) if is_pair else None
    return f"there is no mode {main:g}/{sub:g}" if state is None else command_for(state)


def command_from_set_mode(base_mode: int, custom_mode: int) -> Command | None:
    """Read the message SET_MODE; None when it names no mode."""
    if not base_mode & _CUSTOM_MODE_ENABLED:
        return None
    state = state_from_custom_mode(custom_mode)
    return None if state is None else command_for(state)


def command_from_standard_mode(command: Command) -> Command | str:
    """Read DO_SET_STANDARD_MODE; the reason for a mode that the vehicle lacks."""
    standard = command.parameter(1)
    state = state_from_standard_mode(int(standard)) if _is_uint32(standard) else None
    lacking = f"the vehicle has no standard mode {standard:g}"
    return lacking if state is None else command_for(state)


def _is_uint32(value: float) -> bool:
    return math.isfinite(value) and value == int(value) and 0.0 <= value <= 0xFFFFFFFF
