"""Every way to ask for a flight mode, brought to one: DO_SET_MODE with p1 1, p2 main, p3 sub."""

import math
from typing import Final

from uav_firmware.modules.mavlink.commands import modes
from uav_firmware.modules.mavlink.commands.commands import FRAME_AMSL, Command
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.status import NavigationState

_CUSTOM_MODE_ENABLED: Final = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_SMALLEST_PACKED: Final = 0x10000


def command_for(state: NavigationState) -> Command:
    """DO_SET_MODE in the form that the commander reads."""
    mode = modes.MODES[state]
    return Command(
        mavlink.MAV_CMD_DO_SET_MODE,
        (1.0, float(mode.main), float(mode.sub), 0.0, 0.0, 0.0, 0.0),
        FRAME_AMSL,
    )


def from_do_set_mode(command: Command) -> Command | None:
    """Read DO_SET_MODE; None when it names no mode.

    p1 has the custom-mode flag set, alone (MAVSDK) or among others (pymavlink's 29). p2 is the
    main mode and p3 the sub mode, or p2 is the packed custom mode (old QGroundControl).
    """
    flags, main, sub, *rest = command.parameters
    if not all(math.isnan(value) or value == 0.0 for value in rest):
        return None  # Set, and without effect
    sub = 0.0 if math.isnan(sub) else sub
    if not all(_is_uint32(value) for value in (flags, main, sub)):
        return None
    if not int(flags) & _CUSTOM_MODE_ENABLED:
        return None
    if main >= _SMALLEST_PACKED:
        return from_set_mode(_CUSTOM_MODE_ENABLED, int(main)) if sub == 0.0 else None
    state = modes.from_main_and_sub(int(main), int(sub))
    return None if state is None else command_for(state)


def from_set_mode(base_mode: int, custom_mode: int) -> Command | None:
    """Read the message SET_MODE; None when it names no mode."""
    if not base_mode & _CUSTOM_MODE_ENABLED:
        return None
    state = modes.from_custom_mode(custom_mode)
    return None if state is None else command_for(state)


def from_standard_mode(command: Command) -> Command | None:
    """Read DO_SET_STANDARD_MODE; None for a mode that the vehicle lacks."""
    standard = command.parameter(1)
    if not _is_uint32(standard):
        return None
    state = modes.from_standard_mode(int(standard))
    return None if state is None else command_for(state)


def _is_uint32(value: float) -> bool:
    return math.isfinite(value) and value == int(value) and 0.0 <= value <= 0xFFFFFFFF
