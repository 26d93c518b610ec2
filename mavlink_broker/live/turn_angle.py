"""How far a vehicle has gone round a centre, from its positions."""

import math
from dataclasses import replace
from typing import Final

from afarcloud.geodesy import offset
from mavlink_broker.planning.live_actions import Turned
from mavlink_broker.recovery.record import Pose

ALMOST: Final = 0.99
"""Share of a turn at which it is ended: the vehicle needs some time to stop."""


class Turning:
    """Counts how far a vehicle has gone round a centre, from its positions."""

    def __init__(self, end: Turned) -> None:
        self._end = end
        self._bearing: float | None = None
        self._first: float | None = None  # Bearing at which an earlier run began
        self._flown_rad = 0.0  # Since then, about
        self.turned_rad = 0.0

    def move_to(self, latitude_deg: float, longitude_deg: float) -> None:
        """Have the centre somewhere else from now on; what has been turned counts on."""
        self._end = replace(self._end, latitude_deg=latitude_deg, longitude_deg=longitude_deg)

    def resume(self, start: Pose | None, elapsed_s: float) -> None:
        """Count on from where an earlier run of the broker began, so many seconds ago.

        The next position tells what of the turn is over, and the time how many whole ones are;
        where nobody knows the beginning, the time tells all of it.
        """
        end = self._end
        self._flown_rad = end.speed_m_s / end.radius_m * elapsed_s
        if start is None:
            self.turned_rad = self._flown_rad
            return
        north, east = offset(end.latitude_deg, end.longitude_deg, *start[:2])
        self._first = math.atan2(east, north)

    def take(self, latitude_deg: float, longitude_deg: float) -> None:
        """Take a position; off the circle nothing counts."""
        end = self._end
        north, east = offset(end.latitude_deg, end.longitude_deg, latitude_deg, longitude_deg)
        bearing, distance = math.atan2(east, north), math.hypot(north, east)
        if abs(distance - end.radius_m) > max(2.0, 0.3 * end.radius_m):
            self._bearing = None
            return
        if self._bearing is not None:
            step = math.remainder(bearing - self._bearing, 2.0 * math.pi)
            self.turned_rad += step if end.is_clockwise else -step
        elif self._first is not None:
            self._count_earlier(bearing, self._first)
        self._bearing, self._first = bearing, None

    def _count_earlier(self, bearing: float, first: float) -> None:
        """Take the angle that is nearest to what the time tells, of those that end here."""
        sense = 1.0 if self._end.is_clockwise else -1.0
        ahead = sense * (bearing - first) % (2.0 * math.pi)
        turns = round((self._flown_rad - ahead) / (2.0 * math.pi))
        self.turned_rad = max(0.0, ahead + turns * 2.0 * math.pi)

    @property
    def is_on_circle(self) -> bool:
        """Whether the vehicle was there when it was last seen."""
        return self._bearing is not None

    @property
    def share(self) -> float:
        """How much of it has been flown, 1 for all; 0 of a turn without an end."""
        return self.turned_rad / self._end.angle_rad

    @property
    def is_complete(self) -> bool:
        """Whether the angle has been flown, but for what it takes to stop."""
        return self.turned_rad >= ALMOST * self._end.angle_rad
