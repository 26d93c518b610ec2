"""Take-off: straight up, then level to the target if one was given."""

import math

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.msg.mission import ModeTarget, NavigatorTarget
from uav_firmware.msg.vectors import Vector3

_ON_THE_SPOT_M = 0.1  # [m] A closer target needs no level leg


class Takeoff:
    """Climbs straight up, never descends, then flies level to the target."""

    def __init__(self, flight: Flight, target: Vector3, yaw_deg: float, radius: float) -> None:
        here = flight.rest_point()
        down = min(here[2], target[2])
        self._goal = (target[0], target[1], down)
        self._radius = radius  # [m]
        route = [flight.stop_at((here[0], here[1], down))]
        if math.hypot(target[0] - here[0], target[1] - here[1]) > _ON_THE_SPOT_M:
            route.append(flight.stop_at(self._goal))
        self._climbs_only = len(route) == 1
        flight.face(yaw_deg)
        flight.fly(*route)

    def follow_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Continue the climb at the present position; a target elsewhere is fixed to the earth."""
        if not self._climbs_only:
            return
        north, east, down = self._goal
        self._goal = (north + step.position_ned[0], east + step.position_ned[1], down)
        if not flight.path.resting:
            flight.fly(flight.stop_at(self._goal))

    def step(self, flight: Flight) -> bool:
        """Whether the vehicle has arrived, and turned where a yaw was given."""
        return flight.path.resting and flight.turned and flight.arrived(self._goal, self._radius)


class TakeoffMode(NavigatorMode):
    """AUTO_TAKEOFF; without a target it climbs to MIS_TAKEOFF_ALT above home."""

    def __init__(self) -> None:
        self._takeoff: Takeoff | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the climb."""
        self.finished = False
        down = flight.home_down(flight.params.takeoff_height)
        here = flight.rest_point()
        goal, yaw = (here[0], here[1], down), math.nan
        if isinstance(target, NavigatorTarget):
            goal = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
            yaw = math.degrees(target.yaw)
            if math.isnan(target.altitude_amsl_m):
                goal = (goal[0], goal[1], down)
        self._takeoff = Takeoff(flight, goal, yaw, flight.params.acceptance_radius)

    def on_active(self, flight: Flight) -> None:
        """Finish when the target is reached."""
        if not self.finished and self._takeoff is not None:
            self.finished = self._takeoff.step(flight)

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Continue the climb at the present position."""
        if self._takeoff is not None:
            self._takeoff.follow_reset(flight, step)

    def stays_on_ground(self, flight: Flight) -> bool:
        """Leave the ground: only a finished take-off stays there."""
        return flight.landed and self.finished
