"""Orbit: to the nearest point of the circle, along it, and hold where the angle ends.

APPROACH --at rest on the circle, turned--> CIRCLE --angle flown--> DONE
"""

import math
from enum import Enum, auto

from uav_firmware.lib.resets import EstimateStep
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.modules.navigator.circle import Circle, circle_of
from uav_firmware.modules.navigator.flight import JERK_PER_SPEED, Flight, Speeds
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.modules.navigator.modes.orbit_speed import (
    OrbitSpeed,
    heading_at,
    speed_on,
    turns_with_the_circle,
)
from uav_firmware.msg.guidance import OrbitHeading, OrbitStatus, OrbitTarget
from uav_firmware.msg.mission import ModeTarget
from uav_firmware.msg.status import Severity
from uav_firmware.msg.vectors import Vector3


class OrbitPhase(Enum):
    """Phase of an orbit."""

    APPROACH = auto()
    CIRCLE = auto()
    DONE = auto()


class Orbit:
    """Flies a circle; `heading` None means along it unless there is a region of interest."""

    def __init__(
        self,
        flight: Flight,
        circle: Circle,
        *,
        speed: float,
        angle: float,
        heading: OrbitHeading | None,
    ) -> None:
        self.phase = OrbitPhase.APPROACH
        self._circle = circle
        self._angle = angle  # [rad] Infinite: without end
        self._heading = heading
        self._entry, self._bearing = circle.entry(flight.rest_point(), flight.yaw.yaw)
        self._turned = 0.0  # [rad] Since the command
        self._turned_before = 0.0  # [rad] Of it, before the present approach
        self._own_heading = flight.yaw.yaw
        self._turned_us = flight.now_us  # When the yaw stick was last applied
        self._speed = self._choose_speed(flight, speed)
        flight.face(math.nan)
        flight.fly(flight.stop_at(self._entry))
        unknown = (math.nan, math.nan, math.nan)
        self._place = unknown if flight.frame is None else flight.frame.to_geodetic(circle.centre)

    def follow_reset(self, flight: Flight) -> None:
        """Approach the circle again, fixed to the earth, and fly the rest of the angle."""
        if self.phase is OrbitPhase.DONE:
            return
        self.phase = OrbitPhase.APPROACH
        self._angle -= abs(self._turned - self._turned_before)
        self._turned_before = self._turned
        self._entry, self._bearing = self._circle.entry(flight.rest_point(), flight.yaw.yaw)
        flight.fly(flight.stop_at(self._entry))

    def step(self, flight: Flight) -> bool:
        """Whether the angle is flown."""
        if self.phase is OrbitPhase.APPROACH and self._at_entry(flight):
            self.phase = OrbitPhase.CIRCLE
            flight.path.circle(
                self._circle.centre, self._circle.radius, self._angle, self._speed.limits
            )
        elif self.phase is OrbitPhase.CIRCLE:
            self._follow_bearing(flight)
            if flight.path.resting:
                self.phase = OrbitPhase.DONE
        self._turn(flight)
        flight.orbit_status = OrbitStatus(
            flight.now_us,
            active=True,
            radius_m=self._circle.radius,
            latitude_deg=self._place[0],
            longitude_deg=self._place[1],
            altitude_amsl_m=self._place[2],
            speed_m_s=self._speed.limits.speed,
            turned=abs(self._turned),
        )
        return self.phase is OrbitPhase.DONE

    def _at_entry(self, flight: Flight) -> bool:
        radius = flight.params.acceptance_radius
        settled = flight.yaw.settled or flight.landed
        return flight.path.resting and settled and flight.arrived(self._entry, radius)

    def _choose_speed(self, flight: Flight, speed: float) -> OrbitSpeed:
        limits = flight.limits()
        commanded = limits.speed_horizontal if math.isnan(speed) else speed
        hardest = flight.limits_with(Speeds(horizontal=math.inf))
        hardest = hardest._replace(jerk=min(hardest.jerk, JERK_PER_SPEED * abs(commanded)))
        turning = self._heading is None or turns_with_the_circle(self._heading)
        rate = math.radians(flight.params.yaw_rate_max_deg)
        chosen = speed_on(
            self._circle.radius,
            commanded,
            hardest,
            tilt_max=flight.tilt_max,
            yaw_rate_max=rate if turning else math.inf,
        )
        if chosen.clipped_by and not math.isnan(speed):
            text = f"Orbit speed limited to {chosen.limits.speed:.2f} m/s by {chosen.clipped_by}"
            flight.report(Severity.WARNING, text)
        return chosen

    def _follow_bearing(self, flight: Flight) -> None:
        north, east, _ = flight.path.state.position
        centre = self._circle.centre
        bearing = math.atan2(east - centre[1], north - centre[0])
        self._turned += wrap_pi(bearing - self._bearing)
        self._bearing = bearing

    def _turn(self, flight: Flight) -> None:
        if self._heading is None and flight.roi is not None:
            return
        heading = OrbitHeading.FORWARDS if self._heading is None else self._heading
        yaw = heading_at(heading, self._bearing, self._circle.radius)
        if math.isnan(yaw):
            flight.aim(self._own_heading, self._apply_yaw_stick(flight))
            return
        north, east, _ = flight.path.state.velocity
        circling = self.phase is OrbitPhase.CIRCLE
        rate = math.hypot(north, east) / self._circle.radius if circling else 0.0
        flight.aim(yaw, rate)

    def _apply_yaw_stick(self, flight: Flight) -> float:
        """Turn the vehicle's own heading by the yaw stick; the rate [rad/s]."""
        elapsed_s = (flight.now_us - self._turned_us) * 1e-6
        self._turned_us = flight.now_us
        if self._heading is not OrbitHeading.PILOT:
            return 0.0
        rate = flight.yaw_stick * math.radians(flight.params.yaw_rate_max_deg)
        self._own_heading = wrap_pi(self._own_heading + rate * elapsed_s)
        return rate


class OrbitMode(NavigatorMode):
    """ORBIT, about the present position without a target; finished when the angle is flown."""

    def __init__(self) -> None:
        self._orbit: Orbit | None = None

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Begin the approach to the circle."""
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
        """Finish when the angle is flown."""
        if self._orbit is not None:
            self.finished = self._orbit.step(flight)

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Return to the circle, which stays fixed to the earth."""
        del step
        if self._orbit is not None:
            self._orbit.follow_reset(flight)

    def on_speeds(self, flight: Flight) -> None:
        """Ignore the change: the speed of an orbit is part of its command."""
