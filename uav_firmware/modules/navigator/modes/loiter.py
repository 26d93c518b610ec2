"""Loiter: stop and hold, or fly to a commanded point and hold there."""

import math

from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.msg.mission import ModeTarget, NavigatorTarget


class LoiterMode(NavigatorMode):
    """AUTO_LOITER; finished when the set-point is at rest."""

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
        self.finished = flight.path.resting


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
