"""Return: climb, fly home, wait if asked to, land.

    TRAVEL --over home, RTL_LAND_DELAY = 0------------------------> LAND --landed--> done
    TRAVEL --over home, otherwise--> WAIT --RTL_LAND_DELAY passed--> LAND
                                     WAIT --RTL_LAND_DELAY < 0--> done, stays there

From within RTL_MIN_DIST of home it does not climb first.
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
        if flight.home is None:
            self._begin_landing(flight)
        else:
            self._travel(flight, flight.home.position_ned)

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

    def _travel(self, flight: Flight, home: Vector3) -> None:
        here = flight.rest_point()
        distance = math.hypot(home[0] - here[0], home[1] - here[1])
        down = here[2]
        if distance > flight.params.return_close_radius:
            down = min(down, flight.home_down(flight.params.return_height))
        self._over_home = (home[0], home[1], down)
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
        if flight.home is None:
            self._land = land_here(flight)
        else:
            self._land = Land(flight, flight.home.position_ned, math.nan)
