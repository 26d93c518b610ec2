"""The situation in which a command is translated, and the mission items that it becomes.

RefusedError  a command that cannot be flown, with its id, the parameter and the reason
"""

from dataclasses import dataclass
from typing import NamedTuple

from afarcloud.commands import Command
from afarcloud.route import DEFAULT_ALTITUDE_M, Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import ParameterOverride

__all__ = ["Home", "ItemLimits", "Items", "Refusal", "RefusedError", "Situation", "Spot"]


class Refusal(NamedTuple):
    """Why a command cannot be flown, and which of its fields is the cause."""

    parameter: str  # AFarCloud's name; command_type_id if the command itself is misplaced
    why: str


class RefusedError(Exception):
    """A command that cannot be flown."""

    def __init__(self, command_index: int, command: Command, refusal: Refusal) -> None:
        self.reason = f"{refusal.parameter}: {refusal.why}"
        super().__init__(f"command {command.command_id}: {self.reason}")
        self.command_index = command_index
        self.command_id = command.command_id
        self.refusal = refusal


class Home(NamedTuple):
    """The vehicle's home position, the origin of its relative altitudes."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float


class Situation(NamedTuple):
    """The state before a command, as far as its translation depends on it."""

    family: Family
    home: Home
    mission_id: int = 0
    flight: str = ""  # Tells apart missions of one number
    own_system: int = 254  # The broker's, whose target a vehicle follows
    own_component: int = 191  # With it, who controls a gimbal live
    refused: frozenset[int] = frozenset()  # MAV_CMD that this vehicle refused as mission items
    spot: Spot | None = None  # End of the previous command; None: unknown
    heading_deg: float | None = None  # The last commanded one
    maximum_speed_m_s: float = 0.0
    relative_altitude_m: float = DEFAULT_ALTITUDE_M  # Of the mission
    common_radius_m: float | None = None  # Acceptance radius of all waypoints, if equal
    aim: tuple[float, float | None] | None = None  # [deg] Pitch and yaw of the last pictures
    after_live: bool = False  # The position is unknown: after a live command or on the ground

    @property
    def approach_speed_m_s(self) -> float | None:
        """The mission's speed, for positions that are approached live; None: it has none."""
        return self.maximum_speed_m_s or None


@dataclass(frozen=True, slots=True)
class Items:
    """The mission items of one command."""

    items: tuple[MissionItem, ...]
    done: int  # Index of the item that completes the command
    notes: tuple[str, ...] = ()
    spot: Spot | None = None  # Position afterwards; None: unchanged
    heading_deg: float | None = None  # Commanded; None: unchanged
    at_home: bool = False  # The spot is home
    ends_on_ground: bool = False
    overrides: tuple[ParameterOverride, ...] = ()  # While it is flown


@dataclass(slots=True)
class ItemLimits:
    """What a mission of one vehicle may hold, as far as its refusals show."""

    refused: frozenset[int] = frozenset()  # MAV_CMDs that no mission may hold
    most_items: int | None = None  # Of a mission; None: the vehicle has refused no number
