"""The angle that a vehicle has flown round a centre, from its positions."""

import math
from dataclasses import replace
from typing import Final

from afarcloud.geodesy import offset
from mavlink_broker.planning.live_actions import Turned
from mavlink_broker.recovery.record import Pose

COMPLETE_AT: Final = 0.99
"""Share of a turn at which it is ended: the vehicle needs some time to stop."""


class TurnAngle:
    """Sums up the angle that a vehicle flies round a centre."""

    def __init__(self, end: Turned) -> None:
        self._end = end
        self._bearing: float | None = None
        self._first: float | None = None  # Bearing at which an earlier run began
        self._flown_rad = 0.0  # Since then, estimated from the time
        self.turned_rad = 0.0

    def move_to(self, latitude_deg: float, longitude_deg: float) -> None:
        """Move the centre; the angle so far counts."""
        self._end = replace(self._end, latitude_deg=latitude_deg, longitude_deg=longitude_deg)

    def resume(self, start: Pose | None, elapsed_s: float) -> None:
        """Continue the turn that an earlier run of the broker began `elapsed_s` ago.

        The next position gives the angle within a turn, and the time the number of full turns; if
        the start is not known, the time gives the whole angle.
        """
        end = self._end
        self._flown_rad = end.speed_m_s / end.radius_m * elapsed_s
        if start is None:
            self.turned_rad = self._flown_rad
            return
        north, east = offset(end.latitude_deg, end.longitude_deg, *start[:2])
        self._first = math.atan2(east, north)

    def take(self, latitude_deg: float, longitude_deg: float) -> None:
        """Add a position; a position off the circle does not count."""
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
        """Add the angle that ends at this bearing and is nearest to the estimate."""
        direction = 1.0 if self._end.is_clockwise else -1.0
        ahead = direction * (bearing - first) % (2.0 * math.pi)
        turns = round((self._flown_rad - ahead) / (2.0 * math.pi))
        self.turned_rad = max(0.0, ahead + turns * 2.0 * math.pi)

    @property
    def is_on_circle(self) -> bool:
        """Whether the last position was on the circle."""
        return self._bearing is not None

    @property
    def share(self) -> float:
        """The share that was flown, 1 for all; 0 of a turn without an end."""
        return self.turned_rad / self._end.angle_rad

    @property
    def is_complete(self) -> bool:
        """Whether the angle was flown, except for the angle that it takes to stop."""
        return self.turned_rad >= COMPLETE_AT * self._end.angle_rad
