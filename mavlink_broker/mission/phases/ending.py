"""FAILING, ABORTING: the mission ends before its last command has.

FAILING: something was refused or went wrong, and the vehicle may still send its reasons.

ABORTING: an event or an alarm has ended the mission, and the vehicle is sent to its destination. A
vehicle that flies items goes on with them until an order has reached it: its progress counts until
then, and the mission ends with its first obedience. If none reaches it, it flies the mission to its
end, and the mission is finished.
"""

from typing import Final

from afarcloud.plan import Event as AbortEvent
from mavlink_broker.edge.wire import EventWork
from mavlink_broker.effects import Effects
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.abort_executor import (
    LATE_ORDER_S,
    AbortExecutor,
    abort_note,
    within_fence,
)
from mavlink_broker.mission.context import (
    PROGRESS_WITHIN_S,
    RESTARTED,
    RETURN_ENDED,
    MissionContext,
    SegmentMonitors,
)
from mavlink_broker.mission.phases.phase import Fault, Phase, Request, Result
from mavlink_broker.mission.progress_monitor import ProgressMonitor
from mavlink_broker.mission.states import ARMED_BY_BROKER, ASKING, IN_FLIGHT, Event, State
from mavlink_broker.vehicle.alarms import is_navigation_failure, mission_error, unhealthy_parts
from mavlink_broker.vehicle.control_authority import (
    AIRBORNE_MODES,
    FAILSAFE_AFTER_S,
    HOVERING,
    TAKEN,
    TAKEOVER_AFTER_S,
    Authority,
    Claim,
)
from mavlink_broker.vehicle.recovery_state import PendingReturn

REASONS_WITHIN_S: Final = 0.5
"""How long a vehicle that refused something may take to send its reason."""
REASONS_BEFORE_S: Final = 3.0
"""How long before a change of mode a vehicle may send its reason."""


class Failing(Phase):
    """The end of a mission that has failed."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._entered_at = 0.0
        self._fault = Fault("")
        self._stops_propellers = False  # The broker armed the vehicle, and it does not take off
        self._was_in_flight = False
        self._flew_unseen = False  # Part of it: the alarm of what failed then may be missing
        self._raises_alarm = False
        self._is_left_to_failsafe = False
        self._is_taken = False  # Another system, or a failsafe, has the vehicle
        self._waits_in_air = False  # And no other system flies it
        self._may_take_off = False  # It was ordered to start; in the air it refuses to disarm
        self._waiting: Claim | None = None  # What shows that it still waits; None: it does not

    @property
    def claim(self) -> Claim | None:
        """The mode in which the broker has armed the vehicle, until it is left.

        None of a vehicle that was taken: an abort that comes now must not order it.
        """
        if self._is_taken:
            return TAKEN
        if not self._stops_propellers:
            return None
        return Claim(AIRBORNE_MODES, mode=self._mission.authority.arming_mode)

    def prepare(self, fault: Fault, state: State, phase: Phase, effects: Effects) -> None:
        """Judge a fault in the phase in which it occurs; the transition to this one ends that."""
        mission, vehicle = self._mission, self._vehicle
        who = mission.authority.who(phase.claim)
        is_taken, was_taken = who is not Authority.BROKER, phase.was_taken
        self._fault = fault
        self._is_taken = is_taken or (was_taken and bool(vehicle.snapshot.armed))
        if self._is_taken:
            vehicle.armed_period.take_away()
        elif phase.flies_another:
            vehicle.armed_period.lose()  # An event may still end it
        armed_by_broker = state in ARMED_BY_BROKER and not mission.is_hovering
        self._stops_propellers = armed_by_broker and not is_taken
        if self._stops_propellers:
            effects.messages += exchanges.disarming(vehicle)
        self._may_take_off = self._stops_propellers and mission.is_start_ordered
        self._flew_unseen = mission.was_running and fault.reason != RESTARTED
        held, self._was_in_flight = vehicle.is_held_by_failsafe, state in IN_FLIGHT
        # What a failsafe does is no alarm (its cause may be one), nor is what another system does
        others = {who, phase.landed_by} - {None, Authority.BROKER}
        self._raises_alarm = self._was_in_flight and not others and not held
        self._is_left_to_failsafe = held or Authority.FAILSAFE in others
        is_begun = mission.is_hovering and mission.was_reported_running
        waits = state in ASKING and is_begun and not was_taken
        self._waits_in_air = (waits or phase.was_given_up) and not is_taken
        is_free = not self._is_taken and not mission.authority.is_lost
        still = HOVERING._replace(mode=vehicle.mode)  # Also that in which an event has paused it
        self._waiting = still if is_free and not phase.flies_another else None

    def forget_vehicle(self) -> None:
        """Give no further order: the vehicle was restarted."""
        self._waits_in_air = self._stops_propellers = self._may_take_off = False
        self._waiting = None

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle waits in the air, and no other system has taken it."""
        vehicle = self._vehicle
        if self._waiting is None or not vehicle.snapshot.armed or vehicle.is_standing_armed:
            return False
        return self._mission.authority.who(self._waiting) is Authority.BROKER

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin to wait for the vehicle's reasons."""
        del effects
        self._entered_at = now
        return None

    @property
    def _reasons_since(self) -> float:
        """The time from which on the vehicle has sent reasons; before a flight, its beginning.

        What it has sent earlier in a flight belongs to something else, such as another system's
        order that it has refused.
        """
        began_at = self._mission.began_at
        if not self._was_in_flight:
            return began_at
        noticed_s = FAILSAFE_AFTER_S if self._is_left_to_failsafe else TAKEOVER_AFTER_S
        return max(began_at, self._entered_at - noticed_s - REASONS_BEFORE_S)

    def tick(self, now: float, effects: Effects) -> Result:
        """Report the failure with the vehicle's reasons.

        A vehicle that waits in the air returns; one that may take off disarms, or lands.
        """
        if now - self._entered_at < REASONS_WITHIN_S:
            return None
        mission, vehicle = self._mission, self._vehicle
        if self._stops_propellers and mission.authority.who(self.claim) is Authority.BROKER:
            effects.messages += exchanges.disarming(vehicle)  # The first order may be lost
        reasons = vehicle.status_texts_since(self._reasons_since)
        text = f"{self._fault.reason} ({reasons})" if reasons else self._fault.reason
        parts = unhealthy_parts(vehicle.snapshot.unhealthy) if self._flew_unseen else ""
        if parts and vehicle.shows_itself(now):
            text += f"; {parts}"
        left = self._is_left_to_failsafe and is_navigation_failure(reasons or "")
        if self._raises_alarm or left:
            mission_id = mission.work.mission.mission_id
            effects.for_edge.append(mission.reporter.alarm(mission_error(text), mission_id))
        mission.ledger.fail(text, self._fault.command)
        mission.report(effects)
        is_free = not vehicle.armed_period.is_taken and not mission.authority.is_lost
        may_fly = self._waits_in_air or self._may_take_off
        comes_home = may_fly and is_free and vehicle.snapshot.armed
        return Request.RETURN_HOME if comes_home else Event.ENDED


CAME_DOWN_UNANSWERED: Final = (
    "the vehicle has landed and answered no order: it may have flown its mission to the end"
)
FLOWN_TO_ITS_END: Final = "the vehicle flew its mission to the end: no order has reached it"
MAY_BE_FLOWN: Final = "it may have been flown: the progress of the vehicle was not received"


class Aborting(Phase):
    """One abort after the other; the newest one decides."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._executor: AbortExecutor | None = None
        self._note: str | None = None  # What is done otherwise than the event orders
        self._work: EventWork | None = None  # None: an alarm has ended the mission
        self._monitors: SegmentMonitors | None = None  # Of what it flies until it obeys, if any
        self._reason = ""  # Why the mission ends then
        self._shown_at: float | None = None  # Since when it is received
        self._is_flown_to_end = False  # The mission was finished before an order arrived

    def follow(self, monitors: SegmentMonitors, reason: str) -> None:
        """Follow the items that the vehicle flies until it obeys; the mission ends then."""
        self._monitors, self._reason, self._shown_at = monitors, reason, None

    def end_mission(self, effects: Effects) -> None:
        """Report the end of a mission that was followed, with what has been flown until now."""
        monitors, self._monitors = self._monitors, None
        ledger = self._mission.ledger
        if monitors is None or ledger.status.is_terminal:
            return
        if monitors.progress.lacks_progress or monitors.changes.is_suspicious:
            ledger.note_open(MAY_BE_FLOWN)
        self._mission.abort(self._reason, effects)

    def end_now(
        self,
        reason: str,
        monitors: SegmentMonitors | None,
        now: float,
        effects: Effects,
        *,
        is_unknown: bool,
    ) -> None:
        """End the mission for an abort, with what is known to have been flown.

        `monitors` follow what was in flight, if anything was; `is_unknown` if nobody has looked.
        """
        if monitors is not None:
            effects.for_edge += monitors.progress.step(now)
            is_unknown |= monitors.progress.lacks_progress
        self.end_mission(effects)
        ledger = self._mission.ledger
        if not ledger.status.is_terminal:
            if is_unknown:
                ledger.note_open(MAY_BE_FLOWN)
            self._mission.abort(reason, effects)

    @property
    def is_following(self) -> bool:
        """Whether the mission has not ended yet."""
        return self._monitors is not None

    def order(self, event: AbortEvent, work: EventWork | None, now: float) -> None:
        """Set what the vehicle is to do; the transition to this phase begins it.

        `work` is None where an alarm has ended the mission.
        """
        mission, vehicle = self._mission, self._vehicle
        vehicle.forget_foreign_order()
        event, self._note = within_fence(event, mission.area, vehicle)
        arms_until = now + LATE_ORDER_S if mission.authority.is_arming_ordered else None
        replaces = self._executor is not None and self._executor.sends_down
        self._executor = AbortExecutor(
            event, vehicle, was_ours=True, replaces=replaces, arms_until=arms_until
        )
        self._work = work
        if work is not None:
            vehicle.recovery.abort = abort_note(event, work, vehicle)
            return
        vehicle.recovery.abort = None
        vehicle.recovery.pending_return = PendingReturn(
            mission=mission.work.name,
            reason=mission.ledger.message or "",
            noted_s=vehicle.snapshot.time_s,
        )

    def enter(self, now: float, effects: Effects) -> Result:
        """Give the first order."""
        if self._executor is not None:
            effects.messages += self._executor.start(now)
        return None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle."""
        if self._executor is not None:
            effects.messages += self._executor.receive(message, now)
        if self._monitors is not None:
            self._monitors.receive(message, now, effects)

    def _follow(self, executor: AbortExecutor, now: float, effects: Effects) -> None:
        """Note what the vehicle has flown, and end the mission when it flies no more of it."""
        if self._monitors is None or self._mission.ledger.status.is_terminal:
            self._monitors = None
            return
        monitors, ledger = self._monitors, self._mission.ledger
        progress, changes = monitors.progress, monitors.changes
        monitors.abort_skipped(ledger)
        effects.for_edge += progress.step(now)
        effects.messages += changes.tick(now)
        if ledger.status.is_terminal:
            self._monitors = None
            self._is_flown_to_end = True
            return
        lands_itself = progress.lands_itself
        is_landing = lands_itself and executor.has_come_down_unanswered
        is_other = changes.loss_reason is not None or progress.holds_another
        is_other |= changes.is_suspicious  # It cannot be read while no order reaches the vehicle
        is_open = is_landing and not is_other and progress.loss_reason is None
        if self._awaits_progress(progress, now):
            return
        if is_open and not executor.is_unheard(now):  # Whether it stands shows later
            return
        if is_other or not executor.may_fly_on(now, lands_itself=lands_itself):
            self.end_mission(effects)

    def _awaits_progress(self, progress: ProgressMonitor, now: float) -> bool:
        """Whether a vehicle that is received again may show soon what it has flown meanwhile."""
        if not self._vehicle.shows_itself(now):
            progress.lacks_progress = True
            self._shown_at = None
            return False
        self._shown_at = now if self._shown_at is None else self._shown_at
        return progress.lacks_progress and now - self._shown_at < PROGRESS_WITHIN_S

    def tick(self, now: float, effects: Effects) -> Result:
        """Repeat what is overdue until the vehicle has obeyed."""
        if self._executor is None:
            return None
        effects.messages += self._executor.tick(now)
        self._follow(self._executor, now, effects)
        if self._monitors is not None or not self._executor.is_over(now):
            return None
        is_unanswered = self._executor.has_come_down_unanswered
        if is_unanswered and self._is_flown_to_end:
            self.refuse(FLOWN_TO_ITS_END, effects)
        self.acknowledge(effects, CAME_DOWN_UNANSWERED if is_unanswered else None)
        return Event.ENDED

    @property
    def leaves_hovering(self) -> bool | None:
        """Whether the vehicle hovers afterwards; None: there was no abort."""
        return None if self._executor is None else self._executor.leaves_hovering

    @property
    def sends_down(self) -> bool:
        """Whether an abort has ordered the vehicle to return or to land."""
        return self._executor is not None and self._executor.sends_down

    def who(self, now: float) -> Authority | None:
        """Decide who is in command of the vehicle; None: there was no abort."""
        return None if self._executor is None else self._executor.who(now)

    def acknowledge(self, effects: Effects, instead: str | None = None) -> None:
        """Acknowledge once that an event has been carried out, or what replaces it."""
        if self._executor is not None and self._work is not None:
            taken = self._executor.taken
            status = "done" if taken is None else "refused"
            note = taken or instead or self._executor.instead or self._note
            effects.for_edge.append(self._work.answer(status, note))
            self._vehicle.recovery.abort = None
            self._work = None

    def refuse(self, reason: str, effects: Effects) -> None:
        """Refuse an event that cannot be carried out to its end, if there is one."""
        if self._work is not None:
            effects.for_edge.append(self._work.answer("refused", reason))
            self._vehicle.recovery.abort = None
            self._work = None

    def drop(self) -> None:
        """Give no further order."""
        self._executor = self._monitors = None

    def vehicle_restarted(self, effects: Effects) -> None:
        """End an abort, or a return that an alarm has ordered: the vehicle was restarted."""
        self.end_mission(effects)
        if self._work is None:
            failure = mission_error(RETURN_ENDED)
            mission_id = self._mission.work.mission.mission_id
            effects.for_edge.append(self._mission.reporter.alarm(failure, mission_id))
        self.refuse(RESTARTED, effects)
        self._executor = None
