"""The missions of one vehicle: which one flies, which ones wait, and the events upon them.

One mission flies at a time. The next one begins when the vehicle has landed and is disarmed, or
hovers where a finished mission of this broker has left it.
"""

import logging
import math
from collections import deque
from collections.abc import Sequence
from typing import Final

from afarcloud.enumerations import EventType, Status
from mavlink_broker.autopilots.families import MOST_CAPABLE
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.edge.wire import AcceptanceResult, EventWork, MissionWork
from mavlink_broker.effects import EdgeMessage, Effects
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.abort_executor import REASONS, UnconfirmedMissions
from mavlink_broker.mission.context import RETURN_ENDED
from mavlink_broker.mission.flight_orders import MISSION_ENDED
from mavlink_broker.mission.mission_executor import MissionExecutor
from mavlink_broker.mission.pending_events import PendingEvents, ReplacedOrders
from mavlink_broker.mission.states import State
from mavlink_broker.planning.geofence import check_flyable
from mavlink_broker.planning.mission import translate
from mavlink_broker.planning.situation import Home, RefusedError
from mavlink_broker.vehicle.alarms import mission_error
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.recovery_state import PendingReturn, RecoveryRecord
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle

LEFT_S: Final = 2.0
"""Time before its expiry from which an abort waits for nothing but its vehicle."""
EVENT_VEHICLE_WITHIN_S: Final = 8.0
"""How long an event without a mission waits for its vehicle and the place where that hovers. An
event expires 10 s after it was ordered; until then the edge server accepts the reason."""

_LOG = logging.getLogger(__name__)


class MissionQueue:
    """The missions and events of one vehicle."""

    def __init__(self, vehicle: Vehicle, reporter: Reporter) -> None:
        self.vehicle = vehicle
        self._reporter = reporter
        self._events = PendingEvents(vehicle)
        self._waiting: deque[MissionExecutor] = deque()
        self._unconfirmed = UnconfirmedMissions(vehicle)
        self._current: MissionExecutor | None = None
        self._landing_of: str | None = None  # The mission behind which the vehicle comes down
        self._failed: PendingReturn | None = None  # In an earlier run
        self._has_begun = False  # Only the first mission can be one that an earlier run began

    @property
    def state(self) -> State:
        """What the broker does for the vehicle's mission."""
        if self._current is not None:
            return self._current.state
        return State.ABORTING if self._events.is_aborting else State.IDLE

    @property
    def is_empty(self) -> bool:
        """Whether there is neither a mission nor an event."""
        is_settled = not self._events.is_waiting and not self._unconfirmed.are_open
        return self.is_idle and is_settled

    @property
    def is_idle(self) -> bool:
        """Whether no mission flies or waits."""
        return self._current is None and not self._waiting

    @property
    def is_flying(self) -> bool:
        """Whether one mission is transferred, in flight or ending."""
        return self._current is not None

    @property
    def tracks(self) -> bool:
        """Whether the camera tracks a subject for the mission that flies, or may do so."""
        return self._current is not None and self._current.tracks

    @property
    def work(self) -> MissionWork | None:
        """The work item of the mission that flies."""
        return None if self._current is None else self._current.work

    @property
    def ledger(self) -> MissionLedger | None:
        """The statuses of the mission that flies."""
        return None if self._current is None else self._current.ledger

    @property
    def running_mission_id(self) -> int | None:
        """The mission that is reported to run."""
        ledger = self.ledger
        return None if ledger is None or ledger.status != Status.RUNNING else ledger.mission_id

    # Missions

    def take_mission(self, work: MissionWork, effects: Effects) -> None:
        """Queue a mission, or refuse one that cannot be flown.

        It is accepted when its turn comes: until then the edge server may cancel or change it, and
        it may hold the vehicle.

        A vehicle that has not sent its kind yet may be one that flies everything: its own refusals
        wait until it has. A refusal's report goes out before the acknowledgement, which closes
        the work.
        """
        self._unconfirmed.reopen(work)
        mission = MissionExecutor(work, self.vehicle, self._reporter)
        family = self.vehicle.family if self.vehicle.is_identified else MOST_CAPABLE
        try:
            translate(work.mission, family, Home(0.0, 0.0, 0.0))
            if not work.was_accepted:
                check_flyable(work.mission)
            mission.check_area(family)
        except RefusedError as error:
            mission.refuse(error, effects)
            effects.for_edge.append(work.answer("refused", str(error)))
            return
        self._waiting.append(mission)

    def take_acceptance_result(
        self, result: AcceptanceResult, now: float, effects: Effects
    ) -> None:
        """Confirm a mission that was accepted, or drop it."""
        if self._unconfirmed.take_acceptance_result(result, effects):
            return
        missions = (*self._waiting, self._current)
        mission = next(
            (one for one in missions if one and one.work.work_id == result.work_id), None
        )
        if mission is None or mission.is_confirmed:
            return
        if result.is_confirmed:
            mission.confirm()
            return
        _LOG.warning(
            "vehicle %d: mission %d is not flown: %s",
            self.vehicle.vehicle_id,
            mission.work.mission.mission_id,
            result.reason or "the edge server has withdrawn it",
        )
        if result.has_failed and not mission.ledger.status.is_terminal:
            mission.ledger.fail(result.reason)
            effects.for_edge.append(self._reporter.mission(mission.ledger))
        if mission is not self._current:
            self._waiting.remove(mission)
        elif self.state is not State.ABORTING:
            mission.withdraw(now, effects)
            self.close_ended(effects)

    def _begin_next(self, now: float, effects: Effects, *, is_unreachable: bool = False) -> None:
        """Begin the first mission that waits, when the vehicle is free for it.

        A mission whose vehicle is unreachable begins too, and fails if it stays so.
        """
        if self._current is not None or not self._waiting:
            return
        mission, vehicle = self._waiting[0], self.vehicle
        reason = self._reason_to_fail(mission)
        is_resumed = self._is_resumed(mission)
        if reason is not None and is_resumed:
            self._waiting.popleft().fail_again(reason, now, effects)
            return
        if self._events.is_before(mission.work.work_id) or self._unconfirmed.are_open:
            return
        is_free = vehicle.snapshot.is_on_ground or vehicle.hovers
        if is_resumed or is_free or is_unreachable:
            self._has_begun = True
            self._current = self._waiting.popleft()
            _accept(mission.work, effects)
            if not is_resumed:
                # They may have the names of what was flown before
                vehicle.recovery.clear_commands()
            mission.begin(now, effects, hovering=vehicle.hovers, resumed=is_resumed)
        elif mission.work.was_accepted and mission.is_expired(now):
            self._waiting.popleft().abort("expired before take-off", effects)

    def _is_resumed(self, mission: MissionExecutor) -> bool:
        """Whether an earlier run may have begun a mission: the first, or one it has reported."""
        work = mission.work
        return work.was_accepted and (not self._has_begun or work.report is not None)

    def _reason_to_fail(self, mission: MissionExecutor) -> str | None:
        """Why a mission has failed, as an earlier run has noted it."""
        failed = self._failed
        return failed.reason if failed and failed.mission == mission.work.name else None

    def close_ended(self, effects: Effects) -> None:
        """Drop the mission that flies, once it has ended."""
        mission = self._current
        if mission is None or mission.state is not State.IDLE:
            return
        mission.answer_events(MISSION_ENDED, effects)
        self.vehicle.set_hovering(
            hovers=mission.leaves_hovering, in_this_mode=mission.has_failed_in_flight
        )
        self._note_descent(is_ordered=mission.sends_down)
        self.vehicle.recovery.pending_return = None
        self.vehicle.recovery.clear_commands()
        if mission.has_failed_in_flight:
            self._landing_of = mission.work.name
        self.vehicle.armed_period.end_mission()
        self._current = None

    # Messages and time

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle's autopilot."""
        effects.messages += self._events.receive(message, now)
        self.receive_payload(message, now, effects)

    def receive_payload(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle's camera or gimbal."""
        if self._current is not None:
            self._current.receive(message, now, effects)
            self.close_ended(effects)

    def tick(self, now: float, effects: Effects, *, is_unreachable: bool) -> None:
        """Do what is due at a time; the caller closes a mission that has ended (`close_ended`)."""
        self._report_landing(now, effects)
        self._begin_next(now, effects, is_unreachable=is_unreachable)
        if self._current is not None:
            self._current.tick(now, effects)

    def _report_landing(self, now: float, effects: Effects) -> None:
        """Report where a vehicle has landed whose mission was aborted or has failed."""
        if self._current is not None:
            self._landing_of = None
        vehicle = self.vehicle
        has_landed = vehicle.snapshot.is_on_ground and vehicle.is_connected(now)
        if self._landing_of is not None and has_landed:
            effects.for_edge += self._reporter.landing(f"{self._landing_of}/landing")
            self._landing_of = None

    # Events

    def take_event(self, work: EventWork, now: float, effects: Effects) -> None:
        """Carry out an event on the mission that flies, as soon as that is known.

        Raises:
            Exception: an unexpected error; the caller refuses the event then.
        """
        self._unconfirmed.reopen(work)
        self._events.add(work, effects, is_too_old=work.is_too_old(now))
        if self._current is None:
            self._events.limit_wait(work.work_id, now + EVENT_VEHICLE_WITHIN_S)
        self._events.limit_number(effects)
        try:
            if work.is_abort and self._waits_for_vehicle(work) and self._end_waiting(work, effects):
                self._events.note_ended_missions(work)
            self._carry_out_events(now, effects)
        except Exception:
            self._events.remove(work.work_id)
            raise

    def tick_events(self, now: float, effects: Effects) -> None:
        """Carry out the events that are due, while the vehicle is connected."""
        self._carry_out_events(now, effects)
        if self._events.take_interrupted_return():
            failure = mission_error(RETURN_ENDED)
            effects.for_edge.append(self._reporter.alarm(failure, None))
        was_aborting = self._events.is_aborting
        self._events.tick(now, effects)
        if was_aborting and not self._events.is_aborting:
            self.vehicle.recovery.pending_return = None
            self.vehicle.recovery.clear_commands()
            self.vehicle.set_hovering(hovers=self._events.leaves_hovering)
            self._note_descent(is_ordered=self._events.sends_down)

    def _note_descent(self, *, is_ordered: bool) -> None:
        """Note whether the vehicle returns or lands by order of what has ended."""
        if is_ordered:
            self.vehicle.begin_descent()
        else:
            self.vehicle.own_descent.end()

    def refuse_expired_events(self, now: float, effects: Effects) -> None:
        """Refuse the events whose vehicle was not received, or not again, in time."""
        self._events.refuse_expired(now, effects)

    def _carry_out_events(self, now: float, effects: Effects) -> None:
        self._end_past_orders(effects)
        self._resume_for_events(now, effects)
        for work in self._events.take_due(lambda one: self._is_too_early(one, now), now, effects):
            if work.is_abort:
                with self._events.replacing(work, effects) as replaced:
                    self._abort(work, now, effects, replaced)
            elif self._current is not None and _concerns(work, self._current):
                _accept(work, effects)
                self._current.handle_event(work, now, effects)
                self.close_ended(effects)
            else:
                refusal = work.answer("refused", self._events.reason_without_mission)
                effects.for_edge.append(refusal)
            self._events.remove(work.work_id)

    def _end_past_orders(self, effects: Effects) -> None:
        """End what an earlier run has ordered before a mission that was reported to run."""
        for mission in (self._current, *self._waiting):
            report = None if mission is None else mission.work.report
            if (
                mission is not None
                and report is not None
                and report.mission_status_id == Status.RUNNING
            ):
                self._events.end_before(mission.work.work_id, mission.work.name, effects)

    def _resume_for_events(self, now: float, effects: Effects) -> None:
        """Begin a mission of an earlier run before the events upon it are carried out."""
        if not self._waiting or not self._is_resumed(self._waiting[0]):
            return
        if any(_concerns(work, self._waiting[0]) for work in self._events.waiting):
            self._begin_next(now, effects)

    def _is_too_early(self, work: EventWork, now: float) -> bool:
        """Whether it is not known yet what an earlier run of the broker has begun."""
        if self._current is not None:
            resumed = self._current.is_flight_unknown
        else:
            resumed = bool(self._waiting) and self._is_resumed(self._waiting[0])
        is_unknown = self.vehicle.snapshot.armed is None
        is_journal_read = self.vehicle.recovery.tracker.is_loaded
        if work.was_accepted and (is_unknown or not is_journal_read):
            return True
        if self._waits_for_vehicle(work) or self._events.waits_for_edge(work, now):
            return True
        if not is_journal_read and self.vehicle.mode == self.vehicle.family.paused_mode:
            return True  # The journal may say that an event has paused it, else somebody has it
        if is_unknown:
            return resumed or (work.is_abort and self._events.is_before(work.work_id))
        return self._waits_for_progress(work, now) if work.aborts_now else resumed

    def _waits_for_progress(self, work: EventWork, now: float) -> bool:
        """Whether an abort waits a moment for what the vehicle has flown while nobody followed."""
        if self._current is None or not self._current.is_progress_unknown(now):
            return False
        expires_at = math.inf if work.was_accepted else work.expires_at or math.inf
        return now < expires_at - LEFT_S and not self._events.is_past(work)

    def _was_ordered_before(self, work: EventWork, replaced: ReplacedOrders) -> bool:
        """Whether the vehicle may have obeyed an abort, as an earlier run of the broker ordered.

        That was this abort, or an older one which this one replaces.
        """
        vehicle = self.vehicle
        is_paused = (
            vehicle.recovery.paused is not None and vehicle.mode == vehicle.family.paused_mode
        )
        flies_on = vehicle.snapshot.armed and (vehicle.mode_role is ModeRole.MISSION or is_paused)
        if replaced.is_noted:
            return not flies_on
        return work.was_accepted and (self._events.is_past(work) or not flies_on)

    def _waits_for_vehicle(self, work: EventWork) -> bool:
        """Whether a new event may still be for a vehicle that hovers, and that no mission flies.

        Its journal may hold that hover, a descent, or an older abort that the vehicle obeys. An
        abort has ended the missions that wait for the vehicle by then.
        """
        is_resumed = bool(self._waiting) and self._is_resumed(self._waiting[0])
        if self._current is not None or is_resumed or not self._events.is_limited(work):
            return False
        is_unknown = self.vehicle.snapshot.armed is None
        return is_unknown or (work.is_abort and self._events.may_be_ours)

    def _abort(
        self, work: EventWork, now: float, effects: Effects, replaced: ReplacedOrders
    ) -> None:
        """End missions, and send the vehicle where the abort orders; or refuse it."""
        has_ended = self._end_waiting(work, effects) or self._events.has_ended_missions(work)
        current = self._current
        if current is not None and self._is_droppable(current) and _concerns(work, current):
            self._unconfirmed.drop(current.work.work_id, current.abort, work.event)
            current.withdraw(now, effects)
            self.close_ended(effects)
            has_ended = True
        self._unconfirmed.hold_answer(work)
        is_newer = replaced.is_sent or self._events.is_ours
        current = self._current
        if current is not None and _concerns(work, current):
            _accept(work, effects)
            is_soft = work.event.event_type_id is EventType.SOFT_ABORT_MISSION
            if is_soft and not replaced.is_noted:
                current.abort_softly(work, now, effects)
            elif self._was_ordered_before(work, replaced):
                current.end_for_abort(work, now, effects)
                self.close_ended(effects)
                self._events.resume_abort(work, now, effects, is_newer=replaced.is_noted)
            else:
                current.abort_now(work, now, effects)
            self.close_ended(effects)
        elif is_newer or (work.was_accepted and not has_ended):
            self._has_begun = True  # What waits was behind it, and has not begun
            self._events.resume_abort(work, now, effects, is_newer=is_newer)
        elif has_ended:
            if self._unconfirmed.are_open:
                _accept(work, effects)
            if self._events.is_in_the_air:
                note = f"{self._events.reason_nothing_ends}; the missions that waited were ended"
                effects.for_edge.append(work.answer("refused", note))
            else:
                effects.for_edge.append(work.answer("done"))
        else:
            refusal = work.answer("refused", self._events.reason_nothing_ends)
            effects.for_edge.append(refusal)

    def _end_waiting(self, work: EventWork, effects: Effects) -> bool:
        """End the missions that wait, for an abort; whether there were any."""
        ended = [mission for mission in self._waiting if _concerns(work, mission)]
        for mission in ended:
            self._waiting.remove(mission)
            if mission.is_confirmed:
                mission.abort(REASONS[work.event.event_type_id], effects)
            else:
                self._unconfirmed.drop(mission.work.work_id, mission.abort, work.event)
                effects.for_edge.append(mission.work.answer("accepted"))
        self._unconfirmed.hold_answer(work)
        return bool(ended)

    def _is_droppable(self, mission: MissionExecutor) -> bool:
        """Whether nothing has been ordered for the mission yet."""
        return not mission.is_confirmed and not self.vehicle.hovers

    def due_for_edge(self, messages: Sequence[EdgeMessage]) -> list[EdgeMessage]:
        """Hold back the answer to an abort until all that it ended is known to be over."""
        return self._unconfirmed.due(messages)

    # Alarms, restarts, errors

    def raise_alarm(self, reason: str, now: float, effects: Effects) -> None:
        """Fail the mission in flight."""
        if self._current is not None:
            self._current.raise_alarm(reason, now, effects)

    def vehicle_restarted(self, reason: str, now: float, effects: Effects) -> None:
        """Note that the vehicle was restarted, or is another one: `reason` is which."""
        self._events.vehicle_restarted(effects)
        if self._current is not None:
            self._current.vehicle_restarted(reason, now, effects)

    def recall(self, record: RecoveryRecord, now: float, effects: Effects) -> None:
        """Restore what an earlier run of the broker has noted of the vehicle."""
        self.vehicle.recovery.recall(record, now)
        self._failed = record.pending_return
        mission = self._current
        if mission is not None and not mission.work.was_accepted:
            self.vehicle.recovery.clear_commands()
        if record.abort is not None:
            self._events.recall_abort(record.abort, now, effects)
        if record.pending_return is None:
            return
        self._events.recall_return(record.pending_return, now)
        reason = None if mission is None else self._reason_to_fail(mission)
        if mission is not None and mission.is_attaching and reason is not None:
            mission.fail_again(reason, now, effects)
            mission.answer_events(MISSION_ENDED, effects)
            self._current = None

    def fail_after_error(self, reason: str, now: float, effects: Effects) -> None:
        """Fail the mission in which an unexpected error has occurred; those that wait stay.

        Every event without an answer is refused: the error may have been its own.
        """
        self._events.refuse_all(reason, effects)
        if self._current is not None:
            self._current.fail_after_error(reason, now, effects)
            self.close_ended(effects)

    def drop_after_error(self, reason: str, now: float, effects: Effects) -> None:
        """Fail the mission without another hook of it, because its end has raised an error too."""
        del now
        mission, self._current = self._current, None
        self._events.refuse_all(reason, effects)
        if mission is None:
            return
        mission.answer_events(reason, effects)
        if not mission.ledger.status.is_terminal:
            mission.ledger.fail(reason)
            effects.for_edge.append(self._reporter.mission(mission.ledger))


def _accept(work: EventWork | MissionWork, effects: Effects) -> None:
    """Acknowledge that work is accepted, unless an earlier run of the broker has."""
    if not work.was_accepted:
        effects.for_edge.append(work.answer("accepted"))


def _concerns(work: EventWork, mission: MissionExecutor) -> bool:
    """Whether an event is about a mission; one from an earlier run, if that came before."""
    return not work.was_accepted or mission.work.work_id < work.work_id
