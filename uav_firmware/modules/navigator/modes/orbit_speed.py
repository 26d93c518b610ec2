"""Speed limit and heading on a circle: pure.

On a circle of radius r at speed v and slope a, acceleration and jerk are

    across  v^2 / r              3 v a / r
    along   a                    j - v^3 / r^2

so v^2 / r and a each within 1/sqrt(2) of the acceleration allowed, and the three parts of the
jerk each within a third of it, satisfy both limits.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.motion import MotionLimits
from uav_firmware.lib.speed_profile import Limits
from uav_firmware.msg.guidance import OrbitHeading

CENTRIPETAL_MAX_M_S2: Final = 2.0
"""[m/s^2] PX4's limit too: a tilt of 12 degrees, which leaves room against wind."""
_TILT_SHARE: Final = 0.5  # of the largest tilt, for the circle; wind and corrections get the rest
_TURN_SHARE: Final = 0.9  # of the largest yaw rate, so that the nose can catch up
_CLIPPED_M_S: Final = 0.01  # [m/s] A smaller reduction is not reported

_OFFSETS: Final[Mapping[OrbitHeading, tuple[float, float]]] = {
    OrbitHeading.TOWARDS_CENTRE: (math.pi, 0.0),
    OrbitHeading.AWAY: (0.0, 0.0),
    OrbitHeading.FORWARDS: (0.0, 0.5 * math.pi),
    OrbitHeading.BACKWARDS: (0.0, -0.5 * math.pi),
}
"""Heading minus bearing of the vehicle [rad]: a constant, and a part with the sense of flight."""


class OrbitSpeed(NamedTuple):
    """Limits for the flight along a circle."""

    limits: Limits  # Along the circle; its speed is the one flown
    clipped_by: str  # The limit that applies; empty when the speed is the commanded one


def speed_on(
    radius: float,
    commanded: float,
    limits: MotionLimits,
    *,
    tilt_max: float,
    yaw_rate_max: float,
) -> OrbitSpeed:
    """Speed and slopes on a circle.

    Args:
        radius: [m], of either sign.
        commanded: commanded speed [m/s].
        limits: of the vehicle's motion; their speed is the most that the controller allows.
        tilt_max: [rad].
        yaw_rate_max: [rad/s], infinite when the nose does not turn with the circle.
    """
    size = abs(radius)
    across = min(CENTRIPETAL_MAX_M_S2, limits.acceleration_horizontal / math.sqrt(2.0))
    lean = STANDARD_GRAVITY_M_S2 * math.tan(_TILT_SHARE * tilt_max)
    ceilings = (
        (limits.speed_horizontal, "the speed limit"),
        (math.sqrt(across * size), f"{across:.1f} m/s^2 towards the centre"),
        (math.sqrt(lean * size), "the tilt limit"),
        ((limits.jerk * size * size / 3.0) ** (1.0 / 3.0), "the jerk limit"),
        (_TURN_SHARE * yaw_rate_max * size, "the yaw rate"),
    )
    ceiling, reason = min(ceilings)
    speed = min(commanded, ceiling)
    slope = min(
        CENTRIPETAL_MAX_M_S2,
        limits.acceleration_horizontal / math.sqrt(2.0),
        limits.jerk * size / (9.0 * speed),
    )
    clipped = commanded > ceiling + _CLIPPED_M_S
    return OrbitSpeed(Limits(speed, slope, limits.jerk / 3.0), reason if clipped else "")


def turns_with_the_circle(heading: OrbitHeading) -> bool:
    """Whether the heading turns with the bearing."""
    return heading in _OFFSETS


def heading_at(heading: OrbitHeading, bearing: float, radius: float) -> float:
    """Heading [rad] at a bearing from the centre [rad]; NaN where it does not depend on it."""
    if heading not in _OFFSETS:
        return math.nan
    constant, with_sense = _OFFSETS[heading]
    sense = math.copysign(1.0, radius)
    return math.remainder(bearing + constant + sense * with_sense, math.tau)
