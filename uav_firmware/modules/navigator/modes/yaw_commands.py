"""Commands for the heading: turns, and regions of interest."""

import math

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.guidance import HeadingRequest, RegionOfInterest


def start_turn(
    flight: Flight, angle: float, *, rate: float, direction: int, relative: bool
) -> None:
    """Turn to a heading [rad], or through an angle when relative.

    Args:
        flight: of the vehicle that turns.
        angle: [rad].
        rate: [rad/s]; 0 or NaN as fast as the parameters allow.
        direction: 1 clockwise, -1 counter-clockwise, 0 the shorter turn, or the angle's sign.
        relative: from the present heading.
    """
    limit = rate if rate > 0.0 else math.nan
    if relative:
        flight.turn_by(math.copysign(angle, direction) if direction else angle, limit)
    else:
        flight.turn_to(angle, direction, limit)


def apply_heading(flight: Flight, request: HeadingRequest) -> None:
    """Carry out CONDITION_YAW as a command."""
    start_turn(
        flight,
        math.radians(request.angle_deg),
        rate=math.radians(request.rate_deg_s),
        direction=request.direction,
        relative=request.relative,
    )


def apply_region_of_interest(flight: Flight, region: RegionOfInterest) -> None:
    """Point the nose at a place, or end that; then the present heading is kept."""
    flight.regions.append(region)
    if math.isnan(region.latitude_deg):
        if flight.roi is not None:
            flight.course = flight.yaw.yaw
            if not math.isnan(flight.yaw_target):
                flight.yaw_target = flight.yaw.yaw
        flight.roi = None
        return
    altitude = region.altitude_amsl_m
    if math.isnan(altitude) and flight.home is not None:
        altitude = flight.home.altitude_amsl_m
    flight.roi = flight.to_ned(region.latitude_deg, region.longitude_deg, altitude)
