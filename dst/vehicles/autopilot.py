"""The autopilot families of a simulated farm: mode numbers, parameters, and what they do otherwise.

Sources: PX4 1.14 (`px4_custom_mode.h`), ArduCopter 4.5 (`mode.h`, `AP_Mission.cpp`); the project's
own autopilot identifies as PX4 with a vendor and product of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ORDERS: Final = frozenset(
    {
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_MISSION_START,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_FOLLOW,
    }
)
"""Commands that move a vehicle."""
REPORTED_FROM_M: Final = 3.0
"""A vehicle that fails lower stands before its failure counts as one."""


class Mode(Enum):
    """What a vehicle does at present, whatever number its family gives to it."""

    PILOT = auto()  # A person flies, also as the first mode of an autopilot that waits for one
    HOLD = auto()  # Stays, or flies to the place of a DO_REPOSITION
    BRAKE = auto()
    MISSION = auto()
    RETURN = auto()
    LAND = auto()
    ORBIT = auto()
    FOLLOW = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Autopilot:
    """One family."""

    name: str
    number: int
    """MAV_AUTOPILOT."""
    modes: Mapping[Mode, int]
    """HEARTBEAT.custom_mode."""
    product: tuple[int, int] = (0, 0)
    first_item: int = 0
    """Item 0 of a mission is the home position where this is 1."""
    keeps_mode: bool = False
    returns_in_mission: bool = False
    """Whether it flies an item that returns in its mission mode; PX4 leaves that."""
    """After a landing it stays in the mode that has landed it."""
    arms_in: frozenset[Mode] = frozenset(Mode)
    starts_disarmed: bool = True
    """Whether MISSION_START is accepted before it is armed."""
    pauses_by_command: bool = True
    """Whether it has DO_PAUSE_CONTINUE in each mode."""
    orbits: bool = True
    """Whether it has DO_ORBIT."""
    counts_turns: bool = False
    """DO_ORBIT ends after an angle."""
    turns_by_condition: bool = False
    """Whether it has CONDITION_YAW as a command."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Its parameters, none with the value that the broker sets while it borrows it."""

    def mode_of(self, main: int, sub: int) -> Mode | None:
        """Give the mode that DO_SET_MODE asks for."""
        number = main if self.number == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA else _px4(main, sub)
        return next((mode for mode, known in self.modes.items() if known == number), None)


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


_PX4_MODES: Final = {
    Mode.PILOT: _px4(3),
    Mode.HOLD: _px4(4, 3),
    Mode.MISSION: _px4(4, 4),
    Mode.RETURN: _px4(4, 5),
    Mode.LAND: _px4(4, 6),
    Mode.ORBIT: _px4(3, 1),
    Mode.FOLLOW: _px4(4, 8),
}
_PX4_PARAMETERS: Final = {
    "COM_DL_LOSS_T": 10.0,
    "BAT1_CAPACITY": 4200.0,
    "GF_MAX_VER_DIST": 0.0,
    "RTL_RETURN_ALT": 30.0,
    "FLW_TGT_ALT_M": 1.0,
    "FLW_TGT_HT": 12.0,
    "FLW_TGT_DST": 10.0,
    "FLW_TGT_FA": 45.0,
}

PX4: Final = Autopilot(
    name="px4", number=mavlink.MAV_AUTOPILOT_PX4, modes=_PX4_MODES, parameters=_PX4_PARAMETERS
)
OWN: Final = Autopilot(
    name="farm-flight",
    number=mavlink.MAV_AUTOPILOT_PX4,
    modes=_PX4_MODES,
    product=(0x1209, 0x0001),
    returns_in_mission=True,
    counts_turns=True,
    parameters=_PX4_PARAMETERS,
)
ARDUPILOT: Final = Autopilot(
    name="ardupilot",
    number=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    modes={
        Mode.PILOT: 2,  # ALT_HOLD
        Mode.HOLD: 4,  # GUIDED
        Mode.BRAKE: 17,
        Mode.MISSION: 3,  # AUTO
        Mode.RETURN: 6,
        Mode.LAND: 9,
        Mode.FOLLOW: 23,
    },
    first_item=1,
    keeps_mode=True,
    returns_in_mission=True,
    arms_in=frozenset({Mode.PILOT, Mode.HOLD}),
    starts_disarmed=False,
    pauses_by_command=False,
    orbits=False,
    turns_by_condition=True,
    parameters={
        "BATT_CAPACITY": 4200.0,
        "MIS_RESTART": 1.0,
        "WPNAV_RADIUS": 200.0,
        "CIRCLE_RATE": 20.5,
        "CIRCLE_OPTIONS": 1.0,
        "FENCE_ENABLE": 0.0,
        "FENCE_AUTOENABLE": 0.0,
        "FENCE_TYPE": 7.0,
        "FENCE_ALT_MAX": 100.0,
        "FENCE_OPTIONS": 0.0,
        "FOLL_ENABLE": 0.0,
        "FOLL_SYSID": 0.0,
        "FOLL_DIST_MAX": 100.0,
        "FOLL_OFS_TYPE": 1.0,
        "FOLL_OFS_X": 3.0,
        "FOLL_OFS_Y": 4.0,
        "FOLL_OFS_Z": 5.0,
        "FOLL_YAW_BEHAVE": 0.0,
        "FOLL_ALT_TYPE": 1.0,
    },
)
FAMILIES: Final = (PX4, ARDUPILOT, OWN)
