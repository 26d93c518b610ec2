"""Loiter: stop and hold, or fly to a commanded point and hold there.

A point under the ground, as one whose height was meant above something else, is not flown to: the
vehicle stops where the range finder measures the ground near below, and holds above it.
"""

import math

from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.msg.mission import ModeTarget, NavigatorTarget
from uav_firmware.msg.status import Severity

_UNDER_GROUND_M = 1.5  # [m] More than the errors of height and range finder near the ground
_CLEARANCE_M = 2.0  # [m] Height above the ground at which such a descent ends


class LoiterMode(NavigatorMode):
    """AUTO_LOITER; finished when the setpoint is at rest."""

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Stop, or fly to the target."""
        self.finished = False
        flight.yaw_target = flight.yaw.yaw
        if isinstance(target, NavigatorTarget):
            reposition(flight, target)
        else:
            flight.hold()
            climb_back(flight)

    def on_active(self, flight: Flight) -> None:
        """Finish when the path has ended."""
        if leads_into_ground(flight):
            north, east, _ = flight.rest_point()
            flight.fly(flight.stop_at((north, east, flight.ground_down - _CLEARANCE_M)))
            flight.report(Severity.WARNING, "Place is under the ground: holding above the ground")
        self.finished = flight.path.resting


def leads_into_ground(flight: Flight) -> bool:
    """Whether the vehicle descends to a place under the ground, and has to stop now."""
    goal = flight.path.goal
    if goal is None or math.isnan(flight.ground_down):
        return False
    lowest = flight.ground_down - _CLEARANCE_M
    return goal[2] > flight.ground_down + _UNDER_GROUND_M and flight.rest_point()[2] > lowest


def reposition(flight: Flight, target: NavigatorTarget) -> None:
    """Fly to the target in a straight line; NaN keeps the present value."""
    if not math.isnan(target.speed_m_s):
        flight.speeds = Speeds(horizontal=target.speed_m_s)
    goal = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
    if not math.isnan(target.yaw):
        flight.yaw_target = target.yaw
    flight.fly(flight.stop_at(goal))


def climb_back(flight: Flight) -> None:
    """Climb to the abort altitude of an aborted landing, if it had one."""
    here = flight.rest_point()
    if not math.isnan(flight.abort_down) and flight.abort_down < here[2]:
        flight.fly(flight.stop_at((here[0], here[1], flight.abort_down)))
    flight.abort_down = math.nan
