"""Commands that come in flight and last: what they are called, and what finishes them.

The broker sees the end of a circle in the vehicle's places and the end of following and tracking
in the vehicle's clock. So whoever finishes them flies the circle at once, or lets the time pass.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from sim.physics.earth import DegreesPerMetre, degrees_per_metre
from sim.tester.vehicle.actions import Pose
from sim.tester.vehicle.events import Command

ORBIT: Final = 34
FOLLOW: Final = 32
TRACK_POINT: Final = 2004
TRACK_RECTANGLE: Final = 2005
STOP_TRACKING: Final = 2010
TAKE_PICTURES: Final = 2000
PANORAMA: Final = 2800

FOLLOWED_S: Final = 61.0
"""A little more than the broker follows or tracks."""
_RELATIVE: Final = frozenset({3, 6})  # MAV_FRAME_GLOBAL_RELATIVE_ALT, and its integer form
_E7: Final = 1e7
_CIRCLE_POINTS: Final = 54
_CIRCLE_STEP_DEG: Final = 8.0
"""Together 432 degrees: a turn, and what may get lost of it."""


class Live(NamedTuple):
    """One command that is being flown."""

    command: Command
    title: str


_TITLES: Final[Mapping[int, str]] = {
    ORBIT: "circle with radius {0:g} m",
    FOLLOW: "follow the target of system {0:g}",
    TRACK_POINT: "track the subject at {0:g}, {1:g}",
    TRACK_RECTANGLE: "track the subject between {0:g}, {1:g} and {2:g}, {3:g}",
    TAKE_PICTURES: "take {2:g} pictures, one each {1:g} s",
    PANORAMA: "take a panorama",
}


def live(command: Command) -> Live | None:
    """What a command begins; None if it is none that lasts."""
    title = _TITLES.get(command.number)
    return None if title is None else Live(command, title.format(*command.parameters))


def target(command: Command, home_amsl_m: float, pose: Pose) -> Pose:
    """Where a command with a place sends a vehicle; what it leaves open stays."""
    *_, latitude, longitude, altitude_m = command.parameters
    if command.frame not in _RELATIVE:
        altitude_m -= home_amsl_m
    return pose._replace(
        latitude_deg=pose.latitude_deg if math.isnan(latitude) else latitude / _E7,
        longitude_deg=pose.longitude_deg if math.isnan(longitude) else longitude / _E7,
        relative_altitude_m=pose.relative_altitude_m if math.isnan(altitude_m) else altitude_m,
    )


def circle(command: Command, home_amsl_m: float, pose: Pose) -> list[Pose]:
    """The places of a turn about the centre of DO_ORBIT; a negative radius is anticlockwise."""
    centre = target(command, home_amsl_m, pose)
    metre = degrees_per_metre(centre.latitude_deg, home_amsl_m + centre.relative_altitude_m)
    radius_m = command.parameters[0]
    return [
        _beside(centre, metre, abs(radius_m), math.copysign(n * _CIRCLE_STEP_DEG, radius_m))
        for n in range(_CIRCLE_POINTS)
    ]


def lasting_s(command: Command) -> float:
    """Duration unless it is finished before."""
    if command.number == TAKE_PICTURES:
        _, interval_s, count, *_ = command.parameters
        return max(1.0, (count - 1.0) * interval_s + 1.0) + 1.0
    return FOLLOWED_S


def _beside(centre: Pose, metre: DegreesPerMetre, distance_m: float, bearing_deg: float) -> Pose:
    north_m = distance_m * math.cos(math.radians(bearing_deg))
    east_m = distance_m * math.sin(math.radians(bearing_deg))
    return centre._replace(
        latitude_deg=centre.latitude_deg + north_m * metre.north,
        longitude_deg=centre.longitude_deg + east_m * metre.east,
        yaw_deg=(bearing_deg + 90.0) % 360.0,
    )
