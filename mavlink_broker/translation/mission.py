"""A mission to the items that a vehicle flies, and back from items to commands."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from afarcloud.commands import FLYING, Command
from afarcloud.plan import Mission
from mavlink_broker.dialect import Message
from mavlink_broker.translation import mission_item
from mavlink_broker.translation.commands import (
    DEFAULT_ALTITUDE_M,
    Home,
    Items,
    RefusedError,
    Situation,
    translate_command,
)
from mavlink_broker.translation.families import Family
from mavlink_broker.translation.mission_item import MissionItem

__all__ = ["FlightPlan", "Home", "RefusedError", "translate"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """The items of one mission and what they belong to.

    Commands are told by their place in the mission's `command_array`. Items that serve the whole
    mission (home, the speed, the hold at its end) belong to the command next to them.
    """

    items: tuple[MissionItem, ...]
    command_of_item: tuple[int, ...]
    done_item: tuple[int, ...]  # Per command: the item that finishes it when reached
    notes: tuple[tuple[str, ...], ...]  # Per command: what was left out, for its report
    first_item: int  # At which the mission begins: 1 behind home, else 0
    ends_on_ground: bool  # The last command lands: it ends on the ground and disarmed

    @classmethod
    def empty(cls) -> Self:
        """Give the plan of nothing, before there is one."""
        return cls(
            items=(), command_of_item=(), done_item=(), notes=(), first_item=0, ends_on_ground=True
        )

    def first_item_of(self, command: int) -> int:
        """Give the first item that belongs to a command."""
        return self.command_of_item.index(command)

    def messages(self, system: int, component: int) -> tuple[Message, ...]:
        """Give the items as they are uploaded to a vehicle."""
        return tuple(
            mission_item.to_message(
                item, seq=seq, first=self.first_item, system=system, component=component
            )
            for seq, item in enumerate(self.items)
        )


def translate(mission: Mission, family: Family, home: Home) -> FlightPlan:
    """Translate a whole mission for one family of autopilots.

    The same mission, family and home always give the same items.

    Raises:
        RefusedError: for the first command that cannot be flown.
    """
    translated = _translate_commands(mission.command_array, family, home)
    items: list[MissionItem] = []
    owners: list[int] = []
    done: list[int] = []

    def add(owner: int, *more: MissionItem) -> None:
        items.extend(more)
        owners.extend([owner] * len(more))

    if family.home_is_item_0:
        add(0, _home_item(home))
    speed_before = _first_flying(mission.command_array)
    for index, part in enumerate(translated):
        if index == speed_before:
            add(index, mission_item.change_speed(mission.maximum_speed))
        done.append(len(items) + part.done)
        add(index, *part.items)
    ends_on_ground = translated[-1].ends_on_ground
    if not ends_on_ground:
        add(len(translated) - 1, _hold_behind(items[-1]))
    return FlightPlan(
        items=tuple(items),
        command_of_item=tuple(owners),
        done_item=tuple(done),
        notes=tuple(part.notes for part in translated),
        first_item=int(family.home_is_item_0),
        ends_on_ground=ends_on_ground,
    )


def _translate_commands(commands: Sequence[Command], family: Family, home: Home) -> list[Items]:
    altitude_m = DEFAULT_ALTITUDE_M
    translated = []
    for index, command in enumerate(commands):
        part = translate_command(index, command, Situation(family, home, altitude_m))
        translated.append(part)
        if part.relative_altitude_m is not None:
            altitude_m = part.relative_altitude_m
    return translated


def _first_flying(commands: Sequence[Command]) -> int | None:
    flying = (i for i, command in enumerate(commands) if command.command_type_id in FLYING)
    return next(flying, None)


def _home_item(home: Home) -> MissionItem:
    return mission_item.home(
        latitude_deg=home.latitude_deg,
        longitude_deg=home.longitude_deg,
        altitude_amsl_m=home.altitude_amsl_m,
    )


def _hold_behind(item: MissionItem) -> MissionItem:
    """Hold where the last waypoint is; arriving at this item also proves the one before."""
    hold = mission_item.hold(
        latitude_deg=item.latitude_deg,
        longitude_deg=item.longitude_deg,
        relative_altitude_m=item.altitude_m,
    )
    return replace(hold, at_home=item.at_home)
