"""ORBIT: the mode that flies a circle, by an order or about the place where it is."""

import math

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.modes.mode import NavigatorMode
from uav_firmware.modules.navigator.modes.orbit import Circle, Orbit, circle_of
from uav_firmware.msg.guidance import OrbitHeading, OrbitTarget
from uav_firmware.msg.mission import ModeTarget
from uav_firmware.msg.vectors import Vector3


class OrbitMode(NavigatorMode):
    """ORBIT; without an order it circles the place where it is. Finished when the turns are."""

    def __init__(self) -> None:
        self._orbit: Orbit | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the way to the circle."""
        self.finished = False
        order = target if isinstance(target, OrbitTarget) else None
        if order is None:
            here: Vector3 = flight.rest_point()
            circle = Circle(here, flight.params.orbit_radius)
        else:
            circle = circle_of(order, flight)
            flight.speeds = Speeds(horizontal=order.speed_m_s)  # No faster on the approach
        self._orbit = Orbit(
            flight,
            circle,
            speed=math.nan if order is None else order.speed_m_s,
            angle=math.inf if order is None else order.angle,
            heading=OrbitHeading.TOWARDS_CENTRE if order is None else order.heading,
        )

    def on_active(self, flight: Flight) -> None:
        """Watch for the end of the turns."""
        if self._orbit is not None:
            self.finished = self._orbit.step(flight)

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Go back to the circle, which stays on the earth."""
        del step
        if self._orbit is not None:
            self._orbit.follow_reset(flight)

    def on_speeds(self, flight: Flight) -> None:
        """An orbit's speed comes with its order."""
