"""Return to launch: climb, fly home or to the nearest rally point, wait, land.

    TRAVEL --over home, RTL_LAND_DELAY = 0------------------------> LAND --landed--> done
    TRAVEL --over home, otherwise--> WAIT --RTL_LAND_DELAY passed--> LAND
                                     WAIT --RTL_LAND_DELAY < 0--> done, stays there
    TRAVEL, WAIT --kept away by the wind--> LAND, where it is

Within RTL_MIN_DIST of the landing point it does not climb first. "Home" is the destination: the
return point of a geofence that is breached, else of home and the rally points the one with the
shortest path within the geofence. Without such a path it returns straight and reports that.

A return that a failsafe orders in too strong a wind climbs to RTL_DESCEND_ALT at most, never to
RTL_RETURN_ALT: higher the wind is stronger, and the vehicle would be blown away. It never
descends before it is home, and that height is one at which it may wait there, so that ground
which rises towards home does not stand in its way.
"""

import math
import operator
from enum import Enum, auto
from typing import Final

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.geofence.detour import find_detour, length
from uav_firmware.modules.navigator.geofence.geofence import Point
from uav_firmware.modules.navigator.modes.approach import Approach
from uav_firmware.modules.navigator.modes.land import Land, land_here
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.msg.mission import ModeTarget, ReturnOrder
from uav_firmware.msg.status import Severity
from uav_firmware.msg.vectors import Vector3

_PATIENCE_S: Final = 10.0  # [s] Longer than gusts: it will not land at home
_BELOW_CEILING_M: Final = 1.0  # [m] Gusts and the estimate's noise take less
_BELOW_CEILING_SHARE: Final = 0.2  # Of a ceiling that is low itself


class ReturnPhase(Enum):
    """Phase of a return."""

    TRAVEL = auto()
    WAIT = auto()
    LAND = auto()


class ReturnToLaunch:
    """Flies to the destination; without a home it lands at the present position."""

    def __init__(self, flight: Flight, *, stays_low: bool = False) -> None:
        self.phase = ReturnPhase.TRAVEL
        self._stays_low = stays_low  # In too strong a wind
        self._approach = Approach(_PATIENCE_S)
        flight.begin_where_it_is()
        self._land: Land | None = None
        self._waiting_since_us = 0
        self._over_home: Vector3 = flight.rest_point()
        flight.face(math.nan)
        self._goal, turns = choose_destination(flight)
        if self._goal is None:
            self._begin_landing(flight)
        else:
            self._travel(flight, self._goal, turns)

    def step(self, flight: Flight) -> bool:
        """Whether the vehicle has landed, or waits above home without a limit of time."""
        delay = flight.params.return_land_delay
        radius = flight.params.acceptance_radius
        self._give_up_if_stalled(flight)
        if self.phase is ReturnPhase.TRAVEL and flight.path.resting:
            if flight.arrived(self._over_home, radius):
                self._arrive(flight)
        elif self.phase is ReturnPhase.WAIT:
            waited = (flight.now_us - self._waiting_since_us) * 1e-6
            if flight.path.resting and 0.0 <= delay <= waited:
                self._begin_landing(flight)
        landed = self._land is not None and self._land.step(flight)
        return landed or (self.phase is ReturnPhase.WAIT and delay < 0.0 and flight.path.resting)

    def _travel(self, flight: Flight, goal: Vector3, turns: tuple[Point, ...]) -> None:
        here = flight.rest_point()
        distance = math.hypot(goal[0] - here[0], goal[1] - here[1])
        down = here[2]
        if distance > flight.params.return_close_radius:
            heights = (self._return_height(flight), flight.height_of(goal[2]))
            height = max(*heights, flight.height_of(down))
            down = flight.home_down(min(height, _below(flight.fence.height_max)))
        self._over_home = (goal[0], goal[1], down)
        climb = flight.stop_at((here[0], here[1], down))
        on_the_way = [flight.stop_at((*turn, down)) for turn in turns]
        flight.fly(climb, *on_the_way, flight.stop_at(self._over_home))

    def _return_height(self, flight: Flight) -> float:
        """Height above home [m] to climb to at least."""
        params = flight.params
        if self._stays_low:
            return min(params.return_height, params.return_descend_height)
        return params.return_height

    def _give_up_if_stalled(self, flight: Flight) -> None:
        """Land where the vehicle is, if the wind has kept it from getting nearer for long."""
        place = flight.path.goal or self._over_home
        if self.phase is ReturnPhase.LAND or not self._approach.has_stalled(flight, place):
            return
        flight.report(Severity.CRITICAL, "No way home against the wind: landing here")
        self.phase = ReturnPhase.LAND
        self._land = land_here(flight)
        self._land.descend_here(flight)

    def _arrive(self, flight: Flight) -> None:
        if flight.params.return_land_delay == 0.0:
            self._begin_landing(flight)
            return
        self.phase = ReturnPhase.WAIT
        self._waiting_since_us = flight.now_us
        north, east, down = self._over_home
        down = max(down, flight.home_down(flight.params.return_descend_height))
        flight.fly(flight.stop_at((north, east, down)))

    def _begin_landing(self, flight: Flight) -> None:
        self.phase = ReturnPhase.LAND
        if self._goal is None:
            self._land = land_here(flight)
        else:
            ground = (self._goal[0], self._goal[1], flight.home_down(0.0))
            self._land = Land(flight, ground, math.nan)


def _below(ceiling: float) -> float:
    """Height above home [m] with a margin for overshoot below the ceiling."""
    return ceiling - min(_BELOW_CEILING_M, _BELOW_CEILING_SHARE * ceiling)


def choose_destination(flight: Flight) -> tuple[Vector3 | None, tuple[Point, ...]]:
    """Destination of a return [m, NED], and the points at which its path turns.

    The altitude of a rally point is the lowest at which it is approached.
    """
    if flight.breached and flight.fence_return is not None:
        return flight.fence_return, ()
    here = flight.rest_point()[:2]
    home = () if flight.home is None else (flight.home.position_ned,)
    allowed = tuple(point for point in flight.rally_points if flight.fence.allows(point[:2]))
    places = (*home, *allowed)
    paths = [
        (length(here, turns, place[:2]), place, turns)
        for place in places
        if (turns := find_detour(flight.fence, here, place[:2])) is not None
    ]
    if paths:
        _, place, turns = min(paths, key=operator.itemgetter(0))
        return place, turns
    nearest = min(places, key=lambda point: math.dist(here, point[:2]), default=None)
    if nearest is not None and not flight.breached:
        flight.report(Severity.WARNING, "No path home within the geofence")
    return nearest, ()


class ReturnMode(NavigatorMode):
    """AUTO_RTL."""

    def __init__(self) -> None:
        self._return: ReturnToLaunch | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the return; a return has its own destination, and its order is to stay low."""
        self.finished = False
        self._return = ReturnToLaunch(flight, stays_low=isinstance(target, ReturnOrder))

    def on_active(self, flight: Flight) -> None:
        """Finish when the vehicle has landed or waits."""
        if not self.finished and self._return is not None:
            self.finished = self._return.step(flight)
