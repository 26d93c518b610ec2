"""Where home is: set by itself on the ground and at arming, or by command."""

import math

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.status import HomePosition


def _frame(estimate: VehicleLocalPosition) -> LocalFrame | None:
    origin = (
        estimate.origin_latitude_deg,
        estimate.origin_longitude_deg,
        estimate.origin_altitude_amsl_m,
    )
    return LocalFrame(*origin) if all(map(math.isfinite, origin)) else None


def home_here(now_us: int, estimate: VehicleLocalPosition) -> HomePosition | None:
    """Home at the estimated position; None while the local origin is unknown."""
    frame = _frame(estimate)
    if frame is None:
        return None
    place = frame.to_geodetic(estimate.position_ned)
    return HomePosition(now_us, *place, estimate.position_ned, estimate.heading)


def home_at(
    now_us: int,
    estimate: VehicleLocalPosition,
    place: tuple[float, float, float],
    yaw: float,
) -> HomePosition | None:
    """Home at latitude, longitude [deg] and altitude [m]; yaw NaN means the present heading."""
    frame = _frame(estimate)
    if frame is None:
        return None
    heading = estimate.heading if math.isnan(yaw) else math.remainder(yaw, math.tau)
    return HomePosition(now_us, *place, frame.to_ned(*place), heading)
