"""The situation in which a command is translated, and what it becomes: items, or a live action.

A live action is a command that cannot be mission items, with the condition that ends it.

RefusedError  a command that cannot be flown, with its id, the parameter and the reason
"""

from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from afarcloud.commands import Command
from afarcloud.enumerations import OrbitType, TrackMode
from afarcloud.route import DEFAULT_ALTITUDE_M, Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.command import (
    CommandAlternatives,
    CommandInt,
    CommandLong,
    long_command,
)
from mavlink_broker.microservices.config_overrides import ParameterOverride


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


class Pose(NamedTuple):
    """A vehicle's position and heading."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # Above home
    heading_deg: float = 0.0


class Situation(NamedTuple):
    """The state before a command, as far as its translation depends on it."""

    family: Family
    home: Home
    mission_id: int
    flight: str  # Distinguishes missions of one number
    own_system: int  # The broker's: it sends targets, and controls a gimbal live
    refused: frozenset[int]  # MAV_CMD that this vehicle refused as mission items
    maximum_speed_m_s: float
    common_radius_m: float | None  # Acceptance radius of all waypoints, if equal
    after_live: bool  # The position is unknown: after a live command or on the ground
    spot: Spot | None = None  # End of the previous command; None: unknown
    heading_deg: float | None = None  # The last commanded one
    relative_altitude_m: float = DEFAULT_ALTITUDE_M  # Of the mission
    aim: tuple[float, float | None] | None = None  # [deg] Pitch and yaw of the last pictures

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


KEEP_SPEED: Final = -1.0
"""Speed of a reposition that does not change the vehicle's speed."""
CHANGE_MODE: Final = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)


@dataclass(frozen=True, slots=True)
class Turned:
    """It ends when the vehicle has flown the angle, or has left its orbit by itself."""

    latitude_deg: float
    longitude_deg: float
    radius_m: float
    angle_rad: float
    is_clockwise: bool
    speed_m_s: float = 0.0  # Approximate; 0: not known


@dataclass(frozen=True, slots=True)
class Lasted:
    """It ends after some time [s]; 0: as soon as it is accepted."""

    duration_s: float = 0.0


@dataclass(frozen=True, slots=True)
class TurnInPlace:
    """Turn in place, then rest; the angle is clockwise from the heading at the beginning."""

    turn_deg: float
    rest_s: float = 0.0


@dataclass(frozen=True, slots=True)
class SendCommand:
    """Send a command: the first alternative that is accepted."""

    alternatives: CommandAlternatives


@dataclass(frozen=True, slots=True)
class Move:
    """Fly to a position relative to the pose at the beginning: along the nose, and up."""

    forward_m: float
    up_m: float


Step: TypeAlias = TurnInPlace | SendCommand | Move


@dataclass(frozen=True, slots=True)
class Series:
    """It ends when all its steps are done, one after the other."""

    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """It ends after some time, or when the camera has lost its subject."""

    mode: TrackMode
    duration_s: float
    height_m: float  # Above home, of a vehicle that follows
    follow: CommandAlternatives  # Commands that make the vehicle follow
    maximum_speed_m_s: float  # Of the mission


@dataclass(frozen=True, slots=True, kw_only=True)
class Circled:
    """It ends when the vehicle has flown the circle from point to point."""

    turn: Turned
    height_m: float  # Above home
    speed_m_s: float
    heading: OrbitType


End: TypeAlias = Turned | Lasted | Series | Tracked | Circled


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveAction:
    """One command that is sent in flight; alternatives are tried in order."""

    begin: CommandAlternatives
    end: End
    within_s: float  # Time limit from beginning to end
    approach: Spot | None = None  # Flown to before it begins
    approach_speed_m_s: float | None = None  # None: the vehicle's own
    follow: Spot | None = None  # Sent to the vehicle as the position of a target, repeatedly
    overrides: tuple[ParameterOverride, ...] = ()  # While it lasts
    finish: CommandAlternatives = ()  # Commands that end it
    notes: tuple[str, ...] = ()
    alternative_notes: tuple[str, ...] = ()  # What each alternative lacks, "" for nothing
    execution_s: float = 0.0  # Longest time between command and final acknowledgement
    moves: bool = True  # It takes the vehicle out of its mission
    wants_camera: bool = False  # Left out on a vehicle without a camera

    @property
    def command(self) -> int:
        """The MAV_CMD of its first alternative."""
        return self.begin[0][-1].command

    ends_at: Spot | None = None  # Position afterwards, if it is known in advance


def speed_command(speed_m_s: float) -> CommandLong:
    """DO_CHANGE_SPEED(178) of the ground speed; the throttle stays as it is."""
    ground_speed, throttle_as_it_is = 1.0, -1.0
    return long_command(mavlink.MAV_CMD_DO_CHANGE_SPEED, ground_speed, speed_m_s, throttle_as_it_is)


def approach_commands(
    spot: Spot, home: Home, speed_m_s: float | None, *, by_order: bool
) -> CommandAlternatives:
    """Fly to a position no faster than `speed_m_s`; None: at the vehicle's own speed.

    `by_order`: DO_REPOSITION resets the vehicle's speed, so that DO_CHANGE_SPEED follows it.
    """
    if speed_m_s is None:
        return ((reposition(spot, home),),)
    go = reposition(spot, home, speed_m_s=speed_m_s)
    return ((go, speed_command(speed_m_s)), (go,)) if by_order else ((go,),)


def reposition(
    spot: Spot, home: Home, yaw_rad: float = float("nan"), *, speed_m_s: float = KEEP_SPEED
) -> CommandInt:
    """DO_REPOSITION(192) in frame 0, which every family interprets alike."""
    return CommandInt(
        command=mavlink.MAV_CMD_DO_REPOSITION,
        parameters=(speed_m_s, CHANGE_MODE, 0.0, yaw_rad),
        latitude_deg=spot.latitude_deg,
        longitude_deg=spot.longitude_deg,
        altitude_m=home.altitude_amsl_m + spot.relative_altitude_m,
    )
