"""Take-off: straight up, then over to the point if one was given."""

import math

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.vectors import Vector3

_ON_THE_SPOT_M = 0.1  # [m] a point closer than this needs no way of its own


class Takeoff:
    """Climbs where it stands and never descends; then flies level to the target."""

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
        """Climb on where the vehicle is; a target elsewhere stays on the earth."""
        if not self._climbs_only:
            return
        north, east, down = self._goal
        self._goal = (north + step.position_ned[0], east + step.position_ned[1], down)
        if not flight.path.resting:
            flight.fly(flight.stop_at(self._goal))

    def step(self, flight: Flight) -> bool:
        """Whether the vehicle has arrived, and turned where a yaw was given."""
        return flight.path.resting and flight.turned and flight.arrived(self._goal, self._radius)
