"""One mission on one vehicle, from the work item to its terminal report.

Three files by phase, each a class on top of the one before: `flight_preparation`,
`flight_progress`, and this one for what comes from outside, messages, time and events.
"""

import logging
from typing import Final

from afarcloud import plan as documents
from afarcloud.enumerations import EventType, Status
from mavlink_broker.edge.work import EventWork, MissionWork
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.plan_kinds import FENCE, RALLY
from mavlink_broker.mission import activities
from mavlink_broker.mission.abort_executor import STRAY_S, Ending, abort_note, coming_home
from mavlink_broker.mission.event_execution import (
    ENDED,
    PATIENCE_S,
    REASONS,
    REPLACED,
    SoftAbort,
    SpeedOrders,
    within_fence,
)
from mavlink_broker.mission.flight_progress import FlightProgress
from mavlink_broker.mission.states import BEFORE_TAKEOFF, Event, State
from mavlink_broker.planning.geofence import fence_items, rally_items
from mavlink_broker.recovery.record import Homeward
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.alarms import mission_error
from mavlink_broker.vehicle.control_authority import InCommand
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

_WITH_ITEMS: Final = BEFORE_TAKEOFF - {State.FENCING, State.HOLDING}
_IN_FLIGHT: Final = frozenset({State.RUNNING, State.PERFORMING})
_READING: Final = frozenset({State.ATTACHING, State.RUNNING})
"""States whose protocols order nothing, so that they go on while somebody else has the vehicle."""
_ENDING: Final = frozenset({State.LEAVING, State.FAILING, State.IDLE})
"""States behind which nothing of the mission is flown any more."""
_ARMED_BY_US: Final = frozenset({State.ARMING, State.STARTING})
RESTARTED: Final = "the vehicle was restarted"
RETURN_ENDED: Final = f"{RESTARTED} on its way home"
ON_GROUND: Final[int] = mavlink.MAV_LANDED_STATE_ON_GROUND

_LOG = logging.getLogger(__name__)


class Flight(FlightProgress):
    """One mission."""

    def __init__(self, work: MissionWork, vehicle: Vehicle, reporter: Reporter) -> None:
        super().__init__(work, vehicle, reporter)
        self._speeds = SpeedOrders(vehicle)
        self._late_speed_m_s: float | None = None  # Came while the items were on their way
        self._soft_abort: SoftAbort | None = None
        self._ending: Ending | None = None
        self._ending_note: str | None = None  # What is done otherwise than it says
        self._ending_work: int | None = None  # None: an alarm has ended the mission
        self._entries = {
            State.FENCING: self._enter_fencing,
            State.HOLDING: self._enter_holding,
            State.UPLOADING: self._enter_uploading,
            State.VERIFYING: self._enter_verifying,
            State.SELECTING: self._enter_selecting,
            State.ARMING: self._enter_arming,
            State.STARTING: self._enter_starting,
            State.RUNNING: self._enter_running,
            State.PERFORMING: self._enter_performing,
        }
        self._steps = {
            State.ATTACHING: self._step_attaching,
            State.WAITING: self._step_waiting,
            State.ARMING: self._step_arming,
            State.STARTING: self._step_starting,
            State.RUNNING: self._step_running,
            State.PERFORMING: self._step_performing,
            State.LEAVING: self._step_leaving,
            State.FAILING: self._step_failing,
        }

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle hovers afterwards: at the end, or still where it did before."""
        if self._ending is not None:
            return self._ending.leaves_hovering
        if self.ledger.status == Status.FINISHED and self._stages.has_moved:
            return not self._stages.ends_on_ground
        return self._hovering and not self._told_to_start

    def begin(self, now: float, effects: Effects, *, hovering: bool, resumed: bool) -> None:
        """Take up the mission: from its start, or (`resumed`) from where an earlier run left it.

        `hovering` if the vehicle holds in the air where a mission of ours left it.
        """
        self._hovering = hovering
        self._began_at = now
        if self.work.report is not None:
            self.ledger.restore(self.work.report)
        self._was_running = self.ledger.status == Status.RUNNING
        self._speeds.has_changed = self._was_running
        if resumed:
            self._vehicle.loan.assume(FENCE, fence_items(self.work.geofence))
            self._vehicle.loan.assume(RALLY, rally_items(self.work.rally_points))
        self._move(Event.MISSION_RESUMED if resumed else Event.MISSION_TAKEN, now, effects)

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Take a message of the vehicle's autopilot."""
        if self._yields(now, effects) and self.state not in _READING:
            return
        if self._follower is not None:
            self._follower.receive(message)
            effects.messages += self._foreign.receive(message, now)
            self._skips.receive(message, now)
        if self._series is not None:
            self._series[1].receive(message, now)
        if self._performer is not None:
            effects.messages += self._performer.receive(message, now)
        if self._ending is not None:
            effects.messages += self._ending.receive(message, now)
        self._speeds.receive(message, now, effects)
        if self._activity is not None:
            effects.messages += self._activity.receive(message, now)
            self._settle(now, effects)

    def step(self, now: float, effects: Effects) -> None:
        """Let time pass; while somebody else has the vehicle nothing is ordered."""
        yields = self._yields(now, effects)
        if self._activity is not None and (not yields or self.state is State.ATTACHING):
            effects.messages += self._activity.tick(now)
            self._settle(now, effects)
        if not yields:
            self._speeds.tick(now, effects)
        if self.state in self._steps:
            self._steps[self.state](now, effects)
        if not yields:
            self._tell_late_speed(now, effects)
        if self._soft_abort is not None:
            self._abort_softly(self._soft_abort, now, effects)

    def interrupt(self, work: EventWork, now: float, effects: Effects) -> None:
        """Carry out an event: abort now, abort behind the running command, or change the speed."""
        if not work.was_accepted:
            effects.for_edge.append(Acknowledgement(work.work_id, "accepted"))
        if work.event.maximum_speed is not None:
            self._change_speed(work, work.event.maximum_speed, now, effects)
        elif work.event.event_type_id is EventType.ABORT_MISSION:
            self._abort_now(work, now, effects)
        else:
            self._abort_soon(work, now, effects)

    def withdraw(self, now: float, effects: Effects) -> None:
        """Drop a mission that the edge server has ended; nothing is to be told of it."""
        _LOG.warning("mission %d was withdrawn", self.work.mission.mission_id)
        if self.state is State.UPLOADING:
            effects.messages.append(activities.cancellation(self._vehicle))
        self._activity = None
        self._move(Event.ENDED, now, effects)

    def answer_events(self, reason: str, effects: Effects) -> None:
        """Answer every event that the end of the mission leaves without an answer."""
        self._give_up_soft_abort(effects, reason)
        self._speeds.give_up(reason, effects)
        self.refuse_ending(reason, effects)

    def _move(self, event: Event, now: float, effects: Effects) -> None:
        super()._move(event, now, effects)
        if self.state in _ENDING:
            self._speeds.give_up(ENDED, effects)

    def _change_speed(
        self, work: EventWork, speed_m_s: float, now: float, effects: Effects
    ) -> None:
        """Fly at another speed from now on; what is on its way to the vehicle stays as it is."""
        if self.state in _ENDING:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", ENDED))
            return
        self._late_speed_m_s = speed_m_s if self.state in _WITH_ITEMS else None
        if self._late_speed_m_s is None:
            self._stages.set_speed(speed_m_s)
        if self.state in _IN_FLIGHT and self._who is not InCommand.BROKER:
            reason = control_authority.reason(self._who, self._vehicle.seen)
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))
        elif self.state in _IN_FLIGHT:
            is_live = self.state is State.PERFORMING
            self._speeds.give(work, speed_m_s, now, effects, is_live=is_live)
        else:
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))

    def _tell_late_speed(self, now: float, effects: Effects) -> None:
        """Tell the speed that came while the vehicle was being given its items."""
        speed_m_s = self._late_speed_m_s
        if speed_m_s is None or self.state in _WITH_ITEMS:
            return
        self._late_speed_m_s = None
        self._stages.set_speed(speed_m_s)
        if self.state is State.RUNNING:
            self._speeds.tell(speed_m_s, now, effects)

    def alarm(self, reason: str, now: float, effects: Effects) -> None:
        """Fail a mission that flies; the vehicle comes home, or lands if it cannot."""
        if self.state not in _IN_FLIGHT or not self._vehicle.snapshot.armed:
            return
        self.ledger.fail(reason)
        effects.for_edge.append(self._reporter.mission(self.ledger))
        self._give_up_soft_abort(effects, f"the mission has failed: {reason}")
        if self._is_taken_away:
            self._vehicle.is_taken |= self._who is not InCommand.BROKER
            self._follower = self._performer = None
            self._move(Event.ENDED, now, effects)
            return
        self._leave(coming_home(self._vehicle.vehicle_id), None, now, effects)

    def break_off(self, reason: str, now: float, effects: Effects) -> None:
        """Fail the mission in which the broker has had an unexpected error, in any state.

        A vehicle that flies it comes home; one that stands with turning propellers is disarmed.
        """
        if not self.ledger.status.is_terminal:
            self.ledger.fail(reason)
            effects.for_edge.append(self._reporter.mission(self.ledger))
        self._give_up_soft_abort(effects, f"the mission has failed: {reason}")
        self.refuse_ending(reason, effects)
        if self.state is State.UPLOADING:
            effects.messages.append(activities.cancellation(self._vehicle))
        is_ours = self._who is InCommand.BROKER
        self._vehicle.is_taken |= not is_ours
        if self.state in _ARMED_BY_US and not self._hovering and is_ours:
            effects.messages += activities.disarming(self._vehicle)
        self._follower = self._performer = self._activity = self._ending = None
        if self.state is State.IDLE:
            return
        snapshot = self._vehicle.snapshot
        flies = bool(snapshot.armed) and snapshot.landed_state != ON_GROUND
        was_ours = self.state in _IN_FLIGHT or (self._hovering and self._told_to_start)
        if flies and was_ours and is_ours and not self._is_taken_away:
            self._leave(coming_home(self._vehicle.vehicle_id), None, now, effects)
        else:
            self._move(Event.ENDED, now, effects)

    def _leave_failed(self, now: float, effects: Effects) -> None:
        """Bring a vehicle home that would wait in the air for orders that never come."""
        is_free = not self._vehicle.is_taken and not self._is_taken_away
        if self._waits_for_orders and is_free and self._vehicle.snapshot.armed:
            self._leave(coming_home(self._vehicle.vehicle_id), None, now, effects)
        else:
            super()._leave_failed(now, effects)

    def _leave(
        self, event: documents.Event, work_id: int | None, now: float, effects: Effects
    ) -> None:
        """Send the vehicle where the event says."""
        self._follower = self._performer = None
        self._vehicle.ordered = None  # This is newer
        event, self._ending_note = within_fence(event, self._area, self._vehicle)
        arms_until = now + STRAY_S if self._is_arming_ordered else None
        self._ending = Ending(event, self._vehicle, was_ours=True, arms_until=arms_until)
        self._ending_work = work_id
        self._vehicle.abort = None if work_id is None else abort_note(event, work_id, self._vehicle)
        if work_id is None:
            reason = self.ledger.message or ""
            noted_s = self._vehicle.snapshot.time_s
            name = self.work.name
            self._vehicle.homeward = Homeward(mission=name, reason=reason, noted_s=noted_s)
        self._move(Event.ABORTED, now, effects)
        effects.messages += self._ending.start(now)

    def _abort_soon(self, work: EventWork, now: float, effects: Effects) -> None:
        """Wait for the running command; another soft abort says where to go, not for how long."""
        before = self._soft_abort
        self._give_up_soft_abort(effects, REPLACED)
        command = self.ledger.finished if self.state in _IN_FLIGHT else None
        deadline_s = self._vehicle_time_s(now) + PATIENCE_S
        if before is not None:
            command, deadline_s = before.command, before.deadline_s
        self._soft_abort = SoftAbort(work, command, deadline_s, now)
        self._abort_softly(self._soft_abort, now, effects)

    def _give_up_soft_abort(self, effects: Effects, instead: str) -> None:
        """Take one that waits as done: what replaces it has ended the mission."""
        if self._soft_abort is not None:
            work_id, self._soft_abort = self._soft_abort.work.work_id, None
            effects.for_edge.append(Acknowledgement(work_id, "done", instead))

    def _abort_softly(self, abort: SoftAbort, now: float, effects: Effects) -> None:
        statuses = self.ledger.commands
        ended = abort.command is not None and statuses[abort.command].is_terminal
        if self.state is State.IDLE:  # It came to its end meanwhile
            self._soft_abort = None
            effects.for_edge.append(Acknowledgement(abort.work.work_id, "done"))
        elif abort.is_due(command_ended=ended, now_s=self._vehicle_time_s(now)):
            self._soft_abort = None
            if self._was_paused_after(abort.since):
                self._leave_paused(abort.work, now, effects)
            else:
                self._abort_now(abort.work, now, effects)

    def _leave_paused(self, work: EventWork, now: float, effects: Effects) -> None:
        """End a mission at a soft abort's time, whose vehicle was paused since that came."""
        self.ledger.abort(REASONS[work.event.event_type_id])
        effects.for_edge.append(self._reporter.mission(self.ledger))
        reason = f"{self._pause}: it stays there"
        effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))
        self._vehicle.is_taken = True
        self._follower = self._performer = None
        self._move(Event.ENDED, now, effects)

    def _abort_now(self, work: EventWork, now: float, effects: Effects) -> None:
        """End the mission; a vehicle that is armed is told where to go."""
        self._give_up_soft_abort(effects, REPLACED)
        if self.state is State.UPLOADING:
            effects.messages.append(activities.cancellation(self._vehicle))
        if not self.ledger.status.is_terminal:
            self.ledger.abort(REASONS[work.event.event_type_id])
            effects.for_edge.append(self._reporter.mission(self.ledger))
        who, seen = self._who, self._vehicle.seen
        if self.state is State.LEAVING and self._ending is not None:
            who = self._ending.who(now)
        self._follower = self._performer = None
        self._acknowledge_ending(effects, instead=REPLACED)
        if who is not InCommand.BROKER:
            self._vehicle.is_taken = True
            reason = control_authority.reason(who, seen)
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))
            self._move(Event.ENDED, now, effects)
            return
        if not self._vehicle.snapshot.armed and not self._is_arming_ordered:
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))
            self._move(Event.ENDED, now, effects)
            return
        self._leave(work.event, work.work_id, now, effects)

    def _acknowledge_ending(self, effects: Effects, instead: str | None = None) -> None:
        """Acknowledge once that an event has been carried out, or what replaces it."""
        if self._ending is not None and self._ending_work is not None:
            taken = self._ending.taken
            status = "done" if taken is None else "refused"
            note = taken or instead or self._ending_note
            effects.for_edge.append(Acknowledgement(self._ending_work, status, note))
            self._vehicle.abort = None
            self._ending_work = None

    def refuse_ending(self, reason: str, effects: Effects) -> None:
        """Answer that an event cannot be carried out to its end, if there is one."""
        if self._ending_work is not None:
            effects.for_edge.append(Acknowledgement(self._ending_work, "refused", reason))
            self._vehicle.abort = self._ending_work = None

    def _step_leaving(self, now: float, effects: Effects) -> None:
        if self._ending is None:
            return
        effects.messages += self._ending.tick(now)
        if self._ending.is_over:
            self._acknowledge_ending(effects)
            self._move(Event.ENDED, now, effects)

    def _vehicle_time_s(self, now: float) -> float:
        told = self._vehicle.snapshot.time_s
        return now if told is None else told

    def rebooted(self, now: float, effects: Effects) -> None:
        """Take that the vehicle was restarted: what it flies from then on is not ours."""
        if self.state is State.LEAVING:
            self._end_restarted(now, effects)
            return
        self._is_fenced = self._is_arming_ordered = False
        preparing = self.state in BEFORE_TAKEOFF
        flying = self.state in {State.RUNNING, State.PERFORMING}
        lost_sight_of = self.state is State.ATTACHING and self._looks > 0 and self._has_flown
        if flying or lost_sight_of or (preparing and self._hovering):
            self._give_up_soft_abort(effects, f"the mission has failed: {RESTARTED}")
            self._fail_surely(RESTARTED, now, effects)
        elif preparing:
            self._move(Event.REBOOTED, now, effects)
        elif self.state is State.ATTACHING:
            self._activity = None
        self._waits_for_orders = self._stops_propellers = False

    def _end_restarted(self, now: float, effects: Effects) -> None:
        """Give no further order of an abort, or of a return that an alarm has ordered."""
        if self._ending_work is None:
            failure = mission_error(RETURN_ENDED)
            effects.for_edge.append(self._reporter.alarm(failure, self.work.mission.mission_id))
        self.refuse_ending(RESTARTED, effects)
        self._ending, self._hovering = None, False
        self._move(Event.ENDED, now, effects)

    def _ends_here(self, now: float, effects: Effects) -> bool:
        abort, self._soft_abort = self._soft_abort, None
        if abort is None:
            return False
        self._abort_now(abort.work, now, effects)
        return True
