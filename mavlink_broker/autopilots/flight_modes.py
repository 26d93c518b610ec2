"""Flight modes of the autopilots that are known: their names, and their roles in a mission.

Sources: PX4's `px4_custom_mode.h`, ArduCopter's `mode.h`.
"""

from collections.abc import Mapping
from enum import Enum, auto
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
_PX4_SUBS: Final[Mapping[int, Mapping[int, str]]] = {  # By the main mode
    3: {1: "ORBIT", 2: "SLOW"},
    4: {
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
    },
}
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
def px4_name(_base_mode: int, custom_mode: int) -> str:
    """Name of a PX4 mode, main and sub mode joined by a dot."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = _PX4_MAIN.get(main, f"MODE_{main}")
    return f"{name}.{_PX4_SUBS.get(main, {}).get(sub, sub)}" if sub else name


def copter_name(_base_mode: int, custom_mode: int) -> str:
    """Name of an ArduCopter mode."""
    return _COPTER.get(custom_mode, f"MODE_{custom_mode}")


def generic_name(base_mode: int, custom_mode: int) -> str:
    """Name of an unknown autopilot's mode by the standard base_mode bits."""
    is_automatic = base_mode & mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    return "AUTO" if is_automatic else f"MODE_{custom_mode}"


class ModeRole(Enum):
    """Role of a mode while a mission of the broker is on the vehicle."""

    MISSION = auto()  # Flies the mission
    HOLD = auto()  # Holds: paused by a client, or commanded by the broker
    PAUSED = auto()  # Holds in a mode that the broker never commands; the mission can be resumed
    GUIDED = auto()  # Flies a live command
    ENDING = auto()  # Return or land: part of the mission only during its last command
    OTHER = auto()  # Another client or a pilot flies


PX4_ROLES: Final[Mapping[str, ModeRole]] = {
    "AUTO.MISSION": ModeRole.MISSION,
    "AUTO.TAKEOFF": ModeRole.MISSION,
    "AUTO.VTOL_TAKEOFF": ModeRole.MISSION,
    "AUTO.READY": ModeRole.HOLD,
    "AUTO.LOITER": ModeRole.HOLD,
    "AUTO.GOTO": ModeRole.GUIDED,
    "AUTO.FOLLOW_TARGET": ModeRole.GUIDED,
    "POSCTL.ORBIT": ModeRole.GUIDED,
    "AUTO.RTL": ModeRole.ENDING,
    "AUTO.LAND": ModeRole.ENDING,
    "AUTO.PRECLAND": ModeRole.ENDING,
}

LIVE_MODES: Final = frozenset({"POSCTL.ORBIT", "AUTO.FOLLOW_TARGET", "FOLLOW"})
"""Modes that a vehicle uses only for a live command."""

COPTER_ROLES: Final[Mapping[str, ModeRole]] = {
    "AUTO": ModeRole.MISSION,
    "LOITER": ModeRole.PAUSED,
    "GUIDED": ModeRole.GUIDED,
    "FOLLOW": ModeRole.GUIDED,
    "BRAKE": ModeRole.PAUSED,
    "RTL": ModeRole.ENDING,
    "SMART_RTL": ModeRole.ENDING,
    "AUTO_RTL": ModeRole.ENDING,
    "LAND": ModeRole.ENDING,
}
