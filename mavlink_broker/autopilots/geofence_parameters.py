"""Parameters with which a vehicle keeps a geofence by itself, one function per family.

Pure. The altitude limits of a geofence are parameters, not mission items. They are read first: the
vehicle's own limit may be narrower, and is never widened.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.plan import Geofence
from mavlink_broker.microservices.parameter import Setting

HEADROOM_M: Final = 2.0
"""A vehicle that holds a height is at times above it: its limit is set higher by this."""


@dataclass(frozen=True, slots=True)
class FenceParameters:
    """Parameters to be set on a vehicle for a geofence."""

    settings: tuple[Setting, ...] = ()
    own_limit_m: float | None = None  # The vehicle's limit, if it is narrower than the plan's
    lacks: str | None = None  # What the plan needs and the vehicle does not support
    note: str | None = None  # What only the broker checks


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


ARDUPILOT_NAMES: Final = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ALT_MAX", "FENCE_OPTIONS")
_ALTITUDE_FENCE: Final = 1  # Bits of FENCE_TYPE
_AREA_FENCE: Final = 4
_ANY_INCLUSION: Final = 2  # Bit of FENCE_OPTIONS: one inclusion area is enough


def ardupilot_fence(values: Values, fence: Geofence, highest_m: float) -> FenceParameters:
    """FENCE_TYPE says which fences are enabled, FENCE_ENABLE whether any is.

    A fence that an operator has enabled stays enabled; one that is configured but disabled stays
    disabled.
    """
    if not {"FENCE_ENABLE", "FENCE_TYPE"} <= values.keys():
        return FenceParameters(
            lacks="the vehicle has no fence: FENCE_ENABLE and FENCE_TYPE are missing"
        )
    fence_type = int(values["FENCE_TYPE"]) if values["FENCE_ENABLE"] else 0
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
    return FenceParameters(tuple(settings), vehicle_limit_m if is_narrower else None, note=note)
