"""Kinematics of a simulated vehicle about its home, and the truth of what it did.

Geometry is the simulation's own: what is wrong in the broker must not be right here by the same
mistake.
"""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from dst.vehicles.pictures import Picture
    from dst.vehicles.tracking import Tracked

HOME: Final = (40.44340, -3.73820, 650.0)
"""Latitude, longitude [deg], altitude above mean sea level [m]."""
HOME_E7: Final = round(HOME[0] * 1e7), round(HOME[1] * 1e7)
_METRES_PER_DEGREE_NORTH: Final = 111_320.0
_METRES_PER_DEGREE_EAST: Final = _METRES_PER_DEGREE_NORTH * math.cos(math.radians(HOME[0]))

STEP_S: Final = 0.25
SPEED_M_S: Final = 5.0
CLIMB_M_S: Final = 2.0
SINK_M_S: Final = 1.0
"""While it lands."""
LOWEST_RETURN_M: Final = 5.0
"""Height in which a vehicle flies home at least."""
ACCEPTANCE_M: Final = 1.0


class Reached(NamedTuple):
    """A waypoint that was flown, by truth."""

    time_s: float
    latitude_e7: int
    longitude_e7: int


class Arming(NamedTuple):
    """An order to arm that was obeyed."""

    time_s: float
    places_e7: frozenset[tuple[int, int]] = frozenset()
    """Latitude and longitude [1e-7 deg] of the waypoints of the mission that the vehicle had then,
    but those at home; none where they are not known."""


class OrderUnderPilot(NamedTuple):
    """An order that arrived while the pilot flew."""

    time_s: float
    pilot_since_s: float
    name: str


@dataclass
class Truth:
    """What a vehicle did, whatever anybody has learnt of it."""

    aircraft: int = 0
    """Its serial number."""
    north_m: float = 0.0
    east_m: float = 0.0
    height_m: float = 0.0
    reached: list[Reached] = field(default_factory=list)
    armings: list[Arming] = field(default_factory=list)
    """By an order, oldest first."""
    turned_rad: dict[tuple[int, int], float] = field(default_factory=dict)
    """Angle flown round each centre: latitude and longitude [1e-7 deg]."""
    orders_under_pilot: list[OrderUnderPilot] = field(default_factory=list)
    motor_failures_s: list[float] = field(default_factory=list)
    """When a motor failed, high enough that there was time to report it."""
    flight_s: float = 0.0
    furthest_m: float = 0.0
    """From home, horizontally."""
    highest_m: float = 0.0
    hardest_m_s: float = 0.0
    """Speed of the hardest touchdown of a vehicle whose autopilot ran."""
    place_e7: tuple[int, int] | None = None
    """Latitude and longitude [1e-7 deg] of the waypoint or centre that it was ordered to last."""
    pictures: "list[Picture]" = field(default_factory=list)
    tracked: "list[Tracked]" = field(default_factory=list)
    """Subjects that its camera was ordered to track."""
    is_tracking: bool = False

    def note_place(self) -> None:
        """Note how far and how high it is."""
        self.highest_m = max(self.highest_m, self.height_m)
        self.furthest_m = max(self.furthest_m, math.hypot(self.north_m, self.east_m))


@dataclass
class Circle:
    """A circle about a place, north and east of home [m]; its radius is negative to the left."""

    north_m: float
    east_m: float
    height_m: float
    radius_m: float
    speed_m_s: float
    latitude_e7: int
    longitude_e7: int
    turned_rad: float = 0.0


def place(north_m: float, east_m: float) -> tuple[float, float]:
    """Give the latitude and longitude [deg] of a place relative to home."""
    return HOME[0] + north_m / _METRES_PER_DEGREE_NORTH, HOME[1] + east_m / _METRES_PER_DEGREE_EAST


def offset_m(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Give a place relative to home, north and east [m]."""
    return (
        (latitude_deg - HOME[0]) * _METRES_PER_DEGREE_NORTH,
        (longitude_deg - HOME[1]) * _METRES_PER_DEGREE_EAST,
    )


def is_same_place(one_e7: tuple[int, int] | None, other_e7: tuple[int, int] | None) -> bool:
    """Whether two places are the same but for rounding; latitude and longitude [1e-7 deg]."""
    if one_e7 is None or other_e7 is None:
        return False
    return all(abs(one - other) <= 2 for one, other in zip(one_e7, other_e7, strict=True))


class Flight:
    """Moves a vehicle, a step at a time."""

    def __init__(self) -> None:
        """Stand at home."""
        self.truth = Truth()
        self.speed_m_s = SPEED_M_S

    def approach(self, target: tuple[float, float, float]) -> bool:
        """Fly towards a place: north, east, height [m]; gives whether it is reached."""
        truth = self.truth
        north_m, east_m = target[0] - truth.north_m, target[1] - truth.east_m
        climb_m = target[2] - truth.height_m
        self._move(math.copysign(min(abs(climb_m), CLIMB_M_S * STEP_S), climb_m))
        distance_m = math.hypot(north_m, east_m)
        if distance_m > 0.0:
            share = min(1.0, self.speed_m_s * STEP_S / distance_m)
            truth.north_m += share * north_m
            truth.east_m += share * east_m
        return distance_m < ACCEPTANCE_M and abs(climb_m) < ACCEPTANCE_M

    def descend(self) -> bool:
        """Sink; gives whether it stands."""
        self._move(-min(self.truth.height_m, SINK_M_S * STEP_S))
        return self.truth.height_m <= 0.0

    def come_home(self) -> bool:
        """Fly home and sink there, in one mode as all autopilots do; gives whether it stands."""
        truth = self.truth
        if truth.north_m or truth.east_m:
            self.approach((0.0, 0.0, max(truth.height_m, LOWEST_RETURN_M)))
            return False
        return self.descend()

    def _move(self, climb_m: float) -> None:
        """Move vertically in one step."""
        truth = self.truth
        was_flying = truth.height_m > 0.0
        truth.height_m = max(0.0, truth.height_m + climb_m)
        if was_flying and truth.height_m <= 0.0:
            truth.hardest_m_s = max(truth.hardest_m_s, -climb_m / STEP_S)
        truth.note_place()

    def turn(self, circle: Circle) -> bool:
        """Fly to the nearest point of a circle, then round it; gives whether a turn is complete."""
        truth, radius_m = self.truth, abs(circle.radius_m)
        bearing = math.atan2(truth.east_m - circle.east_m, truth.north_m - circle.north_m)
        step = 0.0
        if circle.turned_rad or self._is_at(circle, bearing):
            step = circle.speed_m_s * STEP_S / radius_m
            bearing += math.copysign(step, circle.radius_m)
            truth.north_m = circle.north_m + radius_m * math.cos(bearing)
            truth.east_m = circle.east_m + radius_m * math.sin(bearing)
        circle.turned_rad += step
        centre = circle.latitude_e7, circle.longitude_e7
        truth.place_e7 = centre
        truth.turned_rad[centre] = truth.turned_rad.get(centre, 0.0) + step
        return circle.turned_rad >= math.tau

    def _is_at(self, circle: Circle, bearing: float) -> bool:
        north_m = circle.north_m + abs(circle.radius_m) * math.cos(bearing)
        east_m = circle.east_m + abs(circle.radius_m) * math.sin(bearing)
        return self.approach((north_m, east_m, circle.height_m))
