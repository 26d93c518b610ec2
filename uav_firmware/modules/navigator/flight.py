"""What a mode acts on: estimate, home and geofence, and the setpoint that it moves."""

import math
from dataclasses import dataclass, field

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.ground_contact import GROUND_SINK_SPEED_M_S
from uav_firmware.lib.motion import MotionLimits
from uav_firmware.lib.resets import EstimateStep
from uav_firmware.lib.rotation import wrap_pi
from uav_firmware.lib.smoothing import Waypoint
from uav_firmware.lib.vector import ZERO, norm, subtract
from uav_firmware.modules.navigator.geofence.geofence import Geofence
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.modules.navigator.path_follower import PathFollower
from uav_firmware.modules.navigator.yaw_slew import YawSlew
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.guidance import OrbitStatus, RegionOfInterest
from uav_firmware.msg.mission import MissionItem
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import HomePosition, Severity
from uav_firmware.msg.vectors import Vector3

NAN = math.nan
UNSET: Vector3 = (NAN, NAN, NAN)
JERK_PER_SPEED = 1.5  # [1/s^2] Jerk over commanded speed of a trajectory

_FACING_SPEED = 0.3  # [m/s] horizontal setpoint speed above which the nose follows it
_PLANNED_SHARE = 0.97  # of a commanded speed, for the trajectory
_NEAREST_LOOK_M = 1.0  # [m] The direction of a nearer place is not followed


@dataclass(slots=True)
class Speeds:
    """Speeds commanded in place of the parameters' [m/s]; NaN where none is.

    A speed over the ground that is commanded is the greatest speed along the path: a leg that
    climbs is flown no faster than a level one, unless a faster climb or descent is commanded too.
    The vehicle overshoots the trajectory by some percent, more at the end of a strong
    acceleration. The trajectory therefore stays below a commanded speed and approaches it with
    a low jerk: the true velocity exceeds the command by 5 % at most
    (`tests/scenario/test_navigation_square.py`).
    """

    horizontal: float = NAN
    up: float = NAN
    down: float = NAN

    def apply(self, limits: MotionLimits) -> MotionLimits:
        """Put the commanded speeds into the limits."""
        return limits._replace(
            speed_horizontal=_or(self.horizontal, limits.speed_horizontal),
            speed_up=_or(self.up, limits.speed_up),
            speed_down=_or(self.down, limits.speed_down),
            speed_path=min(_PLANNED_SHARE * self.path, limits.speed_path),
            jerk_path=min(JERK_PER_SPEED * self.path, limits.jerk_path),
        )

    @property
    def path(self) -> float:
        """Greatest speed [m/s] of the whole velocity; infinite where none is commanded."""
        if math.isnan(self.horizontal):
            return math.inf
        return max(
            speed for speed in (self.horizontal, self.up, self.down) if not math.isnan(speed)
        )

    def with_change(self, speed_type: int, speed: float) -> "Speeds":
        """Speeds after a MAVLink SPEED_TYPE has been set; NaN goes back to the parameter."""
        return Speeds(
            speed if speed_type in {0, 1} else self.horizontal,
            speed if speed_type == 2 else self.up,
            speed if speed_type == 3 else self.down,
        )


def _or(value: float, default: float) -> float:
    return default if math.isnan(value) else value


@dataclass(slots=True)
class Flight:
    """State of the vehicle and setpoint; the module updates the state before each step."""

    params: NavigatorParams
    now_us: int = 0  # [us]
    estimate: VehicleLocalPosition | None = None
    frame: LocalFrame | None = None  # About the estimate's origin
    home: HomePosition | None = None
    landed: bool = True
    motor_lost_us: int | None = None  # [us] Since when a motor has failed; None: none has
    ground_down: float = NAN  # [m] Of the ground below, by the range finder; NaN: not measured
    range_finder_failed: bool = False  # It is stuck: what it has measured was no ground
    range_finder_silent: bool = False  # It has sent samples, and does no more
    yaw_stick: float = 0.0  # [-] -1 to 1, positive clockwise; 0 without a pilot
    ceiling: Vector3 = (math.inf, math.inf, math.inf)  # [m/s] Horizontal, up, down
    speeds: Speeds = field(default_factory=Speeds)
    path: PathFollower = field(default_factory=PathFollower)
    yaw: YawSlew = field(default_factory=YawSlew)
    yaw_target: float = NAN  # [rad] NaN: the nose follows the path
    course: float = 0.0  # [rad] Direction that the nose follows
    abort_down: float = NAN  # [m] Down coordinate to climb back to when a landing is broken off
    tilt_max: float = 0.5 * math.pi  # [rad] Of the position controller
    fence: Geofence = field(default_factory=Geofence)
    fence_enabled: bool = True  # False: `fence` has no bounds
    rally_points: tuple[Vector3, ...] = ()  # [m, NED]
    fence_return: Vector3 | None = None  # [m, NED] Where a return from a breach leads
    breached: bool = False  # The vehicle is outside the geofence
    roi: Vector3 | None = None  # [m, NED] Place that the nose points at
    turn_left: float = NAN  # [rad] Rest of a commanded turn; NaN when there is none
    turn_rate: float = NAN  # [rad/s] Of that turn
    orbit_status: OrbitStatus | None = None  # Of the circle flown in this step
    home_commands: list[MissionItem] = field(default_factory=list)  # DO_SET_HOME items reached
    payload_commands: list[MissionItem] = field(default_factory=list)  # Items for camera and gimbal
    regions: list[RegionOfInterest] = field(default_factory=list)  # To be published for the gimbal
    texts: list[tuple[Severity, str]] = field(default_factory=list)  # For the operator
    _aim: tuple[float, float] | None = None  # [rad, rad/s] Heading of this step alone

    def limits(self) -> MotionLimits:
        """Limits of the trajectory with the commanded speeds."""
        return self.limits_with(self.speeds)

    def limits_with(self, speeds: Speeds) -> MotionLimits:
        """Limits of the trajectory with given speeds, cut to what the controller allows."""
        limits = speeds.apply(self.params.limits())
        horizontal, up, down = self.ceiling
        return limits._replace(
            speed_horizontal=min(limits.speed_horizontal, horizontal),
            speed_up=min(limits.speed_up, up),
            speed_down=min(limits.speed_down, down),
        )

    @property
    def position(self) -> Vector3:
        """Estimated position [m, NED]."""
        return self.estimate.position_ned if self.estimate is not None else ZERO

    @property
    def position_measured(self) -> bool:
        """Whether the position is known, and not by dead reckoning alone."""
        estimate = self.estimate
        return estimate is not None and estimate.position_valid and not estimate.dead_reckoning

    def to_ned(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Vector3:
        """Local position [m, NED]; NaN horizontal or vertical parts keep the setpoint's."""
        here = self.rest_point()
        if self.frame is None:
            return here
        down = self.frame.altitude_amsl_m - altitude_amsl_m
        if math.isnan(latitude_deg) or math.isnan(longitude_deg):
            north, east = here[:2]
        else:
            north, east, _ = self.frame.to_ned(
                latitude_deg, longitude_deg, self.frame.altitude_amsl_m
            )
        return (north, east, here[2] if math.isnan(down) else down)

    def rest_point(self) -> Vector3:
        """Where the setpoint would come to rest [m, NED]."""
        return self.path.rest_point(self.limits())

    def home_down(self, height_m: float) -> float:
        """Down coordinate [m] of a height above home."""
        return (self.home.position_ned[2] if self.home is not None else 0.0) - height_m

    def height_of(self, down: float) -> float:
        """Height above home [m] of a down coordinate."""
        return (self.home.position_ned[2] if self.home is not None else 0.0) - down

    def stop_at(self, position: Vector3) -> Waypoint:
        """Waypoint to stop at, flown with the present limits."""
        return Waypoint(position, 0.0, self.limits())

    def fly(self, *route: Waypoint) -> None:
        """Fly a route from the present motion."""
        self.path.fly(route, self.limits())

    def hold(self) -> None:
        """Come to rest."""
        self.path.stop(self.limits())

    def brake(self) -> bool:
        """Come to rest with the heading held; whether that takes any time."""
        self.hold()
        if self.path.resting:
            return False
        self.face(math.degrees(self.yaw.yaw))
        return True

    def face(self, yaw_deg: float) -> None:
        """Turn to a heading [deg]; NaN keeps the nose along the path, as it is until it moves."""
        if not math.isnan(self.yaw_target):
            self.course = self.yaw_target
        self.yaw_target = math.radians(yaw_deg)
        self.turn_left = NAN

    def aim(self, yaw: float, rate: float = 0.0) -> None:
        """Point the nose to `yaw` [rad], which turns at `rate` [rad/s], in this step."""
        self._aim = (yaw, rate)

    def turn_by(self, angle: float, rate: float = NAN) -> None:
        """Turn through `angle` [rad], in the direction of its sign, at `rate` [rad/s] at most."""
        self.turn_left, self.turn_rate = angle, rate

    def turn_to(self, angle: float, direction: int, rate: float = NAN) -> None:
        """Turn to a heading [rad]: clockwise with direction 1, counter-clockwise with -1."""
        turn = wrap_pi(angle - self.yaw.yaw)
        if direction * turn < 0.0:
            turn += math.copysign(math.tau, direction)
        self.turn_by(turn, rate)

    @property
    def turned(self) -> bool:
        """Whether the commanded heading is reached, or none is commanded."""
        return math.isnan(self.turn_left) and (math.isnan(self.yaw_target) or self.yaw.settled)

    def switch_fence(self, *, enabled: bool) -> None:
        """Enable or disable the geofence; a change is reported."""
        if enabled is not self.fence_enabled:
            self.fence_enabled = enabled
            if enabled:
                self.report(Severity.NOTICE, "Geofence on")
            else:
                self.report(Severity.WARNING, "Geofence off")

    def report(self, severity: Severity, text: str) -> None:
        """Send a STATUSTEXT to the operator."""
        self.texts.append((severity, text))

    def arrived(self, point: Vector3, radius: float) -> bool:
        """Whether the vehicle is within `radius` [m] of a point, by its estimate."""
        horizontal, vertical = self.error_to(point)
        return horizontal <= radius and vertical <= self.params.altitude_acceptance

    def error_to(self, point: Vector3) -> tuple[float, float]:
        """Horizontal and vertical distance [m] from the estimated position to a point."""
        north, east, down = self.position
        return math.hypot(point[0] - north, point[1] - east), abs(point[2] - down)

    @property
    def behind_m(self) -> float:
        """Level distance [m] of the vehicle from its setpoint; 0 where it is not known."""
        if self.estimate is None or not self.estimate.position_valid:
            return 0.0
        return self.error_to(self.path.state.position)[0]

    @property
    def motor_lost_s(self) -> float | None:
        """For how long a motor has failed [s]; None while all turn."""
        since_us = self.motor_lost_us
        return None if since_us is None else (self.now_us - since_us) * 1e-6

    @property
    def range_finder_blind(self) -> bool:
        """Whether the range finder that there is cannot show the ground: it is stuck, or silent."""
        return self.range_finder_failed or self.range_finder_silent

    def begin_where_it_is(self) -> None:
        """Put the setpoint to a vehicle that has been blown off it: it would wait there for ever.

        Closer than MPC_XY_ERR_MAX the vehicle follows, and the setpoint goes on without a jump.
        """
        estimate = self.estimate
        if estimate is not None and self.behind_m > self.params.tracking_error_max:
            velocity = estimate.velocity_ned if estimate.velocity_valid else ZERO
            self.path.reset(estimate.position_ned, velocity)

    def stay_near(self) -> None:
        """Keep a setpoint that sinks within MPC_XY_ERR_MAX of a vehicle that is blown off it."""
        farthest, behind = self.params.tracking_error_max, self.behind_m
        if behind > farthest:
            north, east, _ = subtract(self.position, self.path.state.position)
            share = 1.0 - farthest / behind
            self.path.move((share * north, share * east, 0.0))

    def restart(self) -> None:
        """Put the setpoint where the vehicle is."""
        estimate = self.estimate
        if estimate is not None:
            moving = estimate.velocity_valid and not self.landed
            velocity = estimate.velocity_ned if moving else ZERO
            self.path.reset(estimate.position_ned, velocity)
            self.yaw.reset(estimate.heading)
            self.course = self.yaw.yaw
        self.yaw_target = self.turn_left = NAN

    def shift(self, step: EstimateStep) -> None:
        """Move the setpoint with a reset of the estimate; waypoints stay fixed to the earth."""
        self.path.shift(step.position_ned, step.velocity_ned, self.limits())
        self.yaw.yaw = wrap_pi(self.yaw.yaw + step.heading)
        self.course = wrap_pi(self.course + step.heading)

    def advance(self, dt: float) -> TrajectorySetpoint:
        """Move the setpoint on by `dt` [s], more slowly when the vehicle lags behind."""
        estimate = self.estimate
        if estimate is not None and estimate.position_valid and estimate.velocity_valid:
            self.path.shorten_stop(estimate.position_ned, estimate.velocity_ned)
        pace = self._pace()
        position, velocity, acceleration = self.path.advance(dt * pace)
        if not self.landed:
            self._turn(velocity, dt)
        if self.path.sinking:
            position = (position[0], position[1], NAN)
        return TrajectorySetpoint(
            self.now_us,
            position,
            (velocity[0] * pace, velocity[1] * pace, velocity[2] * pace),
            (acceleration[0] * pace, acceleration[1] * pace, acceleration[2] * pace),
            self.yaw.yaw,
            self.yaw.rate,
            self.path.goal or UNSET,
            max(self.speeds.path, norm(velocity)),
        )

    def idle(self) -> TrajectorySetpoint:
        """Setpoint of a vehicle that stays on the ground."""
        self.restart()
        return TrajectorySetpoint(
            self.now_us,
            UNSET,
            (0.0, 0.0, GROUND_SINK_SPEED_M_S),
            ZERO,
            self.yaw.yaw,
            0.0,
        )

    def _pace(self) -> float:
        """Share of full speed: 1 up to half the allowed tracking error, 0 at all of it."""
        if self.path.sinking or self.path.stopping or self.estimate is None:
            return 1.0
        north, east, down = subtract(self.path.state.position, self.position)
        if self.path.descending or not self.estimate.position_valid:
            north = east = 0.0
        error = math.hypot(north, east, down)
        return max(0.0, min(1.0, 2.0 - 2.0 * error / self.params.tracking_error_max))

    def _turn(self, velocity: Vector3, dt: float) -> None:
        rate_max = math.radians(self.params.yaw_rate_max_deg)
        acceleration_max = math.radians(self.params.yaw_acceleration_max_deg)
        aim, self._aim = self._aim, None
        if not math.isnan(self.turn_left):
            limit = min(_or(self.turn_rate, rate_max), rate_max)
            self.turn_left = self.yaw.turn_by(self.turn_left, dt, limit, acceleration_max)
            if self.yaw.settled:
                self.turn_left, self.yaw_target = NAN, self.yaw.yaw
            return
        target, rate = aim or self._look(velocity)
        self.yaw.advance(target, dt, rate_max, acceleration_max, rate)

    def _look(self, velocity: Vector3) -> tuple[float, float]:
        """Heading [rad] and its rate [rad/s]: at the region of interest, as commanded, or ahead."""
        if self.roi is not None:
            return self._look_at(self.roi, velocity)
        if not math.isnan(self.yaw_target):
            return self.yaw_target, 0.0
        if math.hypot(velocity[0], velocity[1]) > _FACING_SPEED:
            self.course = math.atan2(velocity[1], velocity[0])
        return self.course, 0.0

    def _look_at(self, place: Vector3, velocity: Vector3) -> tuple[float, float]:
        north, east, _ = subtract(place, self.path.state.position)
        distance = math.hypot(north, east)
        if distance < _NEAREST_LOOK_M:
            return self.yaw.yaw, 0.0
        rate = (east * velocity[0] - north * velocity[1]) / distance**2
        return math.atan2(east, north), rate
