"""Command properties that some autopilots support only as parameters.

A property may have several parameter names, because firmware versions name and scale it
differently; the first that the vehicle has is used. All are restored after the command.

PX4: `flight_mode_manager/tasks/AutoFollowTarget`. ArduCopter: `AC_Circle`, `AC_WPNav`,
`AP_Follow`.
"""

import math
from enum import IntFlag
from typing import Final, TypeAlias

from mavlink_broker.microservices.config_overrides import ParameterOverride
from mavlink_broker.microservices.parameter import Setting

ParameterOverrides: TypeAlias = tuple[ParameterOverride, ...]

FOLLOW_DISTANCE_M: Final = 8.0
"""Distance from the target: PX4's default, used for every family."""
BEHIND_DEG: Final = 180.0
"""Clockwise from the target's course: PX4's FLW_TGT_FA."""
BESIDE_DEG: Final = 90.0
PX4_LOWEST_FOLLOW_M: Final = 8.0
COPTER_RADIUS_M: Final = (0.05, 10.0)
"""Smallest and largest acceptance radius of WPNAV_RADIUS."""
COPTER_CIRCLE_RATE_DEG_S: Final = 90.0
_FACE_TARGET: Final = 1.0
_NORTH_EAST_DOWN: Final = 0.0
_AMSL: Final = 0.0
_NO_DISTANCE_LIMIT: Final = 0.0


class CircleOption(IntFlag):
    """Bits of ArduCopter's CIRCLE_OPTIONS; without the second the nose points to the centre."""

    STEERED_BY_HAND = 1
    NOSE_ALONG_THE_CIRCLE = 2


def no_overrides(height_m: float, angle_deg: float, own_system: int) -> ParameterOverrides:
    """No overrides: the command contains everything."""
    del height_m, angle_deg, own_system
    return ()


def px4_follow(height_m: float, angle_deg: float, own_system: int) -> ParameterOverrides:
    """PX4 keeps a height above home, a distance and an angle to a target's course."""
    del own_system
    return (
        (Setting("FLW_TGT_ALT_M", 0.0),),
        (Setting("FLW_TGT_HT", max(height_m, PX4_LOWEST_FOLLOW_M)),),
        (Setting("FLW_TGT_DST", FOLLOW_DISTANCE_M),),
        (Setting("FLW_TGT_FA", angle_deg),),
    )


def farm_flight_follow(height_m: float, angle_deg: float, own_system: int) -> ParameterOverrides:
    """The project's own vehicle gets the height with the command."""
    del height_m, own_system
    if angle_deg == BEHIND_DEG:
        return ()
    return ((Setting("FLW_TGT_FA", angle_deg),),)


def copter_follow(height_m: float, angle_deg: float, own_system: int) -> ParameterOverrides:
    """ArduCopter keeps an offset from one system's position, which is sent with the height."""
    del height_m, angle_deg
    return (
        (Setting("FOLL_ENABLE", 1.0),),
        (Setting("FOLL_SYSID", float(own_system)),),
        (Setting("FOLL_DIST_MAX", _NO_DISTANCE_LIMIT),),
        (Setting("FOLL_OFS_TYPE", _NORTH_EAST_DOWN),),
        (Setting("FOLL_OFS_X", -FOLLOW_DISTANCE_M),),
        (Setting("FOLL_OFS_Y", 0.0),),
        (Setting("FOLL_OFS_Z", 0.0),),
        (Setting("FOLL_YAW_BEHAVE", _FACE_TARGET),),
        (Setting("FOLL_ALT_TYPE", _AMSL),),
    )


def copter_circle(rate_deg_s: float, *, along: bool) -> ParameterOverrides:
    """ArduCopter points its nose along its circle, or to its centre.

    Before 4.4 its rate is the one that AUTO goes round at, counter-clockwise below 0.
    """
    rate_deg_s = math.copysign(min(abs(rate_deg_s), COPTER_CIRCLE_RATE_DEG_S), rate_deg_s)
    options = CircleOption.NOSE_ALONG_THE_CIRCLE if along else CircleOption(0)
    return (
        (Setting("CIRCLE_RATE", rate_deg_s),),
        (Setting("CIRCLE_OPTIONS", float(options)),),
    )


def copter_radius(radius_m: float) -> ParameterOverrides:
    """ArduCopter has one acceptance radius for all waypoints, in centimetres before 4.7."""
    smallest, largest = COPTER_RADIUS_M
    kept_m = min(max(radius_m, smallest), largest)
    return ((Setting("WPNAV_RADIUS", kept_m * 100.0), Setting("WP_RADIUS_M", kept_m)),)
