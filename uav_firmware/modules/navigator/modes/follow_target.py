"""AUTO_FOLLOW_TARGET: keeps its place beside a reported target.

    SEARCH --two reports that agree--> FOLLOW --3 s without one--> SEARCH

In SEARCH the vehicle holds.
"""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.lib.guide import approach_speed
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.lib.vector import subtract
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.modules.navigator.modes.target_estimator import TargetEstimator
from uav_firmware.msg.guidance import FollowHeight, FollowOrder, FollowTarget
from uav_firmware.msg.mission import ModeTarget
from uav_firmware.msg.status import Severity
from uav_firmware.msg.vectors import Vector3

_SOURCE_SILENT_US: Final = 10_000_000  # [us] After it another source is accepted
_COURSE_SPEED: Final = 1.0  # [m/s] Above it the course of a target is known
_COURSE_RATE: Final = 0.3  # [rad/s] With which the place turns with that course
_DEFAULT_SIGMA_M: Final = 1.0
_SPEED_SHARE: Final = 2.0  # Of FLW_TGT_MAX_VEL: reports of faster targets are dropped


class FollowMode(NavigatorMode):
    """AUTO_FOLLOW_TARGET; never finished."""

    def __init__(self, reports: Topic[FollowTarget]) -> None:
        self._reports = reports
        self._seen = 0  # Reports processed
        self._filter = TargetEstimator()
        self._source: int | None = None
        self._source_us = 0
        self._order: FollowOrder | None = None
        self._following = False
        self._course = math.nan  # [rad] That the place beside the target turns with
        self._down = math.nan  # [m] Height that is kept
        self._last_us = 0

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Hold until the target is known."""
        self._order = target if isinstance(target, FollowOrder) else None
        self._source, self._following = None, False
        self._seen = self._reports.count
        self._filter.reset()
        self._course = self._down = math.nan
        self._last_us = flight.now_us
        flight.yaw_target = flight.yaw.yaw
        flight.hold()

    def on_active(self, flight: Flight) -> None:
        """Fuse the newest report and follow the estimate."""
        self._accept_report(flight)
        dt = (flight.now_us - self._last_us) * 1e-6
        self._last_us = flight.now_us
        if self._filter.known(flight.now_us):
            self._follow(flight, dt)
        elif self._following:
            self._following = False
            flight.report(Severity.WARNING, "Target lost: holding")
            flight.yaw_target = flight.yaw.yaw
            flight.hold()

    def on_speeds(self, flight: Flight) -> None:
        """Ignore the change: FLW_TGT_MAX_VEL is the speed of this mode."""

    def _accept_report(self, flight: Flight) -> None:
        report = self._reports.value
        if report is None or self._reports.count == self._seen:
            return
        self._seen = self._reports.count
        if flight.frame is None or not self._is_ours(report):
            return
        place = (report.latitude_deg, report.longitude_deg, report.altitude_amsl_m)
        if not all(map(math.isfinite, place)):
            return
        velocity = report.velocity_ned if all(map(math.isfinite, report.velocity_ned)) else None
        sigma = report.accuracy_m if report.accuracy_m > 0.0 else _DEFAULT_SIGMA_M
        accepted = self._filter.report(
            report.time_us,
            flight.frame.to_ned(*place),
            velocity,
            sigma=sigma,
            acceleration_sigma=max(0.1, 1.0 - flight.params.follow_responsiveness),
            speed_max=_SPEED_SHARE * flight.params.follow_speed,
        )
        if accepted:
            self._source, self._source_us = report.system_id, report.time_us

    def _is_ours(self, report: FollowTarget) -> bool:
        """Whether a report is of the one source that is followed until its timeout."""
        source = 0 if self._order is None else self._order.system_id
        if source:
            return report.system_id == source
        silent = report.time_us - self._source_us > _SOURCE_SILENT_US
        return self._source is None or silent or report.system_id == self._source

    def _follow(self, flight: Flight, dt: float) -> None:
        position, velocity = self._filter.at(flight.now_us)
        if not self._following:
            self._following = True
            self._begin(flight, position)
            flight.report(Severity.INFO, "Following the target")
        self._turn_course(velocity, dt)
        angle = self._course + math.radians(flight.params.follow_angle_deg)
        goal = (
            position[0] + flight.params.follow_distance * math.cos(angle),
            position[1] + flight.params.follow_distance * math.sin(angle),
            self._goal_down(flight, position),
        )
        flight.path.track_velocity(_wanted_velocity(flight, goal, velocity), flight.limits())
        self._face(flight, position, velocity)

    def _begin(self, flight: Flight, position: Vector3) -> None:
        """Choose the side of the target on which the vehicle is, and the height."""
        here = flight.path.state.position
        bearing = math.atan2(here[1] - position[1], here[0] - position[0])
        if math.isnan(self._course):
            self._course = wrap_pi(bearing - math.radians(flight.params.follow_angle_deg))
        if math.isnan(self._down):
            self._down = self._first_down(flight, position)

    def _first_down(self, flight: Flight, position: Vector3) -> float:
        """Down coordinate to keep, or the difference to the target's."""
        here = flight.rest_point()[2]
        order, params = self._order, flight.params
        height = FollowHeight.PARAMETERS if order is None else order.height
        if height is FollowHeight.KEEP:
            return here
        if height is FollowHeight.KEEP_DIFFERENCE:
            return here - position[2]
        if height is FollowHeight.FIXED and order is not None:
            return flight.home_down(order.height_m)
        if params.follow_altitude_mode == 2:
            return -params.follow_height
        return flight.home_down(params.follow_height)

    def _goal_down(self, flight: Flight, position: Vector3) -> float:
        height = FollowHeight.PARAMETERS if self._order is None else self._order.height
        by_target = height is FollowHeight.KEEP_DIFFERENCE or (
            height is FollowHeight.PARAMETERS and flight.params.follow_altitude_mode == 2
        )
        down = self._down + position[2] if by_target else self._down
        return min(down, flight.home_down(flight.params.follow_lowest))

    def _turn_course(self, velocity: Vector3, dt: float) -> None:
        if math.hypot(velocity[0], velocity[1]) < _COURSE_SPEED:
            return
        error = wrap_pi(math.atan2(velocity[1], velocity[0]) - self._course)
        step = _COURSE_RATE * dt
        self._course = wrap_pi(self._course + max(-step, min(step, error)))

    def _face(self, flight: Flight, position: Vector3, velocity: Vector3) -> None:
        north, east, _ = subtract(position, flight.path.state.position)
        distance = math.hypot(north, east)
        if distance < 1.0:
            return
        vn, ve, _ = subtract(velocity, flight.path.state.velocity)
        flight.aim(math.atan2(east, north), (north * ve - east * vn) / distance**2)


def _wanted_velocity(flight: Flight, goal: Vector3, velocity: Vector3) -> Vector3:
    """Velocity of the target plus a correction towards the goal, within the limits [m/s]."""
    limits = flight.limits()
    north, east, down = subtract(goal, flight.path.state.position)
    distance = math.hypot(north, east)
    closing = approach_speed(distance, limits.acceleration_horizontal) / max(distance, 1e-6)
    vn, ve = velocity[0] + closing * north, velocity[1] + closing * east
    speed = math.hypot(vn, ve)
    share = min(1.0, min(flight.params.follow_speed, flight.ceiling[0]) / max(speed, 1e-6))
    upright = approach_speed(abs(down), min(limits.acceleration_up, limits.acceleration_down))
    vd = max(-limits.speed_up, min(limits.speed_down, math.copysign(upright, down)))
    return (share * vn, share * ve, vd)
