"""AFarCloud commands to mission items: one pure function each, joined by a table.

What a family does not honour is left out and said in a note, which becomes the command's
`message`; what cannot be flown at all raises RefusedError before anything is sent.

RefusedError  a command that this broker cannot fly, with its id and the reason
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple, TypeAlias

from afarcloud.commands import Command, NavHome, NavLand, NavTakeoff, NavWaypoint
from afarcloud.enumerations import CommandType, PrecisionLandMode
from mavlink_broker.translation import mission_item
from mavlink_broker.translation.families import Family
from mavlink_broker.translation.mission_item import MissionItem

DEFAULT_ALTITUDE_M: Final = 10.0
"""Height above home for a return that nothing has given a height yet."""


class RefusedError(Exception):
    """A command that cannot be flown."""

    def __init__(self, command_index: int, command: Command, reason: str) -> None:
        super().__init__(f"command {command.command_id}: {reason}")
        self.command_index = command_index
        self.reason = reason


class Home(NamedTuple):
    """Where the vehicle's altitudes begin."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float


class Situation(NamedTuple):
    """What the meaning of a command may depend on."""

    family: Family
    home: Home
    relative_altitude_m: float  # At which the mission flies when the command begins


@dataclass(frozen=True, slots=True)
class Items:
    """What one command became."""

    items: tuple[MissionItem, ...]
    done: int  # Which of them, when reached, finishes the command
    notes: tuple[str, ...] = ()
    relative_altitude_m: float | None = None  # At which the mission flies afterwards
    ends_on_ground: bool = False


def takeoff(command: NavTakeoff, situation: Situation) -> Items:
    """Climb, then go to the position: on most autopilots take-off climbs where it stands.

    The waypoint is there even when the vehicle stands at the position, so that the items do not
    depend on where it stands: after a restart they must come out the same.
    """
    p, family = command.parameters, situation.family
    place = {
        "latitude_deg": p.latitude,
        "longitude_deg": p.longitude,
        "relative_altitude_m": p.altitude,
    }
    climb = mission_item.takeoff(
        **place, minimum_pitch_deg=p.minimum_pitch, yaw_deg=_item_yaw(p.yaw_angle, family)
    )
    items = [climb]
    if family.takeoff_holds_position:
        go = mission_item.waypoint(**place, yaw_deg=_item_yaw(p.yaw_angle, family))
        items += [*_yaw_before(p.yaw_angle, family), go]
    return Items(tuple(items), len(items) - 1, relative_altitude_m=p.altitude)


def waypoint(command: NavWaypoint, situation: Situation) -> Items:
    """Fly to the position, stay for the hold time."""
    p, family = command.parameters, situation.family
    notes = []
    if p.trajectory_control != 0:
        notes.append("trajectory_control is not supported and was left out")
    if not family.honours_acceptance_radius:
        notes.append(f"{family.name} uses its own acceptance radius")
    go = mission_item.waypoint(
        latitude_deg=p.latitude,
        longitude_deg=p.longitude,
        relative_altitude_m=p.altitude,
        hold_s=p.hold_time,
        acceptance_radius_m=p.acceptance_radius if family.honours_acceptance_radius else 0.0,
        yaw_deg=_item_yaw(p.desired_yaw_angle, family),
    )
    items = (*_yaw_before(p.desired_yaw_angle, family), go)
    return Items(items, len(items) - 1, tuple(notes), p.altitude)


def land(command: NavLand, situation: Situation) -> Items:
    """Fly to the position and land there."""
    p, family = command.parameters, situation.family
    notes = []
    if p.minimum_target_altitude != 0 and not family.honours_abort_altitude:
        notes.append(f"minimum_target_altitude is not supported by {family.name} and was left out")
    precision = p.precision_land_mode
    if precision != PrecisionLandMode.DISABLED and not family.honours_precision_landing:
        notes.append(f"precision_land_mode is not supported by {family.name} and was left out")
        precision = PrecisionLandMode.DISABLED
    down = mission_item.land(
        latitude_deg=p.latitude,
        longitude_deg=p.longitude,
        relative_altitude_m=p.landing_altitude,
        abort_altitude_m=p.minimum_target_altitude if family.honours_abort_altitude else 0.0,
        precision_mode=precision,
        yaw_deg=_item_yaw(p.desired_yaw_angle, family),
    )
    items = (*_yaw_before(p.desired_yaw_angle, family), down)
    return Items(items, len(items) - 1, tuple(notes), ends_on_ground=True)


def home(command: NavHome, situation: Situation) -> Items:
    """Return and land, or go home at the mission's altitude; the mission's end is a hover."""
    if command.parameters.landing:
        return Items((mission_item.return_to_launch(),), 0, ends_on_ground=True)
    go = mission_item.waypoint(
        latitude_deg=situation.home.latitude_deg,
        longitude_deg=situation.home.longitude_deg,
        relative_altitude_m=situation.relative_altitude_m,
    )
    return Items((replace(go, at_home=True),), 0)


Translator: TypeAlias = Callable[[Any, Situation], Items]

TRANSLATORS: Final[Mapping[CommandType, Translator]] = {
    CommandType.NAV_TAKEOFF: takeoff,
    CommandType.NAV_LAND: land,
    CommandType.NAV_WAYPOINT: waypoint,
    CommandType.NAV_HOME: home,
}
"""The commands that are flown; any other is refused before take-off."""


def translate_command(index: int, command: Command, situation: Situation) -> Items:
    """Translate the command at `index` of a mission.

    Raises:
        RefusedError: if it is of a kind that is not flown.
    """
    translator = TRANSLATORS.get(command.command_type_id)
    if translator is None:
        raise RefusedError(index, command, f"{command.command_type_id.name} cannot be flown yet")
    return translator(command, situation)


def _item_yaw(yaw_deg: float | None, family: Family) -> float | None:
    return None if family.yaw_by_condition else yaw_deg


def _yaw_before(yaw_deg: float | None, family: Family) -> tuple[MissionItem, ...]:
    if yaw_deg is None or not family.yaw_by_condition:
        return ()
    return (mission_item.condition_yaw(yaw_deg),)
