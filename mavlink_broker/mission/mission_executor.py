"""One mission on one vehicle, from the work item to its terminal report.

Drives the table of `mavlink_broker.mission.states`: the phase of the present state (`phases`) gets
the vehicle's messages and the time, and returns what follows. What comes from outside at any time
is handled here: events, alarms, restarts of the vehicle, unexpected errors. Knows neither clock nor
network.
"""

import logging
from typing import Final

from afarcloud.enumerations import EventType, Status
from mavlink_broker.autopilots.families import Family
from mavlink_broker.edge.wire import EventWork, MissionWork
from mavlink_broker.effects import Effects
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.abort_executor import REASONS, note_on_ground, return_event
from mavlink_broker.mission.context import MissionContext, SegmentMonitors
from mavlink_broker.mission.flight_orders import FLIES_NO_COMMAND, MISSION_ENDED, REPLACED
from mavlink_broker.mission.phases.attaching import Attaching
from mavlink_broker.mission.phases.ending import Aborting, Failing
from mavlink_broker.mission.phases.in_flight import FlyingLive, Running
from mavlink_broker.mission.phases.phase import Fault, Idle, Phase, Request, Result
from mavlink_broker.mission.phases.preparing import (
    Arming,
    Holding,
    PlacingGeofence,
    Selecting,
    Starting,
    Uploading,
    Verifying,
)
from mavlink_broker.mission.phases.waiting import Waiting
from mavlink_broker.mission.states import (
    ARMED_BY_BROKER,
    ASKING,
    ENDING,
    IN_FLIGHT,
    PREPARING,
    READING,
    TRANSFERRING,
    UPLOADED,
    Event,
    State,
    follow,
)
from mavlink_broker.planning.situation import RefusedError
from mavlink_broker.vehicle.control_authority import DISARMED, Authority
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

MOST_LINK_LOSSES: Final = 5
"""How often a mission attaches again after its link was away in a state that needs answers."""

_LOG = logging.getLogger(__name__)


class MissionExecutor:
    """One mission."""

    def __init__(self, work: MissionWork, vehicle: Vehicle, reporter: Reporter) -> None:
        self._context = context = MissionContext(work, vehicle, reporter)
        self._vehicle = vehicle
        self.state = State.IDLE
        self.work = work
        """The work item of the edge server."""
        self.ledger = context.ledger
        """The statuses of the mission and its commands."""
        self._link_losses = 0  # While the vehicle's answer was needed
        self._attaching = Attaching(context)
        self._geofence = PlacingGeofence(context)
        self._running = Running(context)
        self._flying_live = FlyingLive(context)
        self._aborting = Aborting(context)
        self._failing = Failing(context)
        uploading = Uploading(context)
        self._phases: dict[State, Phase] = {
            State.IDLE: Idle(context),
            State.ATTACHING: self._attaching,
            State.WAITING: Waiting(context),
            State.PLACING_GEOFENCE: self._geofence,
            State.HOLDING: Holding(context),
            State.UPLOADING: uploading,
            State.VERIFYING: Verifying(context, uploading),
            State.SELECTING: Selecting(context),
            State.ARMING: Arming(context),
            State.STARTING: Starting(context),
            State.RUNNING: self._running,
            State.FLYING_LIVE: self._flying_live,
            State.ABORTING: self._aborting,
            State.FAILING: self._failing,
        }

    @property
    def is_confirmed(self) -> bool:
        """Whether the edge server has confirmed that this broker flies it."""
        return self._context.is_confirmed

    @property
    def tracks(self) -> bool:
        """Whether the camera tracks a subject for it, or may do so."""
        return self._flying_live.tracks or self.is_attaching

    @property
    def is_attaching(self) -> bool:
        """Whether the effect on the vehicle is not known yet."""
        return self.state is State.ATTACHING

    @property
    def is_flight_unknown(self) -> bool:
        """Whether it was reported as running, and its state on the vehicle is not known yet."""
        return self.is_attaching and self._context.was_reported_running

    def is_progress_unknown(self, now: float) -> bool:
        """Whether it flies by an order of before, and may show soon how far it has come."""
        return self._phase.is_progress_unknown(now)

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle hovers afterwards: at the end, or still where it did before.

        Also where a mission has failed, unless another system has the vehicle.
        """
        context, segments = self._context, self._context.segments
        after_abort = self._aborting.leaves_hovering
        if after_abort is not None:
            return after_abort
        if self.ledger.status == Status.FINISHED and segments.has_moved:
            return not segments.ends_on_ground
        if self.has_failed_in_flight:
            return self._failing.leaves_hovering
        return context.is_hovering and not context.is_start_ordered

    @property
    def sends_down(self) -> bool:
        """Whether the vehicle returns or lands by order of an event or an alarm at its end."""
        return self._aborting.sends_down

    @property
    def has_failed_in_flight(self) -> bool:
        """Whether it was flown, and did not finish."""
        was_flown = self._context.is_start_ordered or self._context.was_running
        return was_flown and self.ledger.status in {Status.FAILED, Status.ABORTED}

    def is_expired(self, now: float) -> bool:
        """Whether it may not begin any more."""
        return self._context.is_expired(now)

    # Before it begins

    def check_area(self, family: Family) -> None:
        """Check a mission against its geofence before anything is known of its vehicle.

        One that an earlier run of the broker accepted may be flying: it is not checked again.

        Raises:
            RefusedError: for the first command that leads out.
        """
        area, work = self._context.area, self.work
        if area is not None and not work.was_accepted:
            area.check(work.mission, family, start=None, home=None, rally=work.rally_spots)

    def refuse(self, error: RefusedError, effects: Effects) -> None:
        """Fail a mission that cannot be flown, before anything is sent."""
        self.ledger.fail(error.reason, error.command_index)
        self._context.report(effects)

    def abort(self, reason: str, effects: Effects) -> None:
        """Note and report that it is aborted; one that has begun is ended by `abort_now`."""
        self._context.abort(reason, effects)

    def fail_again(self, reason: str, now: float, effects: Effects) -> None:
        """Report a failure that an earlier run has noted, and may not have reported."""
        if self.is_attaching:
            self._move(Event.ENDED, now, effects)
        elif self.work.report is not None:
            self.ledger.restore(self.work.report)
        self.ledger.fail(reason)
        self._context.report(effects)

    def confirm(self) -> None:
        """Note that the edge server has confirmed the acceptance."""
        self._context.is_confirmed = True

    def begin(self, now: float, effects: Effects, *, hovering: bool, resumed: bool) -> None:
        """Begin the mission from its start, or (`resumed`) where an earlier run left it.

        `hovering` if the vehicle holds in the air where a mission of this broker left it.
        """
        self._context.begin(now, hovering=hovering, resumed=resumed)
        self._move(Event.MISSION_RESUMED if resumed else Event.MISSION_TAKEN, now, effects)

    # Messages and time

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle's autopilot or camera."""
        if self.state in UPLOADED:
            self._context.observe_items(message)
        if self.state in IN_FLIGHT:
            self._context.observe_fence(message, now, effects)
        if self._yields(now, effects) and self.state not in READING:
            return
        phase = self._phase
        phase.receive(message, now, effects)
        match message.get_type():
            case "CAMERA_CAPTURE_STATUS":
                self._context.captures.receive(message, now)
            case "COMMAND_ACK":
                self._context.speeds.receive(message, now, effects)
                self._context.pauses.receive(message, now, effects)
        if phase.exchange is not None:
            effects.messages += phase.exchange.receive(message, now)
            self._apply(phase.take_outcome(now), now, effects)

    def tick(self, now: float, effects: Effects) -> None:
        """Do what is due at a time; while another system is in command nothing is ordered."""
        if self.state in TRANSFERRING and self._context.is_expired(now):
            self._context.expire(effects)
            self._cancel_upload(effects)
            self._move(Event.ENDED, now, effects)
            return
        yields = self._yields(now, effects)
        phase = self._phase
        if phase.exchange is not None and (not yields or self.is_attaching):
            effects.messages += phase.exchange.tick(now)
            self._apply(phase.take_outcome(now), now, effects)
        if not yields:
            self._context.speeds.tick(now, effects)
        self._context.pauses.tick(self.state, self._who, now, effects)
        self._context.report_pause(effects)
        self._apply(self._phase.tick(now, effects), now, effects)
        if not yields:
            self._context.speeds.order_late(self.state, now, effects)
        if self._context.soft_abort.work is not None and not self._context.pauses.is_paused:
            self._abort_when_due(now, effects)

    def _yields(self, now: float, effects: Effects) -> bool:
        """Fail at once when another system takes the vehicle; whether no order may be given.

        While items fly the progress monitor judges whether the mission has ended: a pilot may give
        the vehicle back within seconds. On the ground the mission waits for whoever armed it.
        """
        authority = self._context.authority
        authority.observe_mode()
        who = authority.update(self._phase.claim, is_attaching=self.is_attaching)
        if who is Authority.BROKER:
            return self._phase.landed_by is not None
        waits_in_air = self.state is State.WAITING and self._context.is_hovering
        if self.state in ASKING or waits_in_air:
            self._fail(Fault(authority.reason(who)), now, effects)
        return True

    # States

    @property
    def _phase(self) -> Phase:
        return self._phases[self.state]

    @property
    def _who(self) -> Authority:
        """Who is in command of the vehicle now."""
        return self._context.authority.who(self._phase.claim)

    def _apply(self, result: Result, now: float, effects: Effects) -> None:
        """Do what a hook of the phase has returned."""
        match result:
            case Event():
                self._move(result, now, effects)
            case Fault() if self._is_link_away(now):
                self._attach_again(now, effects)
            case Fault():
                self._fail(result, now, effects)
            case Request.NEXT_SEGMENT:
                self._next_segment(now, effects)
            case Request.RETURN_HOME:
                self._return_home(now, effects)

    def _move(self, event: Event, now: float, effects: Effects) -> None:
        before, after = self.state, follow(self.state, event)
        is_unseen = self._context.has_landed_unseen(was_sent_down=self.sends_down)
        if after in ENDING and (is_unseen or self._phase.landed_by is not None):
            self._vehicle.armed_period.end_by_others(now)
        self._phase.leave()
        self.state = after
        mission_id = self.work.mission.mission_id
        _LOG.info("mission %d: %s, %s -> %s", mission_id, before.name, event.name, after.name)
        if after in IN_FLIGHT:
            self._vehicle.armed_period.claim()
        if after in ENDING:
            self._context.speeds.cancel(MISSION_ENDED, effects)
            self._context.pauses.cancel(MISSION_ENDED, effects)
        self._apply(self._phase.enter(now, effects), now, effects)

    def _is_link_away(self, now: float) -> bool:
        """Whether only a lost link may have caused a fault."""
        is_away = not self._vehicle.is_connected(now)
        return self.state in ASKING and is_away and self._link_losses < MOST_LINK_LOSSES

    def _attach_again(self, now: float, effects: Effects) -> None:
        """Wait for the vehicle, as a restarted broker does, and find out how far it has come."""
        self._link_losses += 1
        self._context.was_running = self._context.was_reported_running
        self._move(Event.LINK_LOST, now, effects)

    def _fail(self, fault: Fault, now: float, effects: Effects) -> None:
        if fault.reason == DISARMED:  # Nothing of the broker has landed it
            self._vehicle.armed_period.end_by_others(now)
        self._failing.prepare(fault, self.state, self._phase, effects)
        self._move(Event.FAULT, now, effects)

    def _next_segment(self, now: float, effects: Effects) -> None:
        """Continue after a segment, or end; a soft abort that waits for that ends the mission."""
        context, segments = self._context, self._context.segments
        landed = segments.is_on_ground if segments.has_moved else not context.is_hovering
        work = None if segments.is_last else context.soft_abort.take()
        if work is not None:
            self.abort_now(work, now, effects)
            return
        if not segments.advance():
            effects.messages += exchanges.parking(self._vehicle) if landed else []
            self._move(Event.ENDED, now, effects)
            return
        context.was_running = False
        context.is_hovering = not landed
        self._move(context.event_of_segment(), now, effects)

    # Events

    def handle_event(self, work: EventWork, now: float, effects: Effects) -> None:
        """Carry out an event after which the mission continues: pause, resume, change the speed."""
        context, state, who = self._context, self.state, self._phase.landed_by or self._who
        speed_m_s = work.event.maximum_speed
        match work.event.event_type_id:
            case EventType.DRONE_SPEED if speed_m_s is not None:
                context.speeds.change(work, speed_m_s, state, who, now, effects)
            case EventType.RESUME_MISSION:
                has_items = self._running.has_items
                context.pauses.resume(work, state, who, now, effects, has_items=has_items)
            case EventType.PAUSE_MISSION if state in IN_FLIGHT or context.is_flying:
                context.pauses.pause(work, state, who, now, effects)
            case EventType.PAUSE_MISSION:
                effects.for_edge.append(work.answer("refused", FLIES_NO_COMMAND))

    def answer_events(self, reason: str, effects: Effects) -> None:
        """Answer every event that the end of the mission leaves without an answer."""
        self._context.soft_abort.answer("done", reason, effects)
        self._context.speeds.cancel(reason, effects)
        self._context.pauses.cancel(reason, effects)
        self._aborting.refuse(reason, effects)

    def abort_softly(self, work: EventWork, now: float, effects: Effects) -> None:
        """Wait for the running command; another soft abort changes the place, not the deadline."""
        waits = self.state in IN_FLIGHT and not self._context.pauses.is_paused
        self._context.soft_abort.begin(work, now, effects, waits=waits)
        self._abort_when_due(now, effects)

    def _abort_when_due(self, now: float, effects: Effects) -> None:
        soft_abort = self._context.soft_abort
        if self.state is State.IDLE:  # The mission has ended meanwhile
            soft_abort.answer("done", None, effects)
            return
        work = soft_abort.take_due(now)
        if work is not None and self._running.was_paused_after(soft_abort.since):
            self.abort(REASONS[work.event.event_type_id], effects)
            self._leave_vehicle(work, f"{self._running.pause}: it stays there", now, effects)
        elif work is not None:
            self.abort_now(work, now, effects)

    def abort_now(self, work: EventWork, now: float, effects: Effects) -> None:
        """End the mission; a vehicle that is armed is sent where the event orders."""
        authority = self._context.authority
        self._context.soft_abort.answer("done", REPLACED, effects)
        self._cancel_upload(effects)
        who = (self._aborting.who(now) if self.state is State.ABORTING else None) or self._who
        may_fly_on = who is Authority.BROKER and self._may_be_armed(now)
        why = REASONS[work.event.event_type_id]
        if may_fly_on and (monitors := self._monitors_of_flight()) is not None:
            self._aborting.follow(monitors, why)
        elif not (may_fly_on and self._aborting.is_following):
            self._end_now(why, now, effects)
        self._aborting.acknowledge(effects, instead=REPLACED)
        if who is not Authority.BROKER:
            self._leave_vehicle(work, authority.reason(who), now, effects)
        elif not may_fly_on:
            done = work.answer("done", note_on_ground(work.event))
            effects.for_edge.append(done)
            self._move(Event.ENDED, now, effects)
        else:
            self._aborting.order(work.event, work, now)
            self._move(Event.ABORTED, now, effects)

    def _leave_vehicle(self, work: EventWork, reason: str, now: float, effects: Effects) -> None:
        """Refuse to order a vehicle that another system has; the mission is over."""
        self._vehicle.armed_period.take_away()
        effects.for_edge.append(work.answer("refused", reason))
        self._move(Event.ENDED, now, effects)

    def end_for_abort(self, work: EventWork, now: float, effects: Effects) -> None:
        """End the mission for an abort that an earlier run of the broker has ordered."""
        self._context.soft_abort.answer("done", REPLACED, effects)
        self._cancel_upload(effects)
        self._end_now(REASONS[work.event.event_type_id], now, effects)
        self._move(Event.ENDED, now, effects)

    def _monitors_of_flight(self) -> SegmentMonitors | None:
        """Give what follows the items that the vehicle flies, until it obeys an abort.

        An order to start them may be in transit; only a known mode shows whether it has arrived.
        """
        if self.state is State.STARTING and self._vehicle.family.knows_modes:
            return SegmentMonitors.of(self._context)
        return self._running.monitors

    def _end_now(self, reason: str, now: float, effects: Effects) -> None:
        self._aborting.end_now(
            reason, self._running.monitors, now, effects, is_unknown=self.is_flight_unknown
        )

    def _may_be_armed(self, now: float) -> bool:
        """Whether the vehicle is armed, is about to be, or does not show whether it still flies."""
        is_armed = bool(self._vehicle.snapshot.armed) or self._context.authority.is_arming_ordered
        return is_armed or (self.state in IN_FLIGHT and not self._vehicle.shows_itself(now))

    def _return_home(self, now: float, effects: Effects) -> None:
        self._aborting.order(return_event(self._vehicle.vehicle_id), None, now)
        self._move(Event.ABORTED, now, effects)

    def _cancel_upload(self, effects: Effects) -> None:
        if self.state is State.UPLOADING:
            effects.messages.append(exchanges.cancellation(self._vehicle))

    # Alarms, restarts, errors

    def withdraw(self, now: float, effects: Effects) -> None:
        """Drop a mission that the edge server has ended, or holds; nothing is reported of it."""
        number = self.work.mission.mission_id
        _LOG.warning("mission %d is not flown: the edge server holds it or has ended it", number)
        self._cancel_upload(effects)
        self._move(Event.ENDED, now, effects)

    def raise_alarm(self, reason: str, now: float, effects: Effects) -> None:
        """Fail a mission that flies; the vehicle returns, or lands if it cannot."""
        if self.state not in IN_FLIGHT or not self._vehicle.snapshot.armed:
            return
        self._context.fail(reason, effects)
        if self._context.authority.is_lost:
            if self._who is not Authority.BROKER:
                self._vehicle.armed_period.take_away()
            self._move(Event.ENDED, now, effects)
        else:
            self._return_home(now, effects)

    def fail_after_error(self, reason: str, now: float, effects: Effects) -> None:
        """Fail the mission in which the broker has had an unexpected error, in any state.

        A vehicle that flies it returns. One that was ordered to arm or to start is disarmed; it
        may take off before that order arrives, refuse it then, and lands.
        """
        context, snapshot = self._context, self._vehicle.snapshot
        context.fail(reason, effects)
        self._aborting.refuse(reason, effects)
        self._cancel_upload(effects)
        followed = self._aborting.is_following  # It flies items, and has not obeyed yet
        is_ours = self._who is Authority.BROKER
        if not is_ours:
            self._vehicle.armed_period.take_away()
        self._aborting.drop()
        if self.state is State.IDLE:
            return
        starts = self.state in ARMED_BY_BROKER and not context.is_hovering
        flies = bool(snapshot.armed) and snapshot.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND
        flew = self.state in IN_FLIGHT or followed
        flew |= context.is_hovering and context.is_start_ordered
        if (starts or (flies and flew)) and is_ours and not context.authority.is_lost:
            self._return_home(now, effects)
        else:
            self._move(Event.ENDED, now, effects)

    def vehicle_restarted(self, reason: str, now: float, effects: Effects) -> None:
        """Note that the vehicle was restarted, or is another one: it does not fly this mission."""
        context = self._context
        if self.state is State.ABORTING:
            self._aborting.vehicle_restarted(effects)
            context.is_hovering = False
            self._move(Event.ENDED, now, effects)
            return
        self._geofence.forget()
        context.authority.is_arming_ordered = False
        preparing = self.state in PREPARING
        flew_unseen = self.is_flight_unknown and self._link_losses > 0
        if self.state in IN_FLIGHT or flew_unseen or (preparing and context.is_hovering):
            context.answer_failed(reason, effects)
            self._fail(Fault(reason), now, effects)
        elif preparing:
            self._move(Event.VEHICLE_RESTARTED, now, effects)
        elif self.is_attaching:
            self._attaching.forget()
        self._failing.forget_vehicle()
