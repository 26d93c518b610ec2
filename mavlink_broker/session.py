"""One vehicle's session: its link, its streams, the missions that wait for it, its reports.

Takes messages and work, gives effects; knows neither clock nor network. One mission flies at a
time; the next begins when the vehicle is down and disarmed, or hovers where a finished mission
of ours has left it.
"""

import logging
from collections import deque
from collections.abc import Callable, Collection, Iterable
from typing import Final

from afarcloud.enumerations import EventType, Status
from mavlink_broker.autopilots.families import MOST_ABLE
from mavlink_broker.edge.work import EventWork, MissionWork, StateVectorWork, Verdict
from mavlink_broker.effects import Acknowledgement, Effects, ForEdge
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.message_rates import StreamRequests
from mavlink_broker.mission.dropped_missions import DroppedMissions
from mavlink_broker.mission.event_execution import ENDED, REASONS
from mavlink_broker.mission.flight import RETURN_ENDED, Flight
from mavlink_broker.mission.pending_events import EventDesk, is_abort
from mavlink_broker.mission.restore_vehicle_config import GivingBack
from mavlink_broker.mission.states import BEFORE_TAKEOFF, State
from mavlink_broker.pictures.pictures import HEARD as PICTURED
from mavlink_broker.pictures.pictures import PictureDesk
from mavlink_broker.planning.geofence_check import check_flyable
from mavlink_broker.planning.mission import Home, RefusedError, translate
from mavlink_broker.recovery.record import Homeward, Memo
from mavlink_broker.vehicle import hover
from mavlink_broker.vehicle.alarms import AlarmWatch, Failure, mission_error
from mavlink_broker.vehicle.battery_capacity import BatterySize
from mavlink_broker.vehicle.control_authority import is_order
from mavlink_broker.vehicle.gcs_heartbeat import Attendance
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.telemetry_publisher import Bulletin
from mavlink_broker.vehicle.vehicle import Vehicle

OUT_OF_REACH_AFTER_S: Final = 5.0
"""Silence of a vehicle [s] after which its next mission begins, and fails if it stays silent.

One that a new broker has yet to hear may be flown by a pilot: its mission waits for him.
"""
FORGOTTEN_AFTER_S: Final = 60.0
NO_MISSION: Final = "no active mission"
PREPARATION: Final = BEFORE_TAKEOFF | {State.ATTACHING}
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
        observes: bool = False,
    ) -> None:
        """Look after a vehicle; `observes`: change nothing about it, and fetch nothing of it."""
        self._observes = observes
        self.vehicle = vehicle
        self._new_session_id = new_session_id
        self._reporter = Reporter(vehicle, new_session_id())
        self._bulletin = Bulletin(
            vehicle,
            self._reporter,
            state_vector_every_s=state_vector_every_s,
            observations_every_s=observations_every_s,
        )
        self.pictures = PictureDesk(vehicle, self._reporter)
        self._attendance = Attendance(vehicle, observes=observes)
        self._streams = StreamRequests(vehicle.route, vehicle.round_trip, observes=observes)
        self._battery_size = BatterySize(vehicle, battery_capacity_ah)
        self._alarms = AlarmWatch()
        self._giving_back = GivingBack(vehicle)
        self._events = EventDesk(vehicle)
        self._waiting: deque[Flight] = deque()
        self._dropped = DroppedMissions(vehicle)
        self._flight: Flight | None = None
        self._landing_of: str | None = None  # The mission behind which the vehicle comes down
        self._failed: Homeward | None = None  # In an earlier run
        self._has_flown = False  # Only the first mission can be one that an earlier run began
        self._was_lost = True
        self._lost_since: float | None = None
        self._homeless_since: float | None = None

    @property
    def state(self) -> State:
        """What the session is doing."""
        if self._flight is not None:
            return self._flight.state
        return State.LEAVING if self._events.is_leaving else State.IDLE

    def is_stranger(self, now: float) -> bool:
        """Whether a vehicle has told no more than that it is there, and is there no more."""
        is_idle = self._flight is None and not self._waiting and not self._events.is_waiting
        is_idle &= not self._dropped.are_open
        is_long_lost = self._lost_since is not None and now - self._lost_since > FORGOTTEN_AFTER_S
        return is_idle and is_long_lost and self.vehicle.snapshot.position is None

    def recall(self, memo: Memo, now: float, effects: Effects) -> None:
        """Take up what an earlier run of the broker has noted of the vehicle."""
        self.vehicle.recall(memo)
        self._failed = memo.homeward
        if self._flight is not None and not self._flight.work.was_accepted:
            self.vehicle.live = self.vehicle.started = None
        if memo.abort is not None:
            self._events.recall_abort(memo.abort)
        if memo.homeward is None:
            return
        self._events.recall(memo.homeward)
        flight = self._flight
        reason = None if flight is None else self._reason_to_fail(flight)
        if flight is not None and flight.is_sought and reason is not None:
            flight.fail_again(reason, now, effects)
            flight.answer_events(ENDED, effects)
            self._flight = None

    def change_vehicle(self) -> bool:
        """Leave what was noted of a vehicle to it, for another has taken its place.

        False while something is being flown.
        """
        if self.state is not State.IDLE or self.vehicle.snapshot.armed:
            return False
        self.vehicle.forget()
        return True

    def change_autopilot(self) -> None:
        """Learn that another component is the vehicle's autopilot: nothing said so far was its."""
        self.vehicle.is_identified = False
        self.vehicle.snapshot.forget()
        self._streams.route = self.vehicle.route
        self._streams.renew()
        self._attendance.renew()
        self._alarms.forget()

    @property
    def is_giving_back(self) -> bool:
        """Whether the vehicle is still to get what was its own before its last plan."""
        return self._giving_back.is_owed

    def take_mission(self, work: MissionWork, effects: Effects) -> None:
        """Line a mission up, or refuse one that cannot be flown.

        It is accepted when its turn comes: until then the edge server may cancel or change it, and
        it may hold the vehicle.

        A vehicle that has not told its kind yet may be one that takes everything: its own refusals
        wait until it has. A refusal's report goes out before the acknowledgement, which closes
        the work.
        """
        self._dropped.open(work.work_id)
        flight = Flight(work, self.vehicle, self._reporter)
        family = self.vehicle.family if self.vehicle.is_identified else MOST_ABLE
        try:
            translate(work.mission, family, Home(0.0, 0.0, 0.0))
            if not work.was_accepted:
                check_flyable(work.mission)
            flight.check_area(family)
        except RefusedError as error:
            flight.refuse(error, effects)
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", str(error)))
            return
        self._waiting.append(flight)

    def take_verdict(self, verdict: Verdict, now: float, effects: Effects) -> None:
        """Learn whether a mission that was accepted may be flown; one that may not is dropped."""
        if self._dropped.take_verdict(verdict, effects):
            return
        flights = (*self._waiting, self._flight)
        flight = next((f for f in flights if f and f.work.work_id == verdict.work_id), None)
        if flight is None or flight.is_confirmed:
            return
        flight.is_confirmed = verdict.holds
        if not verdict.holds:
            _LOG.warning(
                "vehicle %d: mission %d is not flown: %s",
                self.vehicle.vehicle_id,
                flight.work.mission.mission_id,
                verdict.reason or "the edge server has withdrawn it",
            )
        if not verdict.holds and flight is self._flight and self.state is not State.LEAVING:
            flight.withdraw(now, effects)
            self._close_flight(effects)
        elif not verdict.holds and flight is not self._flight:
            self._waiting.remove(flight)

    def break_off(self, reason: str, now: float, effects: Effects) -> None:
        """Fail the mission in which an unexpected error has occurred; those that wait stay.

        Every event that is not answered yet is refused: the error may have been its own.
        """
        self._events.refuse_all(reason, effects)
        if self._flight is not None:
            self._flight.break_off(reason, now, effects)
            self._close_flight(effects)

    def drop_mission(self, reason: str, now: float, effects: Effects) -> None:
        """Fail it without another look at it, because its end has raised an error too."""
        del now
        flight, self._flight = self._flight, None
        self._events.refuse_all(reason, effects)
        if flight is not None:
            flight.answer_events(reason, effects)
        if flight is not None and not flight.ledger.status.is_terminal:
            flight.ledger.fail(reason)
            effects.for_edge.append(self._reporter.mission(flight.ledger))

    def answer_state_vector(self, work: StateVectorWork, now: float, effects: Effects) -> bool:
        """Report the state at once; false when it is not known."""
        del work
        return self._bulletin.tell_state(now, effects)

    def take_event(self, work: EventWork, now: float, effects: Effects) -> None:
        """Carry out an event on what is flown, as soon as that is known.

        Raises:
            Exception: an unexpected error; the caller refuses the event then.
        """
        self._dropped.open(work.work_id)
        self._events.put(work)
        try:
            self._carry_out_events(now, effects)
        except Exception:
            self._events.forget(work.work_id)
            raise

    def _carry_out_events(self, now: float, effects: Effects) -> None:
        for work in self._events.take_due(self._is_too_early, now, effects):
            self._interrupt(work, now, effects)
            self._events.forget(work.work_id)

    def _is_too_early(self, work: EventWork) -> bool:
        """Whether it is still to be found out what an earlier run of the broker has begun."""
        if self._flight is not None:
            resumed = self._flight.is_looked_for
        else:
            resumed = bool(self._waiting) and self._is_resumed(self._waiting[0])
        is_unknown, is_open = self.vehicle.snapshot.armed is None, self.vehicle.diary.is_open
        if work.was_accepted and (is_unknown or not is_open):
            return True
        is_idle = self._flight is None and not self._waiting
        if is_abort(work) and is_idle and not is_open:
            return True  # The journal may hold an older one that the vehicle obeys
        if is_unknown:
            return resumed or (is_abort(work) and self._events.is_before(work.work_id))
        aborts_now = work.event.event_type_id is EventType.ABORT_MISSION
        return resumed and not aborts_now

    def _interrupt(self, work: EventWork, now: float, effects: Effects) -> None:
        """Interrupt what is flown."""
        first = self._waiting[0] if self._waiting else None
        if first is not None and self._is_resumed(first) and self._concerns(work, first):
            self._next_flight(now, effects)
        if is_abort(work):
            self._abort(work, now, effects)
        elif self._flight is not None and self._concerns(work, self._flight):
            self._flight.interrupt(work, now, effects)
            self._close_flight(effects)
        else:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", NO_MISSION))

    def _abort(self, work: EventWork, now: float, effects: Effects) -> None:
        """End what is flown, and what waits behind it; it replaces an older abort."""
        self.vehicle.abort = None  # Noted again where there is still something to be ordered
        replaces = self._events.replace(work, effects)
        concerned = [flight for flight in self._waiting if self._concerns(work, flight)]
        for flight in concerned:
            self._waiting.remove(flight)
            if flight.is_confirmed:
                flight.abort(REASONS[work.event.event_type_id], effects)
            else:
                self._dropped.drop(flight, work)
                effects.for_edge.append(Acknowledgement(flight.work.work_id, "accepted"))
        if self._may_be_dropped(work):
            concerned += self._drop_unconfirmed(work, now, effects)
        self._dropped.owe(work)
        if self._flight is not None and self._concerns(work, self._flight):
            self._flight.interrupt(work, now, effects)
            self._close_flight(effects)
        elif replaces or (work.was_accepted and not concerned):
            self._has_flown = True  # What waits was behind it, and has not begun
            self._events.see_through(work, now, effects, is_newer=replaces)
        elif concerned:
            if self._dropped.are_open and not work.was_accepted:
                effects.for_edge.append(Acknowledgement(work.work_id, "accepted"))
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))
        else:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", NO_MISSION))

    def _may_be_dropped(self, work: EventWork) -> bool:
        """Whether nothing has been ordered for the mission that is being prepared."""
        flight = self._flight
        if flight is None or flight.is_confirmed or self.vehicle.hovers:
            return False
        return self._concerns(work, flight)

    def _drop_unconfirmed(self, work: EventWork, now: float, effects: Effects) -> list[Flight]:
        """Stop preparing a mission whose acceptance has not been answered yet."""
        flight = self._flight
        if flight is None:
            return []
        self._dropped.drop(flight, work)
        flight.withdraw(now, effects)
        self._close_flight(effects)
        return [flight]

    def _concerns(self, work: EventWork, flight: Flight) -> bool:
        """Whether an event is about a mission; one from an earlier run, if that came before."""
        return not work.was_accepted or flight.work.work_id < work.work_id

    def _is_out_of_reach(self, now: float) -> bool:
        """Whether the vehicle is silent, and not just unheard since the broker has begun."""
        return self._lost_since is not None and now - self._lost_since >= OUT_OF_REACH_AFTER_S

    def _is_resumed(self, flight: Flight) -> bool:
        return flight.work.was_accepted and not self._has_flown

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Take a message of the vehicle's autopilot."""
        rebooted = self.vehicle.take(message, now)
        if rebooted:
            self._restarted(now, effects)
        effects.messages += self._streams.receive(message, now)
        self._attendance.receive(message)
        self._alarms.receive(message, now)
        if message.get_type() in PICTURED:
            self.pictures.receive(message, now, effects)
        self._battery_size.receive(message)
        effects.messages += self._events.receive(message, now)
        effects.messages += self._giving_back.receive(message, now)
        effects.messages += self.vehicle.parameters.receive(message, now)
        if self._flight is not None:
            self._flight.receive(message, now, effects)
            self._close_flight(effects)

    def permitted(self, messages: list[Message], now: float) -> list[Message]:
        """Leave out what must not be ordered now, whoever in here orders it.

        Everything, of a vehicle that somebody else has taken, or that may have been restarted
        while its link was away; what leads to a place, of one in the air without a position.
        """
        vehicle = self.vehicle
        if vehicle.is_taken or vehicle.may_be_restarted(now):
            return [message for message in messages if not is_order(message)]
        if vehicle.snapshot.lacks_position and vehicle.snapshot.armed:
            stands = vehicle.is_standing_armed
            leads = vehicle.family.leads_to_a_place
            return [message for message in messages if stands or not leads(message)]
        return messages

    def due(self, messages: list[ForEdge]) -> list[ForEdge]:
        """Hold back the answer to an abort until all that it ended is known to be over."""
        return self._dropped.sift(messages)

    def watch(self, asked_elsewhere: Collection[int] | None) -> None:
        """Learn that ground stations watch, and which messages they have asked for."""
        self._streams.watch(asked_elsewhere)

    def receive_payload(self, message: Message, now: float, effects: Effects) -> None:
        """Take a message of another component of the vehicle: its camera, its gimbal."""
        if message.get_type() == "HEARTBEAT":
            if message.type == mavlink.MAV_TYPE_CAMERA:
                self._alarms.camera_heard(now)
                self.pictures.camera_heard(source_of(message).component)
            return
        self._alarms.observe(message, now)
        self.vehicle.observations.take(message, self.vehicle.snapshot, now)
        if message.get_type() in PICTURED:
            self.pictures.receive(message, now, effects)
        if self._flight is not None:
            self._flight.receive(message, now, effects)
            self._close_flight(effects)

    def step(self, now: float, effects: Effects) -> None:
        """Let time pass."""
        self._watch_link(now)
        self._bulletin.update(self._mission_id, now, effects)
        if self.vehicle.is_heard(now):
            effects.messages += self._attendance.tick(now)
            effects.messages += self._streams.tick(now)
            self.vehicle.is_identified |= self._streams.is_version_settled
            effects.messages += self._battery_size.tick(now)
            hover.watch(self.vehicle)
            self._see_events_through(now, effects)
            effects.messages += self._keep_parameters(now)
            failures = self._alarms.tick(now, is_connected=self.vehicle.is_connected(now))
            self._raise_alarms(failures, now, effects)
        else:
            self._alarms.forget()
        effects.messages += self._giving_back.step(now, idle=self.state is State.IDLE)
        self._tell_landing(now, effects)
        self._next_flight(now, effects)
        if self._flight is not None:
            self._flight.step(now, effects)
        self._step_pictures(now, effects)
        self._close_flight(effects)
        self._bulletin.step(now, effects)

    def _see_events_through(self, now: float, effects: Effects) -> None:
        self._carry_out_events(now, effects)
        if self._events.take_broken_return():
            failure = mission_error(RETURN_ENDED)
            effects.for_edge.append(self._reporter.alarm(failure, None))
        was_leaving = self._events.is_leaving
        self._events.step(now, effects)
        if was_leaving and not self._events.is_leaving:
            self.vehicle.homeward = None
            self._note_hover(hovers=self._events.leaves_hovering)

    def _keep_parameters(self, now: float) -> list[Message]:
        """Set what the part of the mission that is flown has borrowed, give back the rest."""
        vehicle = self.vehicle
        if vehicle.is_taken:
            return []  # It gets them back when it stands
        may_be_needed = vehicle.parameters.is_recalled and not vehicle.snapshot.is_on_ground
        if self._flight is None and not may_be_needed:
            vehicle.parameters.want(())
        if self._flight is None and vehicle.snapshot.is_on_ground:
            vehicle.live = vehicle.started = None
        return vehicle.parameters.tick(
            now,
            vehicle.route,
            vehicle.round_trip,
            vehicle.parameter_encoding,
            lambda: vehicle.is_noted,
        )

    def _step_pictures(self, now: float, effects: Effects) -> None:
        flight = self._flight
        ledger = None if flight is None else flight.ledger
        self.pictures.watch(None if flight is None else flight.work, ledger, now)
        self.pictures.is_reachable = self.vehicle.is_heard(now)
        if self.pictures.is_reachable and not self._observes:
            self.pictures.step(now, effects, is_busy=self.state in PREPARATION)

    def _watch_link(self, now: float) -> None:
        """Ask for everything again when a vehicle is back that was lost; know it has a home."""
        is_heard = self.vehicle.is_heard(now)
        if is_heard and self._was_lost:
            self._streams.renew()
        self._was_lost = not is_heard
        self._lost_since = None if is_heard else (self._lost_since or now)
        self._homeless_since = self.vehicle.assume_home(now, self._homeless_since)

    def _raise_alarms(self, failures: Iterable[Failure], now: float, effects: Effects) -> None:
        """Tell what has failed; a mission that flies has failed with it."""
        for failure in failures:
            _LOG.warning("vehicle %d: %s", self.vehicle.vehicle_id, failure.text)
            parameters = self._alarms.take_parameters(now)
            effects.for_edge.append(self._reporter.alarm(failure, self._mission_id, parameters))
            if self._flight is not None:
                self._flight.alarm(failure.text, now, effects)

    def _restarted(self, now: float, effects: Effects) -> None:
        _LOG.warning("vehicle %d was restarted", self.vehicle.vehicle_id)
        self._reporter.session_id = self._new_session_id()
        hover.end(self.vehicle)
        self._streams.renew()
        self._attendance.renew()
        self._alarms.forget()
        self.pictures.restarted()
        self._events.restarted(effects)
        if self._flight is not None:
            self._flight.rebooted(now, effects)

    def _next_flight(self, now: float, effects: Effects) -> None:
        if self._flight is not None or not self._waiting:
            return
        flight = self._waiting[0]
        reason = self._reason_to_fail(flight)
        if reason is not None and self._is_resumed(flight):
            self._waiting.popleft().fail_again(reason, now, effects)
            return
        if self._events.is_before(flight.work.work_id) or self._dropped.are_open:
            return
        resumed = self._is_resumed(flight)
        free = self.vehicle.snapshot.is_on_ground or self.vehicle.hovers
        if resumed or free or self._is_out_of_reach(now):
            self._has_flown = True
            self._flight = self._waiting.popleft()
            if not self._flight.work.was_accepted:
                accepted = Acknowledgement(self._flight.work.work_id, "accepted")
                effects.for_edge.append(accepted)
            if not resumed:
                # They may have the names of what was flown before
                self.vehicle.live = self.vehicle.started = None
            self._flight.begin(now, effects, hovering=self.vehicle.hovers, resumed=resumed)
        elif flight.is_expired(now):
            self._waiting.popleft().abort("expired before take-off", effects)

    def _reason_to_fail(self, flight: Flight) -> str | None:
        """Why a mission has failed, as an earlier run has noted it."""
        failed = self._failed
        return failed.reason if failed and failed.mission == flight.work.name else None

    def _close_flight(self, effects: Effects) -> None:
        if self._flight is not None and self._flight.state is State.IDLE:
            self._flight.answer_events(ENDED, effects)
            self._note_hover(hovers=self._flight.leaves_hovering)
            self.vehicle.homeward = self.vehicle.live = self.vehicle.started = None
            if self._flight.has_failed_in_flight:
                self._landing_of = self._flight.work.name
            self._flight = None

    def _tell_landing(self, now: float, effects: Effects) -> None:
        """Say where a vehicle has come down whose mission was aborted or has failed."""
        if self._flight is not None:
            self._landing_of = None
        stands = self.vehicle.snapshot.is_on_ground and self.vehicle.is_connected(now)
        if self._landing_of is not None and stands:
            effects.for_edge += self._reporter.landing(f"{self._landing_of}/landing")
            self._landing_of = None

    def _note_hover(self, *, hovers: bool) -> None:
        if hovers:
            hover.begin(self.vehicle)
        else:
            hover.end(self.vehicle)

    @property
    def _mission_id(self) -> int | None:
        if self._flight is None or self._flight.ledger.status != Status.RUNNING:
            return None
        return self._flight.ledger.mission_id
