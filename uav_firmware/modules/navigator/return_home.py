"""Return: climb, fly home or to the nearest rally point, wait if asked to, land.

    TRAVEL --over home, RTL_LAND_DELAY = 0------------------------> LAND --landed--> done
    TRAVEL --over home, otherwise--> WAIT --RTL_LAND_DELAY passed--> LAND
                                     WAIT --RTL_LAND_DELAY < 0--> done, stays there

From within RTL_MIN_DIST of where it lands it does not climb first. "Home" stands for the place
chosen: the return point of a fence that was breached, else the nearest of home and the rally
points, of those that can be reached within the fence if there are any.
"""

import math
from enum import Enum, auto

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.land import Land, land_here
from uav_firmware.msg.vectors import Vector3


class ReturnPhase(Enum):
    """Where a return stands."""

    TRAVEL = auto()
    WAIT = auto()
    LAND = auto()


class ReturnHome:
    """Flies home; without a home it lands where it is."""

    def __init__(self, flight: Flight) -> None:
        self.phase = ReturnPhase.TRAVEL
        self._land: Land | None = None
        self._waiting_since_us = 0
        self._over_home: Vector3 = flight.rest_point()
        flight.face(math.nan)
        self._goal = choose_goal(flight)
        if self._goal is None:
            self._begin_landing(flight)
        else:
            self._travel(flight, self._goal)

    def step(self, flight: Flight) -> bool:
        """Whether the vehicle has landed, or waits for ever above home."""
        delay = flight.params.return_land_delay
        radius = flight.params.acceptance_radius
        if self.phase is ReturnPhase.TRAVEL and flight.path.resting:
            if flight.arrived(self._over_home, radius):
                self._arrive(flight)
        elif self.phase is ReturnPhase.WAIT:
            waited = (flight.now_us - self._waiting_since_us) * 1e-6
            if flight.path.resting and 0.0 <= delay <= waited:
                self._begin_landing(flight)
        landed = self._land is not None and self._land.step(flight)
        return landed or (self.phase is ReturnPhase.WAIT and delay < 0.0 and flight.path.resting)

    def _travel(self, flight: Flight, goal: Vector3) -> None:
        here = flight.rest_point()
        distance = math.hypot(goal[0] - here[0], goal[1] - here[1])
        down = here[2]
        if distance > flight.params.return_close_radius:
            height = max(flight.params.return_height, flight.height_of(goal[2]))
            down = min(down, flight.home_down(min(height, flight.fence.height_max)))
        self._over_home = (goal[0], goal[1], down)
        climb = flight.stop_at((here[0], here[1], down))
        flight.fly(climb, flight.stop_at(self._over_home))

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


def choose_goal(flight: Flight) -> Vector3 | None:
    """Where a return leads [m, NED]; a rally point's height is the least that it is flown to at."""
    if flight.breached and flight.fence_return is not None:
        return flight.fence_return
    here = flight.rest_point()[:2]
    home = () if flight.home is None else (flight.home.position_ned,)
    allowed = tuple(point for point in flight.rally_points if flight.fence.allows(point[:2]))
    places = (*home, *allowed)
    within = [point for point in places if flight.fence.line_allowed(here, point[:2])]
    return min(within or places, key=lambda point: math.dist(here, point[:2]), default=None)
