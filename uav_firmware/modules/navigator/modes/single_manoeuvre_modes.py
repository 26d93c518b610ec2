"""Modes made of one manoeuvre: take-off, land and return."""

import math

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.modes.land import Land, LandPhase, land_here
from uav_firmware.modules.navigator.modes.mode import NavigatorMode
from uav_firmware.modules.navigator.modes.return_home import ReturnHome
from uav_firmware.modules.navigator.modes.takeoff import Takeoff
from uav_firmware.msg.mission import ModeTarget, NavigatorTarget

_WARNING = 4  # MAV_SEVERITY


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
        """Watch for the arrival."""
        if not self.finished and self._takeoff is not None:
            self.finished = self._takeoff.step(flight)

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Climb on where the vehicle is."""
        if self._takeoff is not None:
            self._takeoff.follow_reset(flight, step)

    def sits(self, flight: Flight) -> bool:
        """A take-off never sits; it is why the vehicle leaves the ground."""
        return flight.landed and self.finished


class LandMode(NavigatorMode):
    """AUTO_LAND; lands at the target, or where it is.

    On the way to the target it lands where it comes to rest as soon as the position is no longer
    measured, also if a fix comes back: the operator may order the place again.
    """

    def __init__(self) -> None:
        self._here = True
        self._land: Land | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the way to the landing point."""
        self.finished = False
        self._here = not isinstance(target, NavigatorTarget)
        if not isinstance(target, NavigatorTarget):
            self._land = land_here(flight)
            return
        goal = flight.to_ned(target.latitude_deg, target.longitude_deg, target.altitude_amsl_m)
        if math.isnan(target.altitude_amsl_m):
            goal = (goal[0], goal[1], flight.home_down(0.0))
        flight.abort_down = goal[2] - target.abort_height_m
        self._land = Land(flight, goal, math.degrees(target.yaw))

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Land on where the vehicle is; a target stays on the earth."""
        if self._land is not None and self._here:
            self._land.follow_reset(flight, step)

    def on_active(self, flight: Flight) -> None:
        """Watch for the ground, and for the fix that the way to a place needs."""
        if self._land is None or self.finished:
            return
        travels = not self._here and self._land.phase is LandPhase.TRANSIT
        if travels and not flight.position_measured:
            self._here = True
            self._land = land_here(flight)
            flight.say(_WARNING, "No GPS fix to reach the landing place by: landing here")
        self.finished = self._land.step(flight)


class ReturnMode(NavigatorMode):
    """AUTO_RTL."""

    def __init__(self) -> None:
        self._return: ReturnHome | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the way home."""
        del target  # home is the target
        self.finished = False
        self._return = ReturnHome(flight)

    def on_active(self, flight: Flight) -> None:
        """Watch for the ground at home."""
        if not self.finished and self._return is not None:
            self.finished = self._return.step(flight)
