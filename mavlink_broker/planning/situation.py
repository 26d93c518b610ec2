"""What the meaning of a command may depend on, and what a command becomes.

RefusedError  a command that cannot be flown, with its id, the parameter and the reason
"""

from dataclasses import dataclass
from typing import NamedTuple

from afarcloud.commands import Command
from afarcloud.route import DEFAULT_ALTITUDE_M, Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.borrowed_parameters import Loan

__all__ = ["Home", "Items", "Refusal", "RefusedError", "Situation", "Spot"]


class Refusal(NamedTuple):
    """Why a command cannot be flown, and which of its fields asks for it."""

    parameter: str  # As AFarCloud names it; the command_type_id where that is out of place
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
    """Where the vehicle's altitudes begin."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float


class Situation(NamedTuple):
    """What the meaning of a command may depend on."""

    family: Family
    home: Home
    mission_id: int = 0
    own_system: int = 254  # The broker's, whose target a vehicle follows
    refused: frozenset[int] = frozenset()  # MAV_CMD that this vehicle refused as mission items
    spot: Spot | None = None  # Where the command before ends; None where that is not known
    heading_deg: float | None = None  # Last one asked for
    maximum_speed_m_s: float = 0.0
    relative_altitude_m: float = DEFAULT_ALTITUDE_M  # At which the mission flies
    common_radius_m: float | None = None  # Acceptance radius of all waypoints, if they are alike
    aim: tuple[float, float | None] | None = None  # [deg] Pitch and yaw of the pictures before
    after_live: bool = False  # It may be anywhere, behind a live command or where nothing moves it

    @property
    def approach_speed_m_s(self) -> float | None:
        """Speed to a place that is flown to live, the mission's; None where that has none."""
        return self.maximum_speed_m_s or None


@dataclass(frozen=True, slots=True)
class Items:
    """Mission items that one command became."""

    items: tuple[MissionItem, ...]
    done: int  # Which of them, when reached, finishes the command
    notes: tuple[str, ...] = ()
    spot: Spot | None = None  # Where the vehicle is afterwards; None: where it was
    heading_deg: float | None = None  # Asked for; None: as it was
    at_home: bool = False  # The spot is home
    ends_on_ground: bool = False
    loans: tuple[Loan, ...] = ()  # Parameters that it borrows of the vehicle
