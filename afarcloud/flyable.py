"""What every vehicle refuses, whatever it is and wherever it is; pure.

Vehicles refuse it only at take-off, minutes or hours after the plan was taken. Limits are
those of multirotors that take missions by MAVLink: a take-off item comes before all other places
or behind a landing (PX4 `mission_feasibility_checker`, ArduPilot's `AP_Mission`).

How far a mission reaches is a limit of a fleet, given by `VehicleLimits`; the first place is
used for home, which is unknown when a plan is posted.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from afarcloud.commands import (
    FLYING,
    Command,
    NavHome,
    NavHotpoint,
    NavLand,
    NavTakeoff,
    NavTrackSubject,
)
from afarcloud.enumerations import TrackMode
from afarcloud.faults import Fault
from afarcloud.geodesy import distance_m
from afarcloud.numbers import MAXIMUM_HEIGHT_M, Model
from afarcloud.plan import Mission
from afarcloud.route import Spot, spot_of

LOWEST_TAKEOFF_M: Final = 1.0
"""Above home; what is lower lies within the height that a take-off takes to leave the ground."""
SLOWEST_M_S: Final = 0.1
"""What ArduCopter raises slower orders to (`WP_SPD`); there positioning noise is as fast as the
flight, and a leg of 100 m takes longer than a battery lasts."""
SLOWEST_TURN_DEG_S: Final = 360.0 / 86_400.0
"""One turn a day: a slower one does not move, and vehicles refuse it in flight."""


class VehicleLimits(Model):
    """Limits of one registered vehicle; a distance of 0 is no limit."""

    maximum_speed_m_s: float = 12.0
    maximum_height_above_home_m: float = MAXIMUM_HEIGHT_M
    farthest_m: float = 0.0  # Every place of a mission from its first one
    longest_leg_m: float = 0.0  # From one place to the next


class Unflyable(NamedTuple):
    """A part of a mission that no vehicle flies."""

    command: int | None  # Its place in the mission; None for the mission itself
    field: str
    text: str


def faults(mission: Mission, path: str) -> Iterator[Fault]:
    """Name each command of a mission that no vehicle flies at its place in the mission."""
    for command, field, text in unflyable(mission):
        where = path if command is None else f"{path}.command_array.{command}"
        yield Fault(f"{where}.{field}", text)


def unflyable(mission: Mission) -> Iterator[Unflyable]:
    """Go through a mission; what is wrong with single values comes first."""
    yield from _limits(mission)
    flies_since: int | None = None
    landed_at: int | None = None
    for index, command in enumerate(mission.command_array):
        if not _moves(command):
            continue
        if isinstance(command, NavTakeoff):
            if flies_since is not None:
                yield Unflyable(
                    index,
                    "command_type_id",
                    f"the vehicle flies already since command_array.{flies_since}, and nothing "
                    "lands it before this take-off",
                )
            flies_since, landed_at = index, None
        elif landed_at is not None:
            yield Unflyable(
                index,
                "command_type_id",
                f"follows the landing of command_array.{landed_at}: NAV_TAKEOFF (1) has to come "
                "first",
            )
        elif _lands(command):
            flies_since, landed_at = None, index
        elif flies_since is None:
            flies_since = index


def _limits(mission: Mission) -> Iterator[Unflyable]:
    if (text := speed_fault(mission.maximum_speed)) is not None:
        yield Unflyable(None, "maximum_speed", text)
    for index, command in enumerate(mission.command_array):
        if isinstance(command, NavTakeoff) and command.parameters.altitude < LOWEST_TAKEOFF_M:
            text = f"must be at least {LOWEST_TAKEOFF_M:g} m for a take-off"
            yield Unflyable(index, "parameters.altitude", text)
        if isinstance(command, NavHotpoint):
            rate_deg_s = command.parameters.angular_velocity
            if rate_deg_s < SLOWEST_TURN_DEG_S:
                text = f"must be at least {SLOWEST_TURN_DEG_S:.4f} deg/s, one turn a day"
                yield Unflyable(index, "parameters.angular_velocity", text)


def speed_fault(speed_m_s: float, limits: VehicleLimits | None = None) -> str | None:
    """Give why a speed over ground cannot be flown, or None; without limits by any vehicle."""
    if speed_m_s < SLOWEST_M_S:
        return f"must be at least {SLOWEST_M_S:g} m/s: no vehicle flies slower"
    if limits is not None and speed_m_s > limits.maximum_speed_m_s:
        return f"must be at most {limits.maximum_speed_m_s} m/s, the vehicle's limit"
    return None


def first_place(mission: Mission) -> Spot | None:
    """Where a mission begins; None for one without a place."""
    return next((spot for spot in map(spot_of, mission.command_array) if spot is not None), None)


def reach_faults(mission: Mission, path: str, limits: VehicleLimits) -> Iterator[Fault]:
    """Name each command that lies too far from the first place, or from the place before it."""
    first = first_place(mission)
    before: Spot | None = None
    for index, command in enumerate(mission.command_array):
        place = spot_of(command)
        if place is None:
            before = None if _moves(command) else before
            continue
        text = None if first is None else _too_far(first, before or place, place, limits)
        if text is not None:
            yield Fault(f"{path}.command_array.{index}.parameters", text)
        before = place


def _too_far(first: Spot, before: Spot, place: Spot, limits: VehicleLimits) -> str | None:
    away_m = distance_m(*first[:2], *place[:2])
    if away_m > limits.farthest_m > 0.0:
        most = f"at most {limits.farthest_m:g} m (farthest_m)"
        return f"the place lies {away_m:.0f} m from the mission's first one, {most}"
    leg_m = distance_m(*before[:2], *place[:2])
    if leg_m > limits.longest_leg_m > 0.0:
        most = f"at most {limits.longest_leg_m:g} m (longest_leg_m)"
        return f"the place lies {leg_m:.0f} m from the one before it, {most}"
    return None


def _moves(command: Command) -> bool:
    """Whether a command takes the vehicle anywhere; a gimbal alone may follow a subject."""
    if isinstance(command, NavTrackSubject):
        return command.parameters.track_mode is not TrackMode.SPOTLIGHT_PRO
    return command.command_type_id in FLYING


def _lands(command: Command) -> bool:
    is_home = isinstance(command, NavHome) and command.parameters.landing
    return is_home or isinstance(command, NavLand)
