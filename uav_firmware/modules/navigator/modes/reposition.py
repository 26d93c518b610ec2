"""Reposition: fly to a point and stay there; also how a hold climbs back from a landing."""

import math

from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.msg.mission import NavigatorTarget


def reposition(flight: Flight, target: NavigatorTarget) -> None:
    """Fly to the target in a straight line; what is NaN stays as it is."""
    if not math.isnan(target.speed_m_s):
        flight.speeds = Speeds(horizontal=target.speed_m_s)
    goal = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
    if not math.isnan(target.yaw):
        flight.yaw_target = target.yaw
    flight.fly(flight.stop_at(goal))


def climb_back(flight: Flight) -> None:
    """Rise to the abort altitude of the landing that was broken off, if it had one."""
    here = flight.rest_point()
    if not math.isnan(flight.abort_down) and flight.abort_down < here[2]:
        flight.fly(flight.stop_at((here[0], here[1], flight.abort_down)))
    flight.abort_down = math.nan
