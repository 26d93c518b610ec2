"""Flight modes by family: what HEARTBEAT.custom_mode is called, and what it means to a mission."""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final

from mavlink_broker.mavlink.dialect import mavlink


class ModeRole(Enum):
    """What a mode means while a mission of ours is on the vehicle."""

    MISSION = auto()  # It flies the mission
    HOLD = auto()  # It waits: somebody paused it, or the broker ordered it
    PAUSED = auto()  # It waits in a mode that the broker never orders; the mission can be resumed
    GUIDED = auto()  # It flies a live command
    ENDING = auto()  # Return or land: part of the mission only while its last command runs
    OTHER = auto()  # Somebody else flies


PX4_MISSION: Final = 4 << 16 | 4 << 24

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
_PX4_ROLES: Final[Mapping[str, ModeRole]] = {
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
"""Modes in which a vehicle is only while it flies a live command."""

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
_COPTER_ROLES: Final[Mapping[str, ModeRole]] = {
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


def px4_name(base_mode: int, custom_mode: int) -> str:
    """PX4's name of a mode, main and sub joined by a dot."""
    del base_mode
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = _PX4_MAIN.get(main, f"MODE_{main}")
    subs = {3: _PX4_POSCTL, 4: _PX4_AUTO}.get(main, {})
    return f"{name}.{subs.get(sub, sub)}" if sub else name


def copter_name(base_mode: int, custom_mode: int) -> str:
    """ArduCopter's name of a mode."""
    del base_mode
    return _COPTER.get(custom_mode, f"MODE_{custom_mode}")


def generic_name(base_mode: int, custom_mode: int) -> str:
    """For an unknown autopilot, what the standard bits say."""
    if base_mode & mavlink.MAV_MODE_FLAG_AUTO_ENABLED:
        return "AUTO"
    return f"MODE_{custom_mode}"


def px4_role(name: str) -> ModeRole:
    """Meaning of a PX4 mode."""
    return _PX4_ROLES.get(name, ModeRole.OTHER)


def copter_role(name: str) -> ModeRole:
    """Meaning of an ArduCopter mode."""
    return _COPTER_ROLES.get(name, ModeRole.OTHER)


def generic_role(name: str) -> ModeRole:
    """An unknown autopilot's modes cannot be told apart: none is held against the mission."""
    del name
    return ModeRole.MISSION
