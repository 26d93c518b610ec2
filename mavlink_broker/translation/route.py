"""Where a vehicle will be, from what its commands became: ways, circles and heights. Pure.

What is judged is what is flown: the items and live actions of the very itinerary that goes onto
the vehicle, holds and ways home included. A take-off climbs where the vehicle stands. Where it is
after a live command that has no place of its own is not known, nor where it stands before it was
heard; a way that begins there is judged at its end alone.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.commands import Command, NavHotpoint
from afarcloud.enumerations import CommandType
from mavlink_broker.dialect import mavlink
from mavlink_broker.translation.geo import offset, shifted
from mavlink_broker.translation.live import Circled, Turned
from mavlink_broker.translation.mission import FlightPlan, Itinerary, LiveCommand
from mavlink_broker.translation.mission_item import MissionItem
from mavlink_broker.translation.situation import Home, Spot

_ALTITUDE_NAMES: Final = {
    CommandType.NAV_LAND: "landing_altitude",
    CommandType.NAV_HOTPOINT: "orbit_altitude",
    CommandType.NAV_HOME: "landing",
}
_PLACE_NAMES: Final = {CommandType.NAV_HOME: "landing"}
_PLACELESS: Final = frozenset({CommandType.CAMERA_IMAGE, CommandType.CAMERA_PANORAMA})
_EVERY_BEARING_DEG: Final = range(0, 360, 10)
_AT_CENTRE_M: Final = 0.01


@dataclass(frozen=True, slots=True)
class Way:
    """A straight way to a place; `start` None: from where nobody knows."""

    command: int  # Its place in the mission
    start: Spot | None
    end: Spot


@dataclass(frozen=True, slots=True)
class Round:
    """A circle."""

    command: int  # Its place in the mission
    centre: Spot
    radius_m: float


Part: TypeAlias = Way | Round


def place_name(command: Command) -> str:
    """Name the parameters that say where a command goes."""
    kind = command.command_type_id
    if kind in _PLACELESS:
        return "command_type_id"
    return _PLACE_NAMES.get(kind, "latitude, longitude")


def altitude_name(command: Command) -> str:
    """Name the parameter that says how high a command goes."""
    kind = command.command_type_id
    return "command_type_id" if kind in _PLACELESS else _ALTITUDE_NAMES.get(kind, "altitude")


def route_of(
    commands: tuple[Command, ...],
    itinerary: Itinerary,
    start: Spot | None,
    home: Home | None,
    rally: tuple[Spot, ...] = (),
) -> Iterator[Part]:
    """Go through an itinerary; without a home, ways to it are left out.

    A vehicle that is to return may choose a rally point instead: the ways to all of them count.
    """
    return _Walk(commands, start, home, rally).go(itinerary)


def highest_m(commands: tuple[Command, ...], itinerary: Itinerary | None) -> float:
    """Give the greatest height above home that an itinerary asks for; 0 where it asks for none."""
    parts = () if itinerary is None else route_of(commands, itinerary, None, None)
    heights = (part.end if isinstance(part, Way) else part.centre for part in parts)
    return max((spot.relative_altitude_m for spot in heights), default=0.0)


class _Walk:
    """Remembers where the vehicle is: one of these places; empty if that is not known."""

    def __init__(
        self,
        commands: tuple[Command, ...],
        start: Spot | None,
        home: Home | None,
        rally: tuple[Spot, ...],
    ) -> None:
        self._commands = commands
        self._home = home
        self._rally = rally
        self._here: tuple[Spot, ...] = () if start is None else (start,)

    def go(self, itinerary: Itinerary) -> Iterator[Part]:
        for segment in itinerary.segments:
            if isinstance(segment, FlightPlan):
                for number in range(segment.first_item, len(segment.items)):
                    yield from self._item(segment.command_of_item[number], segment.items[number])
            else:
                yield from self._live(segment)

    def _item(self, command: int, item: MissionItem) -> Iterator[Part]:
        place = Spot(item.latitude_deg, item.longitude_deg, item.altitude_m)
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            yield from self._climb(command, place)
        elif item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            yield from self._round(command, place, abs(item.parameters[2]))
        elif item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH or item.at_home:
            yield from self._go_home(command, item)
        elif item.is_positional and item.command < mavlink.MAV_CMD_NAV_LAST:
            yield from self._go_to(command, place)

    def _climb(self, command: int, place: Spot) -> Iterator[Part]:
        """Rise to the height of a place; the way there is the next item's."""
        height_m = place.relative_altitude_m
        if not self._here:
            yield Way(command, None, place)
            return
        above = tuple(spot._replace(relative_altitude_m=height_m) for spot in self._here)
        yield from (Way(command, spot, top) for spot, top in zip(self._here, above, strict=True))
        self._here = above

    def _go_home(self, command: int, item: MissionItem) -> Iterator[Part]:
        if self._home is None:
            self._here = ()
            return
        home = Spot(self._home.latitude_deg, self._home.longitude_deg, item.altitude_m)
        yield from self._go_to(command, home, *(() if item.at_home else self._rally))

    def _go_to(self, command: int, *places: Spot) -> Iterator[Part]:
        """Go to one of these places."""
        for place in places:
            if not self._here:
                yield Way(command, None, place)
            yield from (Way(command, spot, place) for spot in self._here)
        self._here = places

    def _live(self, segment: LiveCommand) -> Iterator[Part]:
        action, index = segment.action, segment.command
        if action.approach is not None:
            yield from self._go_to(index, action.approach)
        command = self._commands[index]
        end = action.end.turn if isinstance(action.end, Circled) else action.end
        if isinstance(end, Turned) and isinstance(command, NavHotpoint):
            height_m = command.parameters.orbit_altitude
            centre = Spot(end.latitude_deg, end.longitude_deg, height_m)
            yield from self._round(index, centre, end.radius_m)
        elif action.follow is not None:
            yield from self._go_to(index, action.follow)
        elif action.moves and action.approach is None:
            self._here = ()

    def _round(self, command: int, centre: Spot, radius_m: float) -> Iterator[Part]:
        """Enter a circle at its nearest point, go round it, be there again."""
        entries: dict[Spot, None] = {}
        for spot in self._here:
            for entry in _entries(spot, centre, radius_m):
                entries[entry] = None
                yield Way(command, spot, entry)
        yield Round(command, centre, radius_m)
        self._here = tuple(entries)


def _entries(spot: Spot, centre: Spot, radius_m: float) -> Iterator[Spot]:
    """Give the nearest point of a circle; from its centre that is any of them."""
    north_m, east_m = offset(*centre[:2], *spot[:2])
    bearings_deg: Iterable[float] = (math.degrees(math.atan2(east_m, north_m)),)
    if math.hypot(north_m, east_m) <= _AT_CENTRE_M:
        bearings_deg = _EVERY_BEARING_DEG
    for bearing_deg in bearings_deg:
        yield Spot(*shifted(*centre[:2], bearing_deg, radius_m), centre.relative_altitude_m)
