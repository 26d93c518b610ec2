"""From a wanted acceleration to a thrust vector within the limits, and back."""

import math
from typing import NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.msg.vectors import Vector3


class ThrustLimits(NamedTuple):
    """What the vehicle may ask of its rotors, full thrust being 1."""

    minimum: float  # [-] Collective
    maximum: float  # [-] Collective
    horizontal_margin: float  # [-] Kept for horizontal control at full climb
    tilt: float  # [rad] Largest angle between thrust and vertical


def shorten_horizontal(x: float, y: float, limit: float) -> tuple[float, float]:
    """Scale a horizontal vector down to a length of at most `limit`, keeping its direction."""
    length = math.hypot(x, y)
    if length <= limit:
        return x, y
    scale = limit / length
    return x * scale, y * scale


def thrust_vector(acceleration_ned: Vector3, hover: float, limits: ThrustLimits) -> Vector3:
    """Thrust [-, NED] for an acceleration [m/s^2, NED], within the limits.

    The vertical part is served first, less a margin at full climb; the horizontal part
    gets what the tilt limit and the remaining thrust allow. `hover` is the thrust
    that carries the weight, so one unit of acceleration costs hover / g.
    """
    per_acceleration = hover / STANDARD_GRAVITY_M_S2
    up = (STANDARD_GRAVITY_M_S2 - acceleration_ned[2]) * per_acceleration
    north = acceleration_ned[0] * per_acceleration
    east = acceleration_ned[1] * per_acceleration
    most = limits.maximum * limits.maximum
    kept = min(math.hypot(north, east), limits.horizontal_margin)
    ceiling = math.sqrt(most - kept * kept)
    if not limits.minimum <= up <= ceiling:
        up = min(max(up, limits.minimum), ceiling)
    left = most - up * up
    room = 0.0 if left < 0.0 else math.sqrt(left)
    north, east = shorten_horizontal(north, east, min(room, up * math.tan(limits.tilt)))
    return (north, east, -up)


def acceleration_of(thrust_ned: Vector3, hover: float) -> Vector3:
    """Acceleration [m/s^2, NED] that a thrust vector gives: inverse of `thrust_vector`."""
    per_thrust = STANDARD_GRAVITY_M_S2 / hover
    return (
        thrust_ned[0] * per_thrust,
        thrust_ned[1] * per_thrust,
        STANDARD_GRAVITY_M_S2 + thrust_ned[2] * per_thrust,
    )
