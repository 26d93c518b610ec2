"""What cannot be a mission item: commands in flight, and how their end is told."""

from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.enumerations import OrbitType, TrackMode
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.borrowed_parameters import Loan
from mavlink_broker.microservices.command import CommandInt, CommandLong, long_command
from mavlink_broker.microservices.command_sequence import Ways
from mavlink_broker.planning.situation import Home, Spot

AS_IT_IS: Final = -1.0
"""Speed of a reposition that changes none."""
CHANGE_MODE: Final = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)


@dataclass(frozen=True, slots=True)
class Turned:
    """It ends when the vehicle has gone round a centre, or has left its circle by itself."""

    latitude_deg: float
    longitude_deg: float
    radius_m: float
    angle_rad: float
    is_clockwise: bool
    speed_m_s: float = 0.0  # About; 0: not known


@dataclass(frozen=True, slots=True)
class Lasted:
    """It ends after some time [s]; none: as soon as it has been accepted."""

    duration_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Face:
    """Turn on the spot, and rest; the angle counts clockwise from where the nose was at first."""

    turn_deg: float
    rest_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Order:
    """Have something else done, in the first way that is accepted."""

    ways: Ways


@dataclass(frozen=True, slots=True)
class Shift:
    """Fly on from where it was at first: along the nose, and up."""

    forward_m: float
    up_m: float


Step: TypeAlias = Face | Order | Shift


@dataclass(frozen=True, slots=True)
class Series:
    """It ends when all its steps have been taken, one after the other."""

    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """It ends after some time, or when the camera has lost its subject."""

    mode: TrackMode
    duration_s: float
    height_m: float  # Above home, kept by a vehicle that follows
    follow: Ways  # How a vehicle is told to follow
    maximum_speed_m_s: float  # Of the mission; nothing beside the subject is flown faster


@dataclass(frozen=True, slots=True, kw_only=True)
class Circled:
    """It ends when the broker has sent the vehicle round from point to point."""

    turn: Turned
    height_m: float  # Above home
    speed_m_s: float
    heading: OrbitType


End: TypeAlias = Turned | Lasted | Series | Tracked | Circled


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveAction:
    """One command flown in flight; ways are tried in order."""

    begin: Ways
    end: End
    within_s: float  # Beginning to end; longer means that something is wrong
    approach: Spot | None = None  # Gone to before it begins
    approach_speed_m_s: float | None = None  # None: the vehicle's own
    follow: Spot | None = None  # Told to the vehicle as the place of a target, all the time
    loans: tuple[Loan, ...] = ()  # Parameters that it borrows of the vehicle, while it lasts
    finish: Ways = ()  # What ends it, when its time has come
    notes: tuple[str, ...] = ()
    way_notes: tuple[str, ...] = ()  # What is lost by each way, "" for nothing
    works_s: float = 0.0  # What the vehicle takes from being told to its answer, at most
    moves: bool = True  # It takes the vehicle out of its mission
    wants_camera: bool = False  # A vehicle without one leaves it out

    @property
    def order(self) -> int:
        """MAV_CMD that it begins with, where nothing has to be done otherwise."""
        return self.begin[0][-1].command

    ends_at: Spot | None = None  # Where the vehicle is afterwards, if that is known before


def speed_order(speed_m_s: float) -> CommandLong:
    """DO_CHANGE_SPEED(178) of the ground speed; the throttle stays as it is."""
    ground_speed, throttle_as_it_is = 1.0, -1.0
    return long_command(mavlink.MAV_CMD_DO_CHANGE_SPEED, ground_speed, speed_m_s, throttle_as_it_is)


def approach_ways(spot: Spot, home: Home, speed_m_s: float | None, *, by_order: bool) -> Ways:
    """Go to a place no faster than `speed_m_s`; None: as fast as the vehicle does by itself.

    `by_order`: the order to go there sets the vehicle's own speed, so that another comes behind.
    """
    if speed_m_s is None:
        return ((reposition(spot, home),),)
    go = reposition(spot, home, speed_m_s=speed_m_s)
    return ((go, speed_order(speed_m_s)), (go,)) if by_order else ((go,),)


def reposition(
    spot: Spot, home: Home, yaw_rad: float = float("nan"), *, speed_m_s: float = AS_IT_IS
) -> CommandInt:
    """DO_REPOSITION(192) in frame 0, the one that every family reads alike."""
    return CommandInt(
        command=mavlink.MAV_CMD_DO_REPOSITION,
        frame=mavlink.MAV_FRAME_GLOBAL,
        parameters=(speed_m_s, CHANGE_MODE, 0.0, yaw_rad),
        latitude_deg=spot.latitude_deg,
        longitude_deg=spot.longitude_deg,
        altitude_m=home.altitude_amsl_m + spot.relative_altitude_m,
    )
