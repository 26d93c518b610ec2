"""What some autopilots support only as parameters: properties of commands, and geofences.

A property may have several parameter names, because firmware versions name and scale it
differently; the first that the vehicle has is used. All are restored after the command.

PX4: `flight_mode_manager/tasks/AutoFollowTarget`. ArduCopter: `AC_Circle`, `AC_WPNav`,
`AP_Follow`.

A geofence that a vehicle keeps by itself needs parameters too: one function per family. The
altitude limits of a geofence are parameters, not mission items. They are read first: the vehicle's
own limit may be narrower, and is never widened.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from afarcloud.plan import Geofence
from mavlink_broker.microservices.config_overrides import ParameterOverride
from mavlink_broker.microservices.parameter import Limit, Setting

ParameterOverrides: TypeAlias = tuple[ParameterOverride, ...]

FOLLOW_DISTANCE_M: Final = 8.0
"""Distance from the target: PX4's default, used for every family."""
BEHIND_DEG: Final = 180.0
"""Clockwise from the target's course: PX4's FLW_TGT_FA."""
BESIDE_DEG: Final = 90.0
PX4_LOWEST_FOLLOW_M: Final = 8.0
SLOWEST_FOLLOW_M_S: Final = 0.5
"""Lowest FLW_TGT_MAX_VEL of the project's own vehicle."""
COPTER_RADIUS_M: Final = (0.05, 10.0)
"""Smallest and largest acceptance radius of WPNAV_RADIUS."""
COPTER_CIRCLE_RATE_DEG_S: Final = 90.0
_NOSE_ALONG_THE_CIRCLE: Final = 2.0  # CIRCLE_OPTIONS; 0: it points to the centre
_FACE_TARGET: Final = 1.0
_NORTH_EAST_DOWN: Final = 0.0
_AMSL: Final = 0.0
_NO_DISTANCE_LIMIT: Final = 0.0


class Following(NamedTuple):
    """How a vehicle is to follow its target."""

    height_m: float  # Above home
    angle_deg: float  # To the target's course
    own_system: int  # The broker's system id
    speed_m_s: float | None  # At most; None: its own


def no_overrides(following: Following) -> ParameterOverrides:
    """No overrides: the command contains everything."""
    del following
    return ()


def px4_follow(following: Following) -> ParameterOverrides:
    """PX4 keeps a height above home, a distance and an angle to a target's course.

    Its limit is that of its path round the target: it keeps up with one at its own speed.
    """
    return (
        (Setting("FLW_TGT_ALT_M", 0.0),),
        (Setting("FLW_TGT_HT", max(following.height_m, PX4_LOWEST_FOLLOW_M)),),
        (Setting("FLW_TGT_DST", FOLLOW_DISTANCE_M),),
        (Setting("FLW_TGT_FA", following.angle_deg),),
        *_follow_speed(following),
    )


def farm_flight_follow(following: Following) -> ParameterOverrides:
    """The project's own vehicle gets the height with the command."""
    is_behind = following.angle_deg == BEHIND_DEG
    angle = () if is_behind else ((Setting("FLW_TGT_FA", following.angle_deg),),)
    return (*angle, *_follow_speed(following))


def _follow_speed(following: Following) -> ParameterOverrides:
    if following.speed_m_s is None:
        return ()
    limit_m_s = max(following.speed_m_s, SLOWEST_FOLLOW_M_S)
    return ((Limit("FLW_TGT_MAX_VEL", limit_m_s),),)


def copter_follow(following: Following) -> ParameterOverrides:
    """ArduCopter keeps an offset from one system's position, which is sent with the height.

    Its speed is WPNAV_SPEED, which no command may change in flight.
    """
    return (
        (Setting("FOLL_ENABLE", 1.0),),
        (Setting("FOLL_SYSID", float(following.own_system)),),
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
    return (
        (Setting("CIRCLE_RATE", rate_deg_s),),
        (Setting("CIRCLE_OPTIONS", _NOSE_ALONG_THE_CIRCLE if along else 0.0),),
    )


def copter_radius(radius_m: float) -> ParameterOverrides:
    """ArduCopter has one acceptance radius for all waypoints, in centimetres before 4.7."""
    smallest, largest = COPTER_RADIUS_M
    kept_m = min(max(radius_m, smallest), largest)
    return ((Setting("WPNAV_RADIUS", kept_m * 100.0), Setting("WP_RADIUS_M", kept_m)),)


ARDUPILOT_MISSION: Final[ParameterOverrides] = ((Setting("MIS_RESTART", 0.0),),)
"""ArduPilot goes on with its mission whenever AUTO is entered.

With 1 it begins at its first item then, also where a pilot resumes it (`AP_Mission.cpp`,
`start_or_resume`; `mode_auto.cpp`, `run`). To set the current item is no remedy: before AUTO it is
forgotten, and behind it the vehicle has begun the first items again, and flies there.
"""

HEADROOM_M: Final = 2.0
"""A vehicle that holds a height is at times above it: its limit is set higher by this."""


@dataclass(frozen=True, slots=True)
class FenceParameters:
    """Parameters to be set on a vehicle for a geofence."""

    settings: tuple[Setting, ...] = ()
    own_limit_m: float | None = None  # The vehicle's limit, if it is narrower than the plan's
    lacks: str | None = None  # What the plan needs and the vehicle does not support
    note: str | None = None  # What only the broker checks
    latched: tuple[str, str] | None = None  # A parameter that counts when the other one goes on


Values: TypeAlias = Mapping[str, float]
"""Values of a vehicle's parameters, by name."""
FenceLaw: TypeAlias = Callable[[Values, Geofence, float], FenceParameters]
"""A family's function of current values, geofence, and greatest height of the mission [m]."""

NO_HEIGHT_LIMIT: Final = "geofence.max_altitude: checked by the broker only, not by the vehicle"


def fence_height_m(fence: Geofence, highest_m: float) -> float | None:
    """Return the height limit [m] of a vehicle, or None.

    The plan's limit, raised if the mission comes within the headroom of it.
    """
    if fence.max_altitude is None:
        return None
    return max(fence.max_altitude, min(highest_m, fence.max_altitude) + HEADROOM_M)


def unknown_fence(_values: Values, fence: Geofence, _highest_m: float) -> FenceParameters:
    """A family whose parameters are not known."""
    return FenceParameters(note=None if fence.max_altitude is None else NO_HEIGHT_LIMIT)


PX4_NAMES: Final = ("GF_MAX_VER_DIST", "RTL_RETURN_ALT")


def px4_fence(values: Values, fence: Geofence, highest_m: float) -> FenceParameters:
    """GF_MAX_VER_DIST (0: none) above home; a return must not climb above it either."""
    limit_m, height_m = fence_height_m(fence, highest_m), fence.max_altitude
    if limit_m is None or height_m is None:
        return FenceParameters()
    vehicle_limit_m = values.get("GF_MAX_VER_DIST")
    if vehicle_limit_m is None:
        return FenceParameters(note=NO_HEIGHT_LIMIT)
    if 0.0 < vehicle_limit_m < limit_m:
        limit_m = vehicle_limit_m
    settings = [Setting("GF_MAX_VER_DIST", limit_m)]
    if values.get("RTL_RETURN_ALT", 0.0) > height_m:
        settings.append(Setting("RTL_RETURN_ALT", min(height_m, limit_m)))
    return FenceParameters(
        tuple(settings), vehicle_limit_m if 0.0 < vehicle_limit_m < height_m else None
    )


ARDUPILOT_NAMES: Final = (
    "FENCE_ENABLE",
    "FENCE_AUTOENABLE",
    "FENCE_TYPE",
    "FENCE_ALT_MAX",
    "FENCE_OPTIONS",
)
COPTER_SINCE: Final = {"FENCE_AUTOENABLE": 0x04060000}
"""First AUTOPILOT_VERSION.flight_sw_version of ArduCopter that has a parameter; ArduPlane's always
did (`AC_Fence.cpp`, `var_info`)."""
_ALTITUDE_FENCE: Final = 1  # Bits of FENCE_TYPE
_AREA_FENCE: Final = 4
_ANY_INCLUSION: Final = 2  # Bit of FENCE_OPTIONS: one inclusion area is enough


def ardupilot_fence(values: Values, fence: Geofence, highest_m: float) -> FenceParameters:
    """FENCE_TYPE selects the fences that are enabled, FENCE_ENABLE whether any is.

    A fence that an operator has enabled stays enabled; one that is configured but disabled stays
    disabled. It is enabled too where FENCE_AUTOENABLE makes the vehicle enable what FENCE_TYPE
    selects: after an automatic take-off (1; 2, which disables only the lowest altitude to land) or
    when it arms (3) (`AC_Fence.cpp`, `auto_enable_fence_after_takeoff`,
    `auto_enable_fence_on_arming`; up to 4.5 `get_enabled_fences`).

    ArduPilot since 4.6 enables what FENCE_TYPE selects when FENCE_ENABLE is set from 0 to 1,
    and ignores a later change.
    """
    if not {"FENCE_ENABLE", "FENCE_TYPE"} <= values.keys():
        return FenceParameters(
            lacks="the vehicle has no fence: FENCE_ENABLE and FENCE_TYPE are missing"
        )
    is_enabled = values["FENCE_ENABLE"] or values.get("FENCE_AUTOENABLE")
    fence_type = int(values["FENCE_TYPE"]) if is_enabled else 0
    settings: list[Setting] = []
    limit_m, vehicle_limit_m = fence_height_m(fence, highest_m), None
    has_altitude_limit = "FENCE_ALT_MAX" in values
    if limit_m is not None and has_altitude_limit:
        if fence_type & _ALTITUDE_FENCE:
            vehicle_limit_m = values["FENCE_ALT_MAX"]
            limit_m = min(vehicle_limit_m, limit_m)
        settings.append(Setting("FENCE_ALT_MAX", limit_m))
        fence_type |= _ALTITUDE_FENCE
    if fence.inclusion or fence.exclusion:
        fence_type |= _AREA_FENCE
    options = int(values.get("FENCE_OPTIONS", -1.0))
    if len(fence.inclusion) > 1:
        if options < 0:
            return FenceParameters(
                lacks="geofence.inclusion: the vehicle keeps within one area only"
            )
        settings.append(Setting("FENCE_OPTIONS", float(options | _ANY_INCLUSION)))
    settings += [Setting("FENCE_TYPE", float(fence_type)), Setting("FENCE_ENABLE", 1.0)]
    is_narrower = (
        vehicle_limit_m is not None and fence.max_altitude and vehicle_limit_m < fence.max_altitude
    )
    note = NO_HEIGHT_LIMIT if limit_m is not None and not has_altitude_limit else None
    return FenceParameters(
        tuple(settings),
        vehicle_limit_m if is_narrower else None,
        note=note,
        latched=("FENCE_TYPE", "FENCE_ENABLE"),
    )
