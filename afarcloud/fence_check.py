"""The one check of geofences: a mission against inclusion, exclusion and height; pure.

The program that receives a plan checks it with the plan alone; the program that flies it checks it
again with the vehicle's position and home. Both get the same result as far as they have the same
data. Vehicles themselves check too little and too late: some check only places, and let a leg or a
circle cross a forbidden area.

A leg or circle that is flown again is checked once, and the number of comparisons is limited to
`area.MOST_COMPARISONS` until `renew`: TooManyComparisonsError beyond it.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Final, NamedTuple, TypeAlias

from afarcloud import geometry
from afarcloud.area import MOST_COMPARISONS, TOLERANCE_M, Area, TooManyComparisonsError, Vertex
from afarcloud.commands import Command
from afarcloud.enumerations import CommandType
from afarcloud.plan import Geofence
from afarcloud.route import Leg, Part, Spot, route_of

ALTITUDE_TOLERANCE_M: Final = 0.01
SMALLEST_M2: Final = TOLERANCE_M**2
"""Of a polygon: in a smaller one no place is a violation, and none is surely inside."""
PLACE: Final = "latitude, longitude"
_MOST_KNOWN: Final = 50_000
Flown: TypeAlias = tuple[Vertex | None, Vertex, float]
"""A leg over ground: from where, to where, 0; or nothing, a circle's centre, and its radius."""
_ALTITUDE_NAMES: Final = {
    CommandType.NAV_LAND: "landing_altitude",
    CommandType.NAV_HOTPOINT: "orbit_altitude",
    CommandType.NAV_HOME: "landing",
}
_PLACE_NAMES: Final = {CommandType.NAV_HOME: "landing"}


class FenceFault(NamedTuple):
    """One violation."""

    command: int  # Its place in the mission
    parameter: str  # Of the command, as AFarCloud names it
    text: str
    is_height: bool = False


class OutlineFault(NamedTuple):
    """A polygon that autopilots interpret differently."""

    field: str  # Of the geofence: inclusion.0
    text: str


class FenceCheck:
    """One geofence, and the check of missions, places and legs against it."""

    def __init__(self, geofence: Geofence) -> None:
        self._geofence = geofence
        self._area = Area(geofence)
        self._height_m = geofence.max_altitude
        self._known: dict[Flown, str | None] = {}

    @property
    def too_many_comparisons(self) -> OutlineFault:
        """The fault of the geofence after a TooManyComparisonsError."""
        fence = self._geofence
        inclusion, exclusion = (sum(map(len, one)) for one in (fence.inclusion, fence.exclusion))
        text = (
            f"takes more than {MOST_COMPARISONS} comparisons to check all legs of the plan: give "
            "it fewer corners and polygons, or the plan fewer commands"
        )
        return OutlineFault("inclusion" if inclusion > exclusion else "exclusion", text)

    def renew(self) -> None:
        """Set the count of comparisons to 0."""
        self._area.comparisons = 0

    @cached_property
    def outline_faults(self) -> tuple[OutlineFault, ...]:
        """The polygons that cross themselves, or enclose nothing."""
        return tuple(
            OutlineFault(f"{name}.{index}", text)
            for name in ("inclusion", "exclusion")
            for index, outline in enumerate(getattr(self._geofence, name))
            if (text := geometry.ring_fault(outline, SMALLEST_M2)) is not None
        )

    def faults(
        self,
        commands: Sequence[Command],
        *,
        start: Spot | None = None,
        home: Spot | None = None,
        rally: Sequence[Spot] = (),
        own_limit_m: float | None = None,
    ) -> Iterator[FenceFault]:
        """Follow a vehicle through its mission from where it is.

        What is not known yet (`start`, `home`) is not checked. `own_limit_m` is a height that the
        vehicle keeps below by itself.

        Raises:
            TooManyComparisonsError: when too many comparisons have been made since `renew`.
        """
        yield from self._faults_of_beginning(start, home)
        for part in route_of(commands, start, home, rally):
            command = commands[part.command]
            height_m = _spot_of(part).relative_altitude_m
            name = _place_name(command) + ("" if isinstance(part, Leg) else ", radius")
            fault = self._fault_of(part)
            if fault is not None:
                yield FenceFault(part.command, name, fault)
            fault = self._height_fault(height_m) or _own_fault(height_m, own_limit_m)
            if fault is not None:
                yield FenceFault(part.command, altitude_name(command), fault, is_height=True)

    def faults_of_place(self, place: Spot) -> Iterator[FenceFault]:
        """Check a place that belongs to no command, such as a rally point."""
        fault = self._area.fault_at(place[:2])
        if fault is not None:
            yield FenceFault(0, PLACE, fault)
        fault = self._height_fault(place.relative_altitude_m)
        if fault is not None:
            yield FenceFault(0, "altitude", fault, is_height=True)

    def fault_of_order(self, start: Vertex | None, target: Spot) -> str | None:
        """Return why a vehicle must not be sent to a target, or None.

        A vehicle that is outside the geofence may return by any path.
        """
        self.renew()
        height_m = target.relative_altitude_m
        try:
            fault = self._fault_of_leg(start, target)
        except TooManyComparisonsError:
            fault = f"geofence.{self.too_many_comparisons.field} {self.too_many_comparisons.text}"
        return fault or self._height_fault(height_m)

    def _fault_of_leg(self, start: Vertex | None, target: Spot) -> str | None:
        strayed = start is not None and self._area.fault_at(start) is not None
        here = None if start is None or strayed else Spot(*start, target.relative_altitude_m)
        return self._fault_of(Leg(0, here, target))

    def _faults_of_beginning(self, start: Spot | None, home: Spot | None) -> Iterator[FenceFault]:
        for name, place in (("the vehicle", start), ("home", home)):
            fault = self._area.fault_at(place[:2]) if place else None
            if fault is not None:
                yield FenceFault(0, PLACE, f"{name} {fault}")
        fault = None if start is None else self._height_fault(start.relative_altitude_m)
        if fault is not None:
            text = f"the vehicle is too high: {fault}"
            yield FenceFault(0, "altitude", text, is_height=True)

    def _fault_of(self, part: Part) -> str | None:
        """Check a part; the result for the same leg or circle over ground is cached."""
        if isinstance(part, Leg):
            flown: Flown = (part.start and part.start[:2], part.end[:2], 0.0)
        else:
            flown = (None, part.centre[:2], part.radius_m)
        if flown not in self._known:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[flown] = self._check(part)
        return self._known[flown]

    def _check(self, part: Part) -> str | None:
        place = _spot_of(part)[:2]
        if not isinstance(part, Leg):
            fault = self._area.fault_on_circle(place, part.radius_m)
            return fault and f"the circle {fault}"
        fault = self._area.fault_at(place)
        if fault is not None:
            return f"the place {fault}"
        fault = None if part.start is None else self._area.fault_on_leg(part.start[:2], place)
        return fault and f"the leg there {fault}"

    def _height_fault(self, height_m: float) -> str | None:
        if self._height_m is None or height_m <= self._height_m + ALTITUDE_TOLERANCE_M:
            return None
        return f"{height_m:g} m is above geofence.max_altitude, {self._height_m:g} m"


def _own_fault(height_m: float, own_limit_m: float | None) -> str | None:
    if own_limit_m is None or height_m <= own_limit_m + ALTITUDE_TOLERANCE_M:
        return None
    return f"{height_m:g} m is above the vehicle's own limit, {own_limit_m:g} m"


def _place_name(command: Command) -> str:
    """Name the parameters of a command's position."""
    return _PLACE_NAMES.get(command.command_type_id, PLACE)


def altitude_name(command: Command) -> str:
    """Name the parameter of a command's height."""
    return _ALTITUDE_NAMES.get(command.command_type_id, "altitude")


def _spot_of(part: Part) -> Spot:
    return part.end if isinstance(part, Leg) else part.centre
