"""What every vehicle refuses, whatever it is and wherever it stands. Pure.

Vehicles say so when they are to take off, minutes or hours after the plan was taken. Limits are
those of multirotors that take missions by MAVLink: a take-off item comes before all other places
or behind a landing (PX4 `mission_feasibility_checker`, ArduPilot's `AP_Mission`).
"""

from collections.abc import Iterator
from typing import Final

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
from afarcloud.plan import Mission

LOWEST_TAKEOFF_M: Final = 1.0
"""Above home; what is lower lies within the height that a take-off takes to leave the ground."""
SLOWEST_TURN_DEG_S: Final = 360.0 / 86_400.0
"""One turn a day: what is slower stands still, and vehicles refuse it in flight."""


def faults(mission: Mission, path: str) -> Iterator[Fault]:
    """Name each command of a mission that no vehicle flies where it stands."""
    yield from _limits(mission, path)
    flies_since: int | None = None
    landed_at: int | None = None
    for index, command in enumerate(mission.command_array):
        if not _moves(command):
            continue
        where = f"{path}.command_array.{index}.command_type_id"
        if isinstance(command, NavTakeoff):
            if flies_since is not None:
                yield Fault(
                    where,
                    f"the vehicle flies already since command_array.{flies_since}, and nothing "
                    "lands it before this take-off",
                )
            flies_since, landed_at = index, None
        elif landed_at is not None:
            yield Fault(
                where,
                f"follows the landing of command_array.{landed_at}: NAV_TAKEOFF (1) has to come "
                "first",
            )
        elif _lands(command):
            flies_since, landed_at = None, index
        elif flies_since is None:
            flies_since = index


def _limits(mission: Mission, path: str) -> Iterator[Fault]:
    for index, command in enumerate(mission.command_array):
        where = f"{path}.command_array.{index}.parameters"
        if isinstance(command, NavTakeoff) and command.parameters.altitude < LOWEST_TAKEOFF_M:
            yield Fault(
                f"{where}.altitude",
                f"must be at least {LOWEST_TAKEOFF_M:g} m for a take-off",
            )
        if isinstance(command, NavHotpoint):
            rate_deg_s = command.parameters.angular_velocity
            if rate_deg_s < SLOWEST_TURN_DEG_S:
                text = f"must be at least {SLOWEST_TURN_DEG_S:.4f} deg/s, one turn a day"
                yield Fault(f"{where}.angular_velocity", text)


def _moves(command: Command) -> bool:
    """Whether a command takes the vehicle anywhere; a gimbal alone may follow a subject."""
    if isinstance(command, NavTrackSubject):
        return command.parameters.track_mode is not TrackMode.SPOTLIGHT_PRO
    return command.command_type_id in FLYING


def _lands(command: Command) -> bool:
    is_home = isinstance(command, NavHome) and command.parameters.landing
    return is_home or isinstance(command, NavLand)
