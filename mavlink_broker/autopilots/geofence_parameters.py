"""What a vehicle's parameters must be so that it keeps to a geofence by itself: a law per family.

Pure. The heights of a fence are no mission items but parameters. They are read first: a vehicle's
own limit may be the narrower one, and is never widened.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.plan import Geofence
from mavlink_broker.microservices.parameter_write import Setting

HEADROOM_M: Final = 2.0
"""A vehicle that holds a height is by turns above and below it: its guard stands higher."""


@dataclass(frozen=True, slots=True)
class Guarding:
    """What a vehicle's parameters are to be, so that it keeps to a fence by itself."""

    settings: tuple[Setting, ...] = ()
    own_limit_m: float | None = None  # Of the vehicle, narrower than the plan's
    lacks: str | None = None  # What it cannot do although the plan needs it
    note: str | None = None  # What the broker has to see to alone


Values: TypeAlias = Mapping[str, float]
"""Parameters that a vehicle has, by name."""
Guard: TypeAlias = Callable[[Values, Geofence, float], Guarding]
"""A family's law: what it is now, the fence, the greatest height of the mission [m]."""

NO_HEIGHT_LIMIT: Final = "geofence.max_altitude: the vehicle keeps none, the broker alone checked"


def guard_height_m(fence: Geofence, highest_m: float) -> float | None:
    """Give the height that a vehicle is to keep below, or None.

    The plan's limit, unless the mission comes within the headroom of it.
    """
    if fence.max_altitude is None:
        return None
    return max(fence.max_altitude, min(highest_m, fence.max_altitude) + HEADROOM_M)


def guard_nothing(_values: Values, fence: Geofence, _highest_m: float) -> Guarding:
    """A family whose parameters are not known."""
    return Guarding(note=None if fence.max_altitude is None else NO_HEIGHT_LIMIT)


PX4_NAMES: Final = ("GF_MAX_VER_DIST", "RTL_RETURN_ALT")


def guard_px4(values: Values, fence: Geofence, highest_m: float) -> Guarding:
    """GF_MAX_VER_DIST (0: none) above home; a return must not climb above it either."""
    limit_m, height_m = guard_height_m(fence, highest_m), fence.max_altitude
    if limit_m is None or height_m is None:
        return Guarding()
    own_m = values.get("GF_MAX_VER_DIST")
    if own_m is None:
        return Guarding(note=NO_HEIGHT_LIMIT)
    if 0.0 < own_m < limit_m:
        limit_m = own_m
    settings = [Setting("GF_MAX_VER_DIST", limit_m)]
    if values.get("RTL_RETURN_ALT", 0.0) > height_m:
        settings.append(Setting("RTL_RETURN_ALT", min(height_m, limit_m)))
    return Guarding(tuple(settings), own_m if 0.0 < own_m < height_m else None)


ARDUPILOT_NAMES: Final = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ALT_MAX", "FENCE_OPTIONS")
_ALTITUDE_FENCE: Final = 1  # Bits of FENCE_TYPE
_AREA_FENCE: Final = 4
_ANY_INCLUSION: Final = 2  # Bit of FENCE_OPTIONS: one inclusion area is enough


def guard_ardupilot(values: Values, fence: Geofence, highest_m: float) -> Guarding:
    """FENCE_TYPE says what is guarded, FENCE_ENABLE whether anything is.

    What an operator has switched on stays on; what was prepared but is switched off stays off.
    """
    if not {"FENCE_ENABLE", "FENCE_TYPE"} <= values.keys():
        return Guarding(lacks="the vehicle has no fence: FENCE_ENABLE and FENCE_TYPE are missing")
    kinds = int(values["FENCE_TYPE"]) if values["FENCE_ENABLE"] else 0
    settings: list[Setting] = []
    limit_m, own_m = guard_height_m(fence, highest_m), None
    knows_height = "FENCE_ALT_MAX" in values
    if limit_m is not None and knows_height:
        if kinds & _ALTITUDE_FENCE:
            own_m = values["FENCE_ALT_MAX"]
            limit_m = min(own_m, limit_m)
        settings.append(Setting("FENCE_ALT_MAX", limit_m))
        kinds |= _ALTITUDE_FENCE
    if fence.inclusion or fence.exclusion:
        kinds |= _AREA_FENCE
    options = int(values.get("FENCE_OPTIONS", -1.0))
    if len(fence.inclusion) > 1:
        if options < 0:
            return Guarding(lacks="geofence.inclusion: the vehicle keeps within one area only")
        settings.append(Setting("FENCE_OPTIONS", float(options | _ANY_INCLUSION)))
    settings += [Setting("FENCE_TYPE", float(kinds)), Setting("FENCE_ENABLE", 1.0)]
    is_narrower = own_m is not None and fence.max_altitude and own_m < fence.max_altitude
    note = NO_HEIGHT_LIMIT if limit_m is not None and not knows_height else None
    return Guarding(tuple(settings), own_m if is_narrower else None, note=note)
