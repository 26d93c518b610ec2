"""The navigator on the bus: topics in, one mode at a time, setpoint and progress out."""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.lib import fence_rules, mission_rules
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.guide import LONGEST_STEP_S
from uav_firmware.lib.mission_rules import DistanceLimits
from uav_firmware.lib.resets import ResetFollower
from uav_firmware.lib.terrain import ground_down
from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.geofence import area
from uav_firmware.modules.navigator.geofence.area import LocalGeofence
from uav_firmware.modules.navigator.geofence.monitor import GeofenceMonitor
from uav_firmware.modules.navigator.mission.mission_mode import MissionMode
from uav_firmware.modules.navigator.mission.review import MissionReview, PlanChecks
from uav_firmware.modules.navigator.modes.follow_target import FollowMode
from uav_firmware.modules.navigator.modes.land import LandMode
from uav_firmware.modules.navigator.modes.loiter import LoiterMode
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.modules.navigator.modes.orbit import OrbitMode
from uav_firmware.modules.navigator.modes.return_to_launch import ReturnMode
from uav_firmware.modules.navigator.modes.takeoff import TakeoffMode
from uav_firmware.modules.navigator.modes.yaw_commands import (
    apply_heading,
    apply_region_of_interest,
)
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.msg.control_mode import (
    ControlSource,
    ManualControlSetpoint,
)
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.geofence import FenceBreach
from uav_firmware.msg.guidance import (
    FollowOrder,
    HeadingRequest,
    OrbitTarget,
    RegionOfInterest,
)
from uav_firmware.msg.mission import (
    FenceSwitch,
    MissionCurrentRequest,
    MissionItem,
    MissionProgress,
    ModeTarget,
    NavigatorStatus,
    NavigatorTarget,
    PlanReview,
    PlanType,
    ReturnOrder,
    SpeedRequest,
    TargetCheckResult,
)
from uav_firmware.msg.status import NavigationState, Severity, StatusText, VehicleCommand
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

READS: Final = (
    "vehicle_local_position", "vehicle_status", "vehicle_control_mode", "land_detected",
    "home_position", "mission", "fence", "rally_points", "navigator_request", "follow_target",
    "target_check_request", "plan_check_request", "failure_detector_status",
    "manual_control_setpoint", "sensor_range", "terrain_estimate",
)  # fmt: skip
WRITES: Final = (
    "trajectory_setpoint", "mission_progress", "navigator_status", "orbit_status",
    "geofence_status", "target_check_result", "plan_check_result", "vehicle_command",
    "payload_order", "region_of_interest", "status_text",
)  # fmt: skip
_SHORTEST_STEP_US: Final = 8_000  # A call that comes sooner waits; topology.py calls at 62.5 Hz

_SPEED_LIMITS: Final = ("MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN")
_TILT_LIMIT: Final = "MPC_TILTMAX_AIR"
_STICKS_TIMEOUT_US: Final = 500_000  # [us] Sticks older than this are ignored
_SILENT_US: Final = 1_000_000  # [us] Without a sample a range finder has failed; it sends at 20 Hz
_DEAD_ZONE: Final = 0.1  # [-] Smaller deflections count as centred


class NavigatorModule:
    """Flies the mode that the commander has chosen.

    Declares `NavigatorParams` in the registry.
    """

    def __init__(self, registry: Registry, topics: Topics) -> None:
        registry.add(NavigatorParams)
        self._registry = registry
        self._topics = topics
        self._plan_checks = PlanChecks(
            topics.plan_check_request, topics.plan_check_result, self._review_upload
        )
        self._reporter = Reporter(topics)
        self._area = LocalGeofence(topics.fence, topics.rally_points)
        self._fence_watch = GeofenceMonitor()
        self._checked_version = 0  # Of the geofence that the target of the present mode passed
        self._params_version: int | None = None
        self._flight = Flight(registry.read(NavigatorParams))
        self._mission = MissionMode()
        self._hold = LoiterMode()
        self._follow_mode = FollowMode(topics.follow_target)
        self._modes: dict[NavigationState, NavigatorMode] = {
            NavigationState.AUTO_MISSION: self._mission,
            NavigationState.AUTO_LOITER: self._hold,
            NavigationState.AUTO_TAKEOFF: TakeoffMode(),
            NavigationState.AUTO_LAND: LandMode(),
            NavigationState.AUTO_RTL: ReturnMode(),
            NavigationState.ORBIT: OrbitMode(),
            NavigationState.AUTO_FOLLOW_TARGET: self._follow_mode,
        }
        self._active: NavigatorMode | None = None  # None while disarmed
        self._target: ModeTarget | None = None
        self._braking = False  # The active mode begins when the vehicle has come to rest
        self._target_at_rest: ModeTarget | None = None  # Of that mode
        self._review = MissionReview()
        self._mission_count = 0
        self._last_us: int | None = None
        self._resets = ResetFollower()

    def check_targets(self) -> None:
        """Answer the commander: whether the geofence allows its targets."""
        requests = self._topics.target_check_request.drain()
        if requests:
            self._area.update(self._flight)  # The fence may have changed since the last step
        for request in requests:
            refusal = area.refusal_of(request.target, self._flight) or ""
            self._topics.target_check_result.publish(TargetCheckResult(request.request_id, refusal))

    def check_plans(self) -> None:
        """Answer mavlink: whether uploaded plans can be flown; long ones take several calls."""
        self._plan_checks.update()

    def update(self, now_us: int) -> None:
        """Run a step if one is due."""
        if self._last_us is None:
            self._last_us = now_us
        elapsed_us = now_us - self._last_us
        if 0 < elapsed_us < _SHORTEST_STEP_US:
            return
        self._last_us = now_us
        self._observe(now_us)
        self._accept_mission()
        self._handle_requests()
        self._choose_mode()
        self._watch_fence()
        self._fly(min(elapsed_us * 1e-6, LONGEST_STEP_S))
        self._report(now_us)

    def _observe(self, now_us: int) -> None:
        flight = self._flight
        flight.now_us = now_us
        if self._params_version != self._registry.version:
            self._params_version = self._registry.version
            flight.params = self._registry.read(NavigatorParams)
            flight.ceiling = _speed_limits(self._registry)
            flight.tilt_max = _tilt_max(self._registry)
        estimate = self._topics.vehicle_local_position.value
        flight.estimate = estimate
        flight.home = self._topics.home_position.value
        land = self._topics.land_detected.value
        flight.landed = land is None or land.landed
        failure = self._topics.failure_detector_status.value
        if failure is None or failure.failed_motors == 0:
            flight.motor_lost_us = None
        elif flight.motor_lost_us is None:
            flight.motor_lost_us = now_us
        if estimate is not None:
            flight.frame = _frame_of(estimate, flight.frame)
            self._follow_resets(estimate)
        terrain = self._topics.terrain_estimate.value
        flight.ground_down = ground_down(terrain, now_us)
        flight.range_finder_failed = terrain is not None and terrain.has_failed
        sample = self._topics.sensor_range.value
        flight.range_finder_silent = sample is not None and now_us - sample.time_us > _SILENT_US
        flight.yaw_stick = _yaw_stick(self._topics.manual_control_setpoint.value, now_us)
        self._area.update(flight)

    def _follow_resets(self, estimate: VehicleLocalPosition) -> None:
        """Move the setpoint with an estimate that was reset."""
        step = self._resets.update(estimate.resets)
        if step is None:
            return
        self._flight.shift(step)
        if self._active is not None and not self._braking:
            self._active.on_reset(self._flight, step)

    def _accept_mission(self) -> None:
        mission = self._topics.mission.value
        if mission is not None and self._mission_count != self._topics.mission.count:
            self._mission_count = self._topics.mission.count
            flies = self._active is self._mission and not self._flight.landed
            if flies and self._mission.cursor.items and not mission.items:
                self._flight.report(Severity.WARNING, "Mission cleared in flight: holding here")
            self._mission.load(mission)
            self._restart_mission()
        items = self._mission.cursor.items
        if reason := self._review.update(items, self._conditions, self._review_mission):
            self._flight.report(Severity.WARNING, f"Mission cannot be flown: {reason}")

    @property
    def _conditions(self) -> tuple[int, int]:
        """Counters that change with home, geofence or parameters."""
        return (self._topics.home_position.count, self._area.version)

    def _review_upload(self, plan_type: PlanType, items: tuple[MissionItem, ...]) -> PlanReview:
        self._area.update(self._flight)  # A fence may have been uploaded just before
        if plan_type is PlanType.FENCE:
            return (yield from fence_rules.review_fence(items))
        if plan_type is PlanType.RALLY_POINTS:
            return (yield from area.review_rally_points(items, self._flight))
        conditions = self._conditions
        rejection = yield from self._review_mission(items)
        if rejection is None:
            self._review.note_accepted(items, conditions)
        return rejection

    def _review_mission(self, items: Sequence[MissionItem]) -> PlanReview:
        home, params = self._flight.home, self._flight.params
        limits = DistanceLimits(params.farthest_first_position, params.longest_leg)
        rejection = yield from mission_rules.review(items, home, limits)
        return rejection or (yield from area.review_mission(items, self._flight))

    def _restart_mission(self) -> None:
        if self._active is self._mission and not self._braking:
            self._mission.on_activation(self._flight, None)

    def _handle_requests(self) -> None:
        for request in self._topics.navigator_request.drain():
            match request:
                case NavigatorTarget() | OrbitTarget() | FollowOrder() | ReturnOrder():
                    self._target = request
                case SpeedRequest():
                    flight = self._flight
                    flight.speeds = flight.speeds.with_change(request.speed_type, request.speed_m_s)
                    if self._active is not None and not self._braking:
                        self._active.on_speeds(flight)
                case RegionOfInterest():
                    apply_region_of_interest(self._flight, request)
                case FenceSwitch(enabled=enabled):
                    self._flight.switch_fence(enabled=enabled)
                case HeadingRequest():
                    apply_heading(self._flight, request)
                case MissionCurrentRequest():
                    if self._mission.select(request.seq, reset=request.reset):
                        self._restart_mission()

    def _choose_mode(self) -> None:
        """Leave and enter modes; a target whose mode is not entered is dropped."""
        status = self._topics.vehicle_status.value
        armed = status is not None and status.armed and self._controls_setpoint
        if status is not None:
            self._area.update_arming(self._flight, armed=status.armed)
            if not status.armed:
                self._flight.roi = None
        if status is None or not armed or self._flight.estimate is None:
            self._enter(None)
            return
        mode = self._modes.get(status.navigation_state, self._hold)
        target, own = self._target, None
        if target is not None and self._modes.get(target.navigation_state) is mode:
            own = target
        if mode is not self._active or own is not None:
            self._target = None
            if mode is not self._hold:
                self._flight.abort_down = math.nan
            braking = self._braking or self._active is None or self._fence_watch.alarmed
            self._enter(mode)
            self._checked_version = self._area.version
            self._begin(mode, own, braking=braking)

    def _begin(self, mode: NavigatorMode, target: ModeTarget | None, *, braking: bool) -> None:
        """Begin a mode, behind a stop if the vehicle has to brake first.

        It has to when others have moved it so far, by more than the limits of a trajectory
        perhaps, or when it is about to leave the geofence: then no bend leads on from its motion,
        and no place is derived from where a stop was expected to end.
        """
        mode.finished = False
        if braking and self._flight.brake():
            self._braking, self._target_at_rest = True, target
        else:
            mode.on_activation(self._flight, target)

    def _begin_at_rest(self, mode: NavigatorMode) -> None:
        if self._flight.path.resting:
            self._braking = False
            self._flight.face(math.nan)
            mode.on_activation(self._flight, self._target_at_rest)

    @property
    def _controls_setpoint(self) -> bool:
        """Whether the navigator writes the setpoint, not sticks or a stream of setpoints."""
        control = self._topics.vehicle_control_mode.value
        return control is None or control.source is ControlSource.NAVIGATOR

    def _enter(self, mode: NavigatorMode | None) -> None:
        if self._active is not None and mode is not self._active:
            self._active.on_inactivation(self._flight)
        if mode is not self._active:
            self._flight.speeds = Speeds()
        self._active = mode
        self._braking = False

    def _is_route_checked(self) -> bool:
        """Whether the route flown has been checked against the present geofence."""
        if self._active is self._mission:
            return self._review.rejection is None
        if self._active is self._follow_mode:
            return False
        return self._active is not None and self._checked_version == self._area.version

    def _watch_fence(self) -> None:
        flight = self._flight
        status = self._fence_watch.update(flight, route_checked=self._is_route_checked())
        if status is not None:
            flight.breached = status.breach is not FenceBreach.NONE
            self._topics.geofence_status.publish(status)

    def _fly(self, dt: float) -> None:
        flight, mode = self._flight, self._active
        flight.orbit_status = None
        if mode is not None and self._braking:
            self._begin_at_rest(mode)
        if mode is not None and not self._braking:
            mode.on_active(flight)
        if flight.estimate is None:
            return
        if not self._controls_setpoint:
            flight.restart()  # The next mode begins from the present motion
            return
        on_ground = mode is None or mode.stays_on_ground(flight)
        setpoint = flight.idle() if on_ground else flight.advance(dt)
        self._topics.trajectory_setpoint.publish(setpoint)

    def _report(self, now_us: int) -> None:
        self._reporter.report_flight(self._flight)
        self._reporter.report_progress(
            self._mission.cursor.progress(now_us, active=self._active is self._mission)
        )
        vehicle = self._topics.vehicle_status.value
        if vehicle is not None:
            done = self._active is not None and self._active.finished
            self._reporter.report_status(
                NavigatorStatus(now_us, vehicle.navigation_state, done, self._review.rejection)
            )


def _tilt_max(registry: Registry) -> float:
    """Largest tilt [rad] that the position controller allows."""
    if _TILT_LIMIT not in registry.names():
        return 0.5 * math.pi
    return math.radians(float(registry.get(_TILT_LIMIT)))


def _speed_limits(registry: Registry) -> Vector3:
    """Speeds that the position controller allows: horizontal, up, down [m/s]."""
    declared = set(registry.names())
    horizontal, up, down = (
        float(registry.get(name)) if name in declared else math.inf for name in _SPEED_LIMITS
    )
    return (horizontal, up, down)


def _frame_of(estimate: VehicleLocalPosition, frame: LocalFrame | None) -> LocalFrame | None:
    """Local frame of the estimate's origin; a new one only when the origin has moved."""
    origin = estimate.origin
    if frame is not None and origin == (
        frame.latitude_deg,
        frame.longitude_deg,
        frame.altitude_amsl_m,
    ):
        return frame
    return LocalFrame(*origin) if all(map(math.isfinite, origin)) else None


def _yaw_stick(sticks: ManualControlSetpoint | None, now_us: int) -> float:
    """Yaw stick [-1 to 1] beyond its dead zone; 0 when the sticks are lost or absent."""
    if sticks is None or now_us - sticks.time_us > _STICKS_TIMEOUT_US:
        return 0.0
    beyond = max(abs(sticks.yaw) - _DEAD_ZONE, 0.0) / (1.0 - _DEAD_ZONE)
    return math.copysign(min(beyond, 1.0), sticks.yaw)


class Reporter:
    """Publishes progress, status and commands of the navigator on change."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics

    def report_flight(self, flight: Flight) -> None:
        """Publish the texts, commands and orbit status of this step."""
        for severity, text in flight.texts:
            self._topics.status_text.publish(StatusText(flight.now_us, severity, text))
        flight.texts.clear()
        for item in flight.home_commands:
            self._topics.vehicle_command.publish(_own_command(item, flight.now_us))
        flight.home_commands.clear()
        for item in flight.payload_commands:
            self._topics.payload_order.publish(_own_command(item, flight.now_us))
        flight.payload_commands.clear()
        for region in flight.regions:
            self._topics.region_of_interest.publish(region)
        flight.regions.clear()
        status, old = flight.orbit_status, self._topics.orbit_status.value
        if status is not None:
            self._topics.orbit_status.publish(status)
        elif old is not None and old.active:
            self._topics.orbit_status.publish(old._replace(time_us=flight.now_us, active=False))

    def report_progress(self, progress: MissionProgress) -> None:
        """Publish the progress of the mission on change."""
        old = self._topics.mission_progress.value
        if old is None or progress[1:] != old[1:]:
            self._topics.mission_progress.publish(progress)

    def report_status(self, status: NavigatorStatus) -> None:
        """Publish the state of the mode on change."""
        old = self._topics.navigator_status.value
        if old is None or status[1:] != old[1:]:
            self._topics.navigator_status.publish(status)


def _own_command(item: MissionItem, now_us: int) -> VehicleCommand:
    """An item as a command of the vehicle itself, which needs no acknowledgement."""
    return VehicleCommand(now_us, item.command, *item[5:12], item.frame, 0, 0, 0)
