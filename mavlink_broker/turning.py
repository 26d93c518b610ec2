"""How far a vehicle has gone round a centre, from its positions."""

import math
from dataclasses import replace
from typing import Final

from mavlink_broker.translation.geo import offset
from mavlink_broker.translation.live import Turned

ALMOST: Final = 0.99
"""Share of a turn at which it is ended: the vehicle needs some time to stop."""


class Turning:
    """Counts how far a vehicle has gone round a centre, from its positions."""

    def __init__(self, end: Turned) -> None:
        self._end = end
        self._bearing: float | None = None
        self.turned_rad = 0.0

    def move_to(self, latitude_deg: float, longitude_deg: float) -> None:
        """Have the centre somewhere else from now on; what has been turned counts on."""
        self._end = replace(self._end, latitude_deg=latitude_deg, longitude_deg=longitude_deg)

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
        self._bearing = bearing

    @property
    def is_complete(self) -> bool:
        """Whether the angle has been flown, but for what it takes to stop."""
        return self.turned_rad >= ALMOST * self._end.angle_rad
