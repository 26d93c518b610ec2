"""One vehicle's session: what the broker does for it, with or without a mission.

    heartbeat   the broker's own to the vehicle, as companion or ground station
    streams     the messages that the vehicle is asked to send
    telemetry   its registration, state vectors and observations
    alarms      what has failed on it
    pictures    what its camera has taken
    logs        what it has written of its flights itself
    frames      what the frame log has of its flights
    missions    its missions and events (`mavlink_broker.mission.mission_queue`)
    overrides   its own parameters, geofence and rally points, restored behind a mission

Takes messages and work, gives effects; knows neither clock nor network.
"""

import logging
from collections.abc import Callable, Collection, Iterable
from typing import Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import (
    Effects,
    FramesNotSent,
    FramesSent,
    JobOutcome,
    LogJobDone,
    LogJobFailed,
)
from mavlink_broker.live.tracking import TrackingStop
from mavlink_broker.mavlink.dialect import Message, is_order, mavlink, source_of
from mavlink_broker.microservices.link_state import LOST_AFTER_S, AnswerMonitor, StateOrder
from mavlink_broker.microservices.log_download import LOG_MESSAGES
from mavlink_broker.microservices.message_rates import RATE_MESSAGES, StreamRequests
from mavlink_broker.microservices.parameter import PARAMETER_MESSAGES
from mavlink_broker.mission.context import REPLACED_VEHICLE, RESTARTED
from mavlink_broker.mission.geofence_transfer import VehicleConfigRestorer
from mavlink_broker.mission.mission_queue import MissionQueue
from mavlink_broker.mission.states import PREPARING, State
from mavlink_broker.pictures.collector import PICTURE_MESSAGES, PictureCollector
from mavlink_broker.vehicle.alarms import CAMERA, AlarmMonitor, Failure
from mavlink_broker.vehicle.flight_frames import FlightFrames
from mavlink_broker.vehicle.flight_logs import FlightLogs
from mavlink_broker.vehicle.gcs_heartbeat import GcsHeartbeat
from mavlink_broker.vehicle.reporter import (
    UPDATE_EVERY_S,
    BatteryCapacity,
    Reporter,
    TelemetryPublisher,
)
from mavlink_broker.vehicle.vehicle import Vehicle

UNREACHABLE_AFTER_S: Final = 5.0
"""Time since a link was lost [s] after which the next mission begins, and fails if it stays lost.

A vehicle that a new broker has yet to receive may be flown by a pilot: its mission waits for that.
"""
FORGOTTEN_AFTER_S: Final = 60.0
LONGEST_LOSS_S: Final = 1800.0
"""In flight; longer than a multicopter flies."""
UNANSWERED: Final = (
    "it is received but does not answer, so that orders may not reach it: the link may work in one "
    "direction only, or the vehicle has another signing key"
)
WAITS_FOR_LANDING: Final = (
    "a mission waits until it has landed: it is in the air, and not where this broker has left it"
)
EXCHANGING: Final = PREPARING | {State.ATTACHING}
"""States in which the link is kept free of pictures."""

_LOG = logging.getLogger(__name__)


class Session:
    """Everything the broker does for one vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        new_session_id: Callable[[], str],
        state_vector_every_s: float,
        observations_every_s: float,
        battery_capacity_ah: float,
        log_limit_bytes: int = 0,
        log_limit_s: float = 0.0,
        frames_limit_bytes: int = 0,
        observes: bool = False,
    ) -> None:
        """Begin a session; `observes`: change nothing on the vehicle, and fetch nothing of it.

        `frames_limit_bytes`: bound of what the frame log has of one flight; 0: it is not sent.
        """
        self._observes = observes
        self.vehicle = vehicle
        self._new_session_id = new_session_id
        self._reporter = Reporter(vehicle, new_session_id())
        self._telemetry = TelemetryPublisher(
            vehicle,
            self._reporter,
            state_vector_every_s=state_vector_every_s,
            observations_every_s=observations_every_s,
        )
        self.pictures = PictureCollector(vehicle, self._reporter)
        self.missions = MissionQueue(vehicle, self._reporter)
        self.logs = FlightLogs(
            vehicle, new_session_id, limit_bytes=log_limit_bytes, limit_s=log_limit_s
        )
        self._frames = FlightFrames(vehicle, new_session_id, limit_bytes=frames_limit_bytes)
        self._state_order = StateOrder()
        self._answers = AnswerMonitor(vehicle.route)
        self._was_unanswered = False
        self._heartbeat = GcsHeartbeat(vehicle, observes=observes)
        self._streams = StreamRequests(vehicle.route, vehicle.round_trip, observes=observes)
        self._battery_capacity = BatteryCapacity(vehicle, battery_capacity_ah)
        self._alarms = AlarmMonitor()
        self._config_restorer = VehicleConfigRestorer(vehicle)
        self._tracking_stop = TrackingStop(vehicle)
        self._was_lost, self._was_received = True, False
        self._identity_requests = 0  # Of the vehicle, that were sent on to it
        self._lost_since: float | None = None

    @property
    def state(self) -> State:
        """What the broker does for the vehicle's mission."""
        return self.missions.state

    @property
    def is_restoring(self) -> bool:
        """Whether the vehicle still has a geofence or parameters of its last plan."""
        return self._config_restorer.is_due

    @property
    def config_warning(self) -> str | None:
        """What an operator should know about its geofence and parameters; None if they are its own.

        Or if they will be soon.
        """
        return self._config_restorer.warning

    @property
    def link_warning(self) -> str | None:
        """What an operator should know about its link; None if it works in both directions."""
        return UNANSWERED if self._answers.is_unanswered else None

    @property
    def waiting_warning(self) -> str | None:
        """What an operator should know while a mission waits for a vehicle that flies without it.

        Nothing of that is reported: the mission is accepted when its turn comes.
        """
        vehicle, missions = self.vehicle, self.missions
        waits = not missions.is_flying and not missions.is_idle
        is_known = vehicle.is_identified and vehicle.recovery.tracker.is_loaded
        is_in_air = bool(vehicle.snapshot.armed) and not vehicle.snapshot.is_on_ground
        may_hover = vehicle.hovers or vehicle.recovery.hover.is_sought
        is_away = is_known and is_in_air and not may_hover
        return WAITS_FOR_LANDING if waits and is_away else None

    def is_stranger(self, now: float) -> bool:
        """Whether a vehicle has sent no more than a heartbeat, and sends nothing any more."""
        is_long_lost = self._lost_since is not None and now - self._lost_since > FORGOTTEN_AFTER_S
        return self.missions.is_empty and is_long_lost and self.vehicle.snapshot.position is None

    def may_fly(self, now: float) -> bool:
        """Whether its vehicle is armed as far as is known: not if it has been lost for long."""
        lost_s = 0.0 if self._lost_since is None else now - self._lost_since
        return bool(self.vehicle.snapshot.armed) and lost_s <= LONGEST_LOSS_S

    def change_vehicle(self) -> bool:
        """Forget what was noted of a vehicle, for another has taken its place.

        False while it is armed, or while a mission is on it.
        """
        has_nothing = self.state in {State.IDLE, State.ATTACHING, State.WAITING}
        if not has_nothing or self.vehicle.snapshot.armed:
            return False
        self.vehicle.recovery.forget()
        self.logs.forget()
        return True

    def change_autopilot(self, component: int) -> None:
        """Address a component as the vehicle's autopilot, and forget what another one sent."""
        self.vehicle.change_autopilot(component)
        self._streams.route = self.vehicle.route
        self._streams.renew()
        self._answers = AnswerMonitor(self.vehicle.route)
        self._heartbeat.renew()
        self._alarms.forget()

    def publish_state(self, now: float, effects: Effects) -> bool:
        """Publish the state vector at once; false when it is not known."""
        return self._telemetry.publish_state(now, effects)

    def watch(self, requested_by_gcs: Collection[int] | None) -> None:
        """Follow which messages ground stations have asked for; None without any."""
        self._streams.watch(requested_by_gcs)

    def permitted(self, messages: list[Message], now: float) -> list[Message]:
        """Leave out what must not be ordered now, whichever part of the session orders it.

        Every order, to a vehicle that another system has taken, or that may have restarted while
        its link was away; what leads to a place, to one in the air without a position.
        """
        vehicle = self.vehicle
        if vehicle.armed_period.is_taken or vehicle.may_be_restarted(now):
            return [message for message in messages if not is_order(message)]
        if vehicle.snapshot.lacks_position and vehicle.snapshot.armed:
            on_ground = vehicle.is_standing_armed
            leads = vehicle.family.needs_position
            return [message for message in messages if on_ground or not leads(message)]
        return messages

    # Messages

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle's autopilot."""
        if self._state_order.is_overtaken(message, now):
            return
        kind = message.get_type()
        if kind == "AUTOPILOT_VERSION" and self.vehicle.is_swapped_for(message):
            self.vehicle_replaced(now, effects)
        if self.vehicle.take(message, now):
            self._vehicle_restarted(now, effects)
        self._answers.receive(message)
        if kind in RATE_MESSAGES:
            effects.messages += self._streams.receive(message, now)
            effects.messages += self._tracking_stop.receive(message, now)
        self._alarms.receive(message, now)
        if kind in PICTURE_MESSAGES:
            self.pictures.receive(message, now, effects)
        if kind in LOG_MESSAGES:
            self.logs.receive(message, now, effects)
        if kind == "STATUSTEXT":
            self._heartbeat.receive_text(message.text)
        if kind in PARAMETER_MESSAGES:
            self._receive_parameter(message, now, effects)
        if self._config_restorer.transfer is not None:
            effects.messages += self._config_restorer.transfer.receive(message, now)
        self.missions.receive(message, now, effects)

    def _receive_parameter(self, message: Message, now: float, effects: Effects) -> None:
        self._heartbeat.receive(message)
        self._battery_capacity.receive(message)
        if self.vehicle.is_identified:  # Else it may be the loan of another one
            effects.messages += self.vehicle.parameters.receive(message, now)

    def receive_payload(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of another component of the vehicle: its camera, its gimbal."""
        if message.get_type() == "HEARTBEAT":
            if message.type == mavlink.MAV_TYPE_CAMERA:
                self._alarms.camera_received(now)
                is_known = self.missions.is_flying and self._alarms.expects_camera
                self.vehicle.recovery.has_camera |= is_known
                self.pictures.add_camera(source_of(message).component)
            return
        self._alarms.observe(message, now)
        self.vehicle.observations.take(message, self.vehicle.snapshot, now)
        effects.messages += self._tracking_stop.receive(message, now)
        if message.get_type() in PICTURE_MESSAGES:
            self.pictures.receive(message, now, effects)
        self.missions.receive_payload(message, now, effects)

    def _vehicle_restarted(self, now: float, effects: Effects) -> None:
        """Begin anew with a vehicle; what it was ordered since its restart goes on."""
        is_old = self.vehicle.was_ordered_since_boot
        when = " before it was armed" if is_old else ""
        _LOG.warning("vehicle %d was restarted%s", self.vehicle.vehicle_id, when)
        self._request_anew()
        self.logs.restarted()
        if not is_old:
            self.vehicle.ask_identity()
            self._end_orders(RESTARTED, now, effects)

    def vehicle_replaced(self, now: float, effects: Effects) -> None:
        """Begin anew with another vehicle that has the system id: nothing of before goes on."""
        _LOG.warning("vehicle %d: another one has its system id", self.vehicle.vehicle_id)
        self.vehicle.replace()
        self._request_anew()
        self.logs.forget()  # The other one has logs of its own
        self._end_orders(REPLACED_VEHICLE, now, effects)

    def _request_anew(self) -> None:
        """Begin a new session of telemetry with a vehicle that knows of no request any more."""
        self._reporter.session_id = self._new_session_id()
        self._streams.renew()
        self._heartbeat.renew()
        self._alarms.forget()
        self.vehicle.recovery.healthy = ()
        self.pictures.restarted()

    def _end_orders(self, reason: str, now: float, effects: Effects) -> None:
        """End what the vehicle was ordered: it flies nothing of that any more."""
        self.vehicle.set_hovering(hovers=False)
        self.vehicle.own_descent.end()
        self.vehicle.recovery.lost_mission.end()
        self.missions.vehicle_restarted(reason, now, effects)

    def take_outcome(self, outcome: JobOutcome, now: float, effects: Effects) -> None:
        """Process the outcome of a job."""
        if isinstance(outcome, LogJobDone | LogJobFailed):
            self.logs.take_outcome(outcome, now, effects)
        elif isinstance(outcome, FramesSent | FramesNotSent):
            self._frames.take_outcome(outcome, now)
        else:
            self.pictures.take_outcome(outcome, now, effects)

    def set_update_interval(self, every_s: float | None) -> None:
        """Update the vehicle on the edge server at an interval [s]; None: the usual one."""
        self._telemetry.update_every_s = UPDATE_EVERY_S if every_s is None else every_s

    # Time

    def step(self, now: float, effects: Effects) -> None:
        """Do what is due at a time."""
        vehicle = self.vehicle
        self._observe_link(now)
        self._telemetry.update(self.missions.running_mission_id, now, effects)
        if vehicle.is_reachable(now):
            effects.messages += self._heartbeat.tick(now)
            effects.messages += self._ask_for_answer(now)
            if self._identity_requests != vehicle.identity_requests:
                self._identity_requests = vehicle.identity_requests
                self._streams.ask_version()
            effects.messages += self._streams.tick(now)
            if self._streams.is_version_settled:
                vehicle.identify(has_answered=self._streams.is_answered)
            effects.messages += self._battery_capacity.tick(now)
            vehicle.update_hover(now, is_ordered=self.state is not State.IDLE)
            vehicle.update_descent(now)
            self._follow_lost_mission()
            self.missions.tick_events(now, effects)
            effects.messages += self._override_parameters(now)
            effects.messages += self._stop_tracking(now)
            self._expect_camera(now)
            self._expect_health(now)
            failures = self._alarms.tick(now, is_connected=vehicle.is_connected(now))
            self._raise_alarms(failures, now, effects)
        else:
            self._alarms.forget()
            self.missions.refuse_expired_events(now, effects)
        is_known = vehicle.is_identified and vehicle.are_capabilities_known
        is_idle = self.state is State.IDLE and is_known
        effects.messages += self._config_restorer.step(now, idle=is_idle)
        lost_since = self._lost_since
        is_unreachable = lost_since is not None and now - lost_since >= UNREACHABLE_AFTER_S
        self.missions.tick(now, effects, is_unreachable=is_unreachable)
        self._tick_pictures(now, effects)
        self.logs.step(now, effects, may_fetch=self._may_fetch_logs(now))
        self._frames.step(now, self.logs.utc, effects)
        if vehicle.snapshot.armed is False:
            vehicle.recovery.armed_s = None  # Both have noted the flight
        self.missions.close_ended(effects)
        self._telemetry.tick(now, effects)

    def _follow_lost_mission(self) -> None:
        """Follow what an earlier run has begun, unless its mission is known or an abort ends it."""
        vehicle, lost = self.vehicle, self.vehicle.recovery.lost_mission
        if not (lost.is_sought or lost.is_flown):
            return
        if self.missions.is_flying:
            lost.end()
        elif self.state is State.IDLE:
            was_flown = lost.is_flown
            lost.update(
                vehicle.observed_mode,
                vehicle.snapshot,
                paused_mode=vehicle.family.paused_mode,
                is_paused=vehicle.recovery.paused is not None,
                was_taken=vehicle.armed_period.noted_mode is not None,
            )
            if lost.is_flown:
                vehicle.armed_period.claim()
            elif was_flown and vehicle.mode_role is not ModeRole.ENDING:
                vehicle.armed_period.lose()  # Its mission may end with a return or a landing

    def _observe_link(self, now: float) -> None:
        """Request all streams again when a lost link is back; keep a home position."""
        is_reachable = self.vehicle.is_reachable(now)
        if is_reachable and self._was_lost:
            self._streams.renew()
            silent_since = (self._lost_since or now) - LOST_AFTER_S
            unanswered_s = self._answers.unanswered_s(silent_since)
            self._answers = AnswerMonitor(self.vehicle.route, unanswered_s)
            if self._lost_since is not None and self._was_received:
                _LOG.info(
                    "vehicle %d: its link is back after %.0f s",
                    self.vehicle.vehicle_id,
                    now - self._lost_since,
                )
        elif not is_reachable and not self._was_lost:
            _LOG.warning(
                "vehicle %d: its link is lost, no heartbeat for %.0f s",
                self.vehicle.vehicle_id,
                LOST_AFTER_S,
            )
        self._was_received |= is_reachable
        self._was_lost = not is_reachable
        self._lost_since = None if is_reachable else (self._lost_since or now)
        self.vehicle.snapshot.assume_home(now, is_received=is_reachable)

    def _ask_for_answer(self, now: float) -> list[Message]:
        """Follow whether the vehicle answers while it is received."""
        if self._observes or not self.vehicle.is_connected(now):
            return []
        messages = self._answers.tick(now)
        before, self._was_unanswered = self._was_unanswered, self._answers.is_unanswered
        if self._was_unanswered and not before:
            _LOG.warning("vehicle %d: %s", self.vehicle.vehicle_id, UNANSWERED)
        elif before and not self._was_unanswered:
            _LOG.info("vehicle %d: it answers again", self.vehicle.vehicle_id)
        return messages

    def _override_parameters(self, now: float) -> list[Message]:
        """Set the parameters that the segment in flight needs, restore the others."""
        vehicle = self.vehicle
        if vehicle.armed_period.is_taken or not vehicle.is_identified:
            return []  # They are restored when it has landed, if they are its own
        is_flying = self.missions.is_flying
        may_be_needed = vehicle.parameters.is_loaded and not vehicle.snapshot.is_on_ground
        if not is_flying and not may_be_needed:
            vehicle.parameters.set_overrides(())
        if not is_flying and vehicle.snapshot.is_on_ground:
            vehicle.recovery.clear_commands()
        return vehicle.parameters.tick(
            now,
            vehicle.route,
            vehicle.round_trip,
            vehicle.parameter_encoding,
            lambda: vehicle.recovery.is_stored,
        )

    def _stop_tracking(self, now: float) -> list[Message]:
        """Have the camera stop tracking what no command follows; not while another system flies."""
        vehicle, missions = self.vehicle, self.missions
        if vehicle.armed_period.is_taken or not vehicle.is_identified or self._observes:
            return []
        is_in_air = not vehicle.snapshot.is_on_ground
        may_go_on = vehicle.recovery.may_resume_tracking and not missions.is_flying and is_in_air
        return self._tracking_stop.tick(now, is_wanted=missions.tracks or may_go_on)

    def _expect_camera(self, now: float) -> None:
        """Expect the camera of this flight, also behind a restart of the broker, or a lost link."""
        recovery = self.vehicle.recovery
        if not self.missions.is_flying and self.vehicle.snapshot.is_on_ground:
            recovery.has_camera = False
        if recovery.has_camera:
            self._alarms.expect_camera(now)

    def _expect_health(self, now: float) -> None:
        """Expect what was healthy in this flight, also behind a restart of the broker.

        A part that has failed meanwhile may have ended the flight: it is expected once more.
        """
        vehicle, recovery = self.vehicle, self.vehicle.recovery
        is_known = recovery.tracker.is_loaded and not vehicle.may_be_restarted(now)
        if vehicle.snapshot.armed is None or not is_known:
            return
        if vehicle.snapshot.armed:
            self._alarms.expect_healthy(recovery.healthy)
            recovery.healthy = self._alarms.healthy
        elif recovery.healthy:
            time_s, armed_s = vehicle.snapshot.time_s, recovery.armed_s
            was_off = time_s is not None and armed_s is not None and time_s < armed_s
            if vehicle.armed_period.has_ended_unseen and not was_off:
                self._alarms.expect_healthy(recovery.healthy)
            recovery.healthy = ()

    def _raise_alarms(self, failures: Iterable[Failure], now: float, effects: Effects) -> None:
        """Report what has failed; a mission in flight fails with it."""
        for failure in failures:
            _LOG.warning("vehicle %d: %s", self.vehicle.vehicle_id, failure.text)
            parameters = self._alarms.take_parameters(now)
            mission_id = self.missions.running_mission_id
            effects.for_edge.append(self._reporter.alarm(failure, mission_id, parameters))
            self.missions.raise_alarm(failure.text, now, effects)
            self.vehicle.recovery.has_camera &= failure != CAMERA  # It is raised once

    def _tick_pictures(self, now: float, effects: Effects) -> None:
        is_followed = self.state is not State.ATTACHING
        missions = self.missions
        self.pictures.update_mission(missions.work, missions.ledger, now, is_followed=is_followed)
        self.pictures.is_reachable = self.vehicle.is_reachable(now)
        if self.pictures.is_reachable and not self._observes:
            self.pictures.step(now, effects, is_busy=self.state in EXCHANGING)

    def _may_fetch_logs(self, now: float) -> bool:
        """Whether nothing is to be done on the vehicle that matters more than its logs."""
        is_free = self.state is State.IDLE and self.missions.is_empty and not self._observes
        is_parked = self.vehicle.snapshot.armed is False and self.vehicle.is_connected(now)
        has_time = not self.pictures.is_fetching and self._config_restorer.transfer is None
        return is_free and is_parked and has_time
