"""Live actions: commands that cannot be mission items, and the conditions that end them."""

from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.enumerations import OrbitType, TrackMode
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import (
    CommandAlternatives,
    CommandInt,
    CommandLong,
    long_command,
)
from mavlink_broker.microservices.config_overrides import ParameterOverride
from mavlink_broker.planning.situation import Home, Spot

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
        frame=mavlink.MAV_FRAME_GLOBAL,
        parameters=(speed_m_s, CHANGE_MODE, 0.0, yaw_rad),
        latitude_deg=spot.latitude_deg,
        longitude_deg=spot.longitude_deg,
        altitude_m=home.altitude_amsl_m + spot.relative_altitude_m,
    )
