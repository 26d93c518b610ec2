"""Names of flight modes, by HEARTBEAT.custom_mode and the autopilot that sends it.

Sources: PX4's `px4_custom_mode.h`, ArduCopter's `mode.h`.
"""

from functools import lru_cache
from typing import Final

from mavlink_broker.mavlink.dialect import mavlink

_PX4_MAIN: Final = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
    9: "SIMPLE",
    10: "TERMINATION",
    11: "ALTITUDE_CRUISE",
}
_PX4_AUTO: Final = {
    1: "READY",
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    7: "RTGS",
    8: "FOLLOW_TARGET",
    9: "PRECLAND",
    10: "VTOL_TAKEOFF",
    21: "GOTO",
}
_PX4_POSCTL: Final = {1: "ORBIT", 2: "SLOW"}
_COPTER: Final = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
}


@lru_cache(maxsize=256)  # Every step of a session asks for it several times
def px4_name(base_mode: int, custom_mode: int) -> str:
    """Name of a PX4 mode, main and sub mode joined by a dot."""
    del base_mode
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = _PX4_MAIN.get(main, f"MODE_{main}")
    subs = {3: _PX4_POSCTL, 4: _PX4_AUTO}.get(main, {})
    return f"{name}.{subs.get(sub, sub)}" if sub else name


def copter_name(base_mode: int, custom_mode: int) -> str:
    """Name of an ArduCopter mode."""
    del base_mode
    return _COPTER.get(custom_mode, f"MODE_{custom_mode}")


def generic_name(base_mode: int, custom_mode: int) -> str:
    """Name of an unknown autopilot's mode by the standard base_mode bits."""
    if base_mode & mavlink.MAV_MODE_FLAG_AUTO_ENABLED:
        return "AUTO"
    return f"MODE_{custom_mode}"
