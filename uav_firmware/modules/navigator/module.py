"""Shell of the navigator: topics in, one mode at a time, set-point and progress out."""

import math
from collections.abc import Sequence
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.resets import ResetFollower
from uav_firmware.lib.stepwise import finished
from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.geofence import area
from uav_firmware.modules.navigator.geofence.area import AreaKeeper
from uav_firmware.modules.navigator.geofence.monitor import GeofenceWatch
from uav_firmware.modules.navigator.mission import feasibility
from uav_firmware.modules.navigator.mission.mission_mode import MissionMode
from uav_firmware.modules.navigator.mission.review import MissionReview
from uav_firmware.modules.navigator.modes.follow import FollowMode
from uav_firmware.modules.navigator.modes.heading_commands import (
    take_heading,
    take_region_of_interest,
)
from uav_firmware.modules.navigator.modes.loiter import LoiterMode
from uav_firmware.modules.navigator.modes.mode import NavigatorMode
from uav_firmware.modules.navigator.modes.orbit_mode import OrbitMode
from uav_firmware.modules.navigator.modes.single_manoeuvre_modes import (
    LandMode,
    ReturnMode,
    TakeoffMode,
)
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.modules.navigator.reports import Reporter, ReportTopics
from uav_firmware.modules.navigator.surroundings import ceiling, frame_of, tilt_max, yaw_of
from uav_firmware.msg.control_mode import (
    ControlSource,
    ManualControlSetpoint,
    VehicleControlMode,
)
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import Fence, FenceBreach, GeofenceStatus, RallyPoints
from uav_firmware.msg.guidance import (
    FollowOrder,
    FollowTarget,
    HeadingRequest,
    OrbitStatus,
    OrbitTarget,
    RegionOfInterest,
)
from uav_firmware.msg.mission import (
    FenceSwitch,
    Mission,
    MissionCurrentRequest,
    MissionItem,
    MissionProgress,
    MissionRejection,
    ModeTarget,
    NavigatorRequest,
    NavigatorStatus,
    NavigatorTarget,
    PlanReview,
    SpeedRequest,
)
from uav_firmware.msg.payload import PayloadOrder
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import (
    HomePosition,
    LandDetected,
    NavigationState,
    StatusText,
    VehicleCommand,
    VehicleStatus,
)
from uav_firmware.parameters import Registry

PERIOD_US: Final = 8_000  # [us] 125 Hz: at 12 m/s the set-point moves 0.1 m a step
_WARNING: Final = 4  # MAV_SEVERITY
_LONGEST_STEP_S: Final = 0.1  # [s] a longer gap does not make the set-point jump


class NavigatorModule:
    """Flies the mode that commander has chosen.

    Declares `NavigatorParams` in the registry.
    """

    def __init__(
        self,
        registry: Registry,
        *,
        vehicle_local_position: Topic[VehicleLocalPosition],
        vehicle_status: Topic[VehicleStatus],
        land_detected: Topic[LandDetected],
        home_position: Topic[HomePosition],
        mission: Topic[Mission],
        navigator_request: Queue[NavigatorRequest],
        trajectory_setpoint: Topic[TrajectorySetpoint],
        mission_progress: Topic[MissionProgress],
        navigator_status: Topic[NavigatorStatus],
        orbit_status: Topic[OrbitStatus],
        fence: Topic[Fence],
        rally_points: Topic[RallyPoints],
        geofence_status: Topic[GeofenceStatus],
        follow_target: Topic[FollowTarget],
        status_text: Queue[StatusText],
        vehicle_command: Queue[VehicleCommand],
        payload_order: Queue[PayloadOrder] | None = None,
        region_of_interest: Topic[RegionOfInterest] | None = None,
        vehicle_control_mode: Topic[VehicleControlMode] | None = None,
        failure_detector_status: Topic[FailureDetectorStatus] | None = None,
        manual_control_setpoint: Topic[ManualControlSetpoint] | None = None,
    ) -> None:
        registry.add(NavigatorParams)
        self._registry = registry
        self._local_position = vehicle_local_position
        self._vehicle_status = vehicle_status
        self._land_detected = land_detected
        self._home_position = home_position
        self._mission_topic = mission
        self._requests = navigator_request
        self._setpoint = trajectory_setpoint
        self._reporter = Reporter(
            ReportTopics(
                mission_progress,
                navigator_status,
                orbit_status,
                status_text,
                vehicle_command,
                Queue() if payload_order is None else payload_order,
                Topic() if region_of_interest is None else region_of_interest,
            )
        )
        self._area = AreaKeeper(fence, rally_points)
        self._fence_watch = GeofenceWatch()
        self._fence_status = geofence_status
        self._judged_by = 0  # Version of the area by which the present mode was let in
        self._control_mode = vehicle_control_mode
        self._failure_status = failure_detector_status
        self._sticks = manual_control_setpoint
        self._params_version: int | None = None
        self._flight = Flight(registry.read(NavigatorParams))
        self._mission = MissionMode()
        self._hold = LoiterMode()
        self._follow_mode = FollowMode(follow_target)
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
        self._review = MissionReview()
        self._mission_count = 0
        self._last_us: int | None = None
        self._resets = ResetFollower()

    def check_item(self, item: MissionItem) -> MissionRejection | None:
        """Whether an item could be flown in any mission; for its upload."""
        return feasibility.check_item(item, self._flight.home, self._flight.params)

    def check_mission(self, items: Sequence[MissionItem]) -> MissionRejection | None:
        """Whether items could be flown from the present home."""
        return finished(self.review_mission(items))

    def review_mission(self, items: Sequence[MissionItem]) -> PlanReview:
        """Judge as `check_mission`, little by little; for the mission's upload."""
        self._area.update(self._flight)  # A fence may have come together with the mission
        circumstances = self._circumstances
        rejection = yield from self._judge(items)
        if rejection is None:
            self._review.trust(items, circumstances)
        return rejection

    def review_rally_points(self, items: Sequence[MissionItem]) -> PlanReview:
        """Judge whether items are rally points that a return may lead to; for their upload."""
        self._area.update(self._flight)
        return (yield from area.review_rally_points(items, self._flight))

    def refusal_of(self, target: ModeTarget) -> str | None:
        """Why the geofence forbids an order; None when it does not. For the commander."""
        self._area.update(self._flight)  # A fence may have come or gone together with the order
        return area.refusal_of(target, self._flight)

    def update(self, now_us: int) -> None:
        """Run a step if one is due."""
        if self._last_us is None:
            self._last_us = now_us
        elapsed_us = now_us - self._last_us
        if 0 < elapsed_us < PERIOD_US:
            return
        self._last_us = now_us
        self._observe(now_us)
        self._take_mission()
        self._take_requests()
        self._choose_mode()
        self._watch_fence()
        self._fly(min(elapsed_us * 1e-6, _LONGEST_STEP_S))
        self._report(now_us)

    def _observe(self, now_us: int) -> None:
        flight = self._flight
        flight.now_us = now_us
        if self._params_version != self._registry.version:
            self._params_version = self._registry.version
            flight.params = self._registry.read(NavigatorParams)
            flight.ceiling = ceiling(self._registry)
            flight.tilt_max = tilt_max(self._registry)
        estimate = self._local_position.value
        flight.estimate = estimate
        flight.home = self._home_position.value
        land = self._land_detected.value
        flight.landed = land is None or land.landed
        failure = None if self._failure_status is None else self._failure_status.value
        flight.motor_lost = failure is not None and failure.failed_motors != 0
        if estimate is not None:
            flight.frame = frame_of(estimate, flight.frame)
            self._follow_resets(estimate)
        sticks = None if self._sticks is None else self._sticks.value
        flight.yaw_stick = yaw_of(sticks, now_us)
        self._area.update(flight)

    def _follow_resets(self, estimate: VehicleLocalPosition) -> None:
        """Move the set-point with an estimate that was reset."""
        step = self._resets.take(estimate.resets)
        if step is None:
            return
        self._flight.shift(step)
        if self._active is not None:
            self._active.on_reset(self._flight, step)

    def _take_mission(self) -> None:
        mission = self._mission_topic.value
        if mission is not None and self._mission_count != self._mission_topic.count:
            self._mission_count = self._mission_topic.count
            self._mission.load(mission)
            self._restart_mission()
        items = self._mission.cursor.items
        if reason := self._review.update(items, self._circumstances, self._judge):
            self._flight.say(_WARNING, f"Mission cannot be flown: {reason}")

    @property
    def _circumstances(self) -> tuple[int, int]:
        return (self._home_position.count, self._area.version)  # They change with either

    def _judge(self, items: Sequence[MissionItem]) -> PlanReview:
        home, params = self._flight.home, self._flight.params
        rejection = yield from feasibility.review(items, home, params)
        return rejection or (yield from area.review_mission(items, self._flight))

    def _restart_mission(self) -> None:
        if self._active is self._mission:
            self._mission.on_activation(self._flight, None)

    def _take_requests(self) -> None:
        for request in self._requests.drain():
            match request:
                case NavigatorTarget() | OrbitTarget() | FollowOrder():
                    self._target = request
                case SpeedRequest():
                    flight = self._flight
                    flight.speeds = flight.speeds.with_change(request.speed_type, request.speed_m_s)
                    if self._active is not None:
                        self._active.on_speeds(flight)
                case RegionOfInterest():
                    take_region_of_interest(self._flight, request)
                case FenceSwitch(enabled=enabled):
                    self._flight.switch_fence(enabled=enabled)
                case HeadingRequest():
                    take_heading(self._flight, request)
                case MissionCurrentRequest():
                    if self._mission.select(request.seq, reset=request.reset):
                        self._restart_mission()

    def _choose_mode(self) -> None:
        """Leave and enter modes; a target that came with none of them is forgotten."""
        status = self._vehicle_status.value
        armed = status is not None and status.armed and self._leads
        if status is not None:
            self._area.follow_arming(self._flight, armed=status.armed)
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
            self._enter(mode)
            self._judged_by = self._area.version
            mode.on_activation(self._flight, own)

    @property
    def _leads(self) -> bool:
        """Whether the navigator writes the set-point, not sticks or a stream from outside."""
        control = None if self._control_mode is None else self._control_mode.value
        return control is None or control.source is ControlSource.NAVIGATOR

    def _enter(self, mode: NavigatorMode | None) -> None:
        if self._active is not None and mode is not self._active:
            self._active.on_inactivation(self._flight)
        if mode is not self._active:
            self._flight.speeds = Speeds()
        self._active = mode

    def _on_judged_route(self) -> bool:
        """Whether the way flown has been held against the present fence."""
        if self._active is self._mission:
            return self._review.rejection is None
        if self._active is self._follow_mode:
            return False
        return self._active is not None and self._judged_by == self._area.version

    def _watch_fence(self) -> None:
        flight = self._flight
        status = self._fence_watch.update(flight, on_route=self._on_judged_route())
        if status is not None:
            flight.breached = status.breach is not FenceBreach.NONE
            self._fence_status.publish(status)

    def _fly(self, dt: float) -> None:
        flight, mode = self._flight, self._active
        flight.orbit_status = None
        if mode is not None:
            mode.on_active(flight)
        if flight.estimate is None:
            return
        if not self._leads:
            flight.restart()  # so that the next mode begins from the motion it takes over
            return
        sits = mode is None or mode.sits(flight)
        self._setpoint.publish(flight.idle() if sits else flight.advance(dt))

    def _report(self, now_us: int) -> None:
        self._reporter.report_flight(self._flight)
        self._reporter.report_progress(
            self._mission.cursor.progress(now_us, active=self._active is self._mission)
        )
        vehicle = self._vehicle_status.value
        if vehicle is not None:
            done = self._active is not None and self._active.finished
            self._reporter.report_status(
                NavigatorStatus(now_us, vehicle.navigation_state, done, self._review.rejection)
            )
