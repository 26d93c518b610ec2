"""Where a vehicle will be, from the commands of its mission: legs, circles and heights. Pure.

A take-off climbs where the vehicle is and then flies to its place; a circle is entered at its
start point, or else at the nearest point, and left there after one turn. Where a vehicle is after
it has tracked a subject is not known, nor where it stands before it was heard: a leg that begins
there is known by its end alone.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from afarcloud.commands import (
    Command,
    NavFollowTarget,
    NavHome,
    NavHotpoint,
    NavHotpointParameters,
    NavLand,
    NavTakeoff,
    NavTrackSubject,
    NavWaypoint,
)
from afarcloud.enumerations import StartPoint, TrackMode
from afarcloud.geodesy import offset, shifted

DEFAULT_ALTITUDE_M: Final = 10.0
"""Height above home at which a vehicle flies home before any command has set a height."""
START_BEARINGS_DEG: Final = {
    StartPoint.NORTH: 0.0,
    StartPoint.EAST: 90.0,
    StartPoint.SOUTH: 180.0,
    StartPoint.WEST: 270.0,
}
"""Of a circle's start points, seen from its centre, clockwise from north."""
_EVERY_BEARING_DEG: Final = range(0, 360, 10)
_FOLLOWED_UP: Final = 3
"""Of so many legs from a circle's centre to its line, one is followed beyond the circle."""
_THERE_M: Final = 0.01


class Spot(NamedTuple):
    """A place in the air."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float  # Above home


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight flight to a place; `start` None: from an unknown place."""

    command: int  # Its place in the mission
    start: Spot | None
    end: Spot


@dataclass(frozen=True, slots=True)
class Circle:
    """A full turn."""

    command: int  # Its place in the mission
    centre: Spot
    radius_m: float


Part: TypeAlias = Leg | Circle


def route_of(
    commands: Sequence[Command],
    start: Spot | None,
    home: Spot | None,
    rally: Sequence[Spot] = (),
) -> Iterator[Part]:
    """Go through a mission; without a home, legs to it are left out.

    A vehicle that is to return may choose a rally point instead: the legs to all of them count.
    """
    return _Walk(start, home, tuple(rally)).go(commands)


def highest_m(commands: Sequence[Command]) -> float:
    """Give the greatest height above home that a mission asks for [m]; 0 where it asks for none."""
    parts = route_of(commands, None, None)
    heights = (part.end if isinstance(part, Leg) else part.centre for part in parts)
    return max((spot.relative_altitude_m for spot in heights), default=0.0)


def spot_of(command: Command) -> Spot | None:
    """Where a command takes the vehicle, a circle's centre included; None without a place."""
    match command:
        case NavTakeoff(parameters=p) | NavWaypoint(parameters=p) | NavFollowTarget(parameters=p):
            return Spot(p.latitude, p.longitude, p.altitude)
        case NavLand(parameters=p):
            return Spot(p.latitude, p.longitude, p.landing_altitude)
        case NavHotpoint(parameters=p):
            return Spot(p.latitude, p.longitude, p.orbit_altitude)
        case _:
            return None


def start_point(p: NavHotpointParameters) -> Spot | None:
    """Where on its circle a turn begins; None: at the nearest point."""
    bearing_deg = START_BEARINGS_DEG.get(p.start_point)
    if bearing_deg is None:
        return None
    return Spot(*shifted(p.latitude, p.longitude, bearing_deg, p.radius), p.orbit_altitude)


class _Walk:
    """Tracks where the vehicle is: one of these places; empty if that is not known."""

    def __init__(self, start: Spot | None, home: Spot | None, rally: tuple[Spot, ...]) -> None:
        self._home = home
        self._rally = rally
        self._here: tuple[Spot, ...] = () if start is None else (start,)
        self._altitude_m = DEFAULT_ALTITUDE_M

    def go(self, commands: Sequence[Command]) -> Iterator[Part]:
        for index, command in enumerate(commands):
            place = spot_of(command)
            match command:
                case NavTakeoff() if place is not None:
                    yield from self._take_off(index, place)
                case NavWaypoint() | NavFollowTarget() if place is not None:
                    yield from self._go_to(index, place)
                case NavLand() if place is not None:
                    yield from self._land(index, place)
                case NavHotpoint(parameters=p):
                    yield from self._circle(index, p)
                case NavHome(parameters=p):
                    yield from self._go_home(index, landing=p.landing)
                case NavTrackSubject(parameters=p) if p.track_mode is not TrackMode.SPOTLIGHT_PRO:
                    self._here = ()
                case _:
                    pass

    def _take_off(self, command: int, place: Spot) -> Iterator[Part]:
        """Rise to the height of a place, then go there."""
        height_m = place.relative_altitude_m
        above = tuple(spot._replace(relative_altitude_m=height_m) for spot in self._here)
        yield from (Leg(command, spot, top) for spot, top in zip(self._here, above, strict=True))
        self._here = above
        yield from self._go_to(command, place)

    def _land(self, command: int, place: Spot) -> Iterator[Part]:
        """Go above a place and down; the height of the mission stays what it was."""
        before_m = self._altitude_m
        yield from self._go_to(command, place)
        self._altitude_m = before_m

    def _go_home(self, command: int, *, landing: bool) -> Iterator[Part]:
        if self._home is None:
            self._here = ()
            return
        height_m = 0.0 if landing else self._altitude_m
        home = self._home._replace(relative_altitude_m=height_m)
        altitude_m = self._altitude_m
        yield from self._go_to(command, home, *(self._rally if landing else ()))
        self._altitude_m = altitude_m

    def _go_to(self, command: int, *places: Spot) -> Iterator[Part]:
        """Go to one of these places."""
        for place in places:
            if not self._here:
                yield Leg(command, None, place)
            yield from (Leg(command, spot, place) for spot in self._here)
        self._here = places
        self._altitude_m = places[0].relative_altitude_m

    def _circle(self, command: int, p: NavHotpointParameters) -> Iterator[Part]:
        """Enter a circle, go round it, be there again."""
        named = start_point(p)
        if named is not None:
            yield from self._go_to(command, named)
        centre = Spot(p.latitude, p.longitude, p.orbit_altitude)
        entries: dict[Spot, None] = {}
        for spot in self._here:
            reached = list(_entries(spot, centre, p.radius))
            entries |= dict.fromkeys(reached[::_FOLLOWED_UP])
            yield from (Leg(command, spot, entry) for entry in reached)
        yield Circle(command, centre, p.radius)
        self._here = tuple(entries)
        self._altitude_m = p.orbit_altitude


def _entries(spot: Spot, centre: Spot, radius_m: float) -> Iterator[Spot]:
    """Give the nearest point of a circle, which may be the spot; from its centre any of them."""
    north_m, east_m = offset(*centre[:2], *spot[:2])
    if abs(math.hypot(north_m, east_m) - radius_m) <= _THERE_M:
        yield spot._replace(relative_altitude_m=centre.relative_altitude_m)
        return
    bearings_deg: Iterable[float] = (math.degrees(math.atan2(east_m, north_m)),)
    if math.hypot(north_m, east_m) <= _THERE_M:
        bearings_deg = _EVERY_BEARING_DEG
    for bearing_deg in bearings_deg:
        yield Spot(*shifted(*centre[:2], bearing_deg, radius_m), centre.relative_altitude_m)
