"""The circle of an orbit: where it is entered, and the circle that a command means.

The geofence judges this circle before the vehicle flies it.
"""

import math

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.guidance import OrbitTarget
from uav_firmware.msg.vectors import Vector3

_NO_BEARING_M = 0.5  # [m] nearer to the centre than this, the circle is entered straight ahead


class Circle:
    """A horizontal circle; flown clockwise, seen from above, where its radius is positive."""

    def __init__(self, centre: Vector3, radius: float) -> None:
        self.centre = centre  # [m, NED]
        self.radius = radius  # [m] Positive clockwise seen from above

    def entry(self, here: Vector3, ahead: float) -> tuple[Vector3, float]:
        """Nearest point [m, NED] and its bearing [rad]; that of the centre is `ahead` [rad]."""
        north, east = here[0] - self.centre[0], here[1] - self.centre[1]
        bearing = ahead if math.hypot(north, east) < _NO_BEARING_M else math.atan2(east, north)
        size = abs(self.radius)
        return (
            self.centre[0] + size * math.cos(bearing),
            self.centre[1] + size * math.sin(bearing),
            self.centre[2],
        ), bearing


def circle_of(target: OrbitTarget, flight: Flight) -> Circle:
    """Circle of a command; unset values are the present position and the default radius."""
    radius = flight.params.orbit_radius if math.isnan(target.radius_m) else target.radius_m
    centre = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
    return Circle(centre, radius)
