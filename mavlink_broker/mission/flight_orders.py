"""Events after which a mission goes on: pause, resume, another speed, at first a soft abort.

    flies --PAUSE_MISSION--> ordered to hold --holds--> paused
    paused --RESUME_MISSION--> ordered to fly on --flies--> flies

A mission that is paused stays RUNNING. Mission items go on where they were. A command that is flown
live begins anew: the vehicle has left it. Between two segments the vehicle holds anyway, so a pause
that comes while items are transferred is ordered as soon as they fly.

A vehicle may obey two orders in reverse if the second was sent before the first was
answered: the network may deliver them so. A hold behind a resume is then the mission paused again,
which an event can resume; a vehicle that flies on behind a pause is ordered to hold again.

Who pauses a vehicle resumes it: a pause by another system is not ended by an event, and an event
orders nothing while another system is in command.

`SpeedChanges` orders another speed while a mission flies or is transferred to the vehicle. The
items of a segment set the speed of their upload. So a speed that comes during the transfer is
ordered behind it, and a speed that was changed is ordered again behind each item that sets another.

`SoftAbort` waits for the command that is flown to end; then it ends the mission.
"""

from typing import Final

from mavlink_broker.autopilots.flight_modes import LIVE_MODES, ModeRole
from mavlink_broker.edge.wire import EventWork
from mavlink_broker.effects import Effects
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    CommandAlternatives,
    CommandSequence,
    Refused,
)
from mavlink_broker.mission.segments import Segments
from mavlink_broker.mission.states import ENDING, IN_FLIGHT, WITH_ITEMS, State
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.planning.situation import speed_command
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import HELD_BY_FAILSAFE, Authority
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.vehicle import Vehicle

REPLACED: Final = "a later event replaced it"
"""Answer to an event behind which a newer one decides what the vehicle does."""
FLIES_NO_COMMAND: Final = "the vehicle flies no command of this mission: it can only be aborted"
NOT_PAUSED: Final = "no event has paused the mission"
MAY_BE_OBEYED: Final = "the vehicle may have obeyed"
PAUSED: Final = "paused by an event"
RESUMED: Final = "resumed"
PAUSED_INSTEAD: Final = "a later event has paused the mission"
ACCEPTED_MODE_WITHIN_S: Final = 5.0
"""How long a vehicle may take to show a mode that it has accepted."""
LATE_WITHIN_S: Final = 30.0
"""How long behind an order without an answer the vehicle may still obey it."""
COMMAND_WITHIN_S: Final = 30.0
"""How long a soft abort waits for the running command, by the vehicle's time."""
_FLYING_ITEMS: Final = frozenset({ModeRole.MISSION, ModeRole.ENDING})
_READY_FOR_LIVE: Final = frozenset({ModeRole.HOLD, ModeRole.GUIDED})


class PauseOrders:
    """Whether an event has paused one mission, and the order that is not answered yet."""

    def __init__(self, vehicle: Vehicle, mission: str) -> None:
        """`mission` is the name of its work; the journal knows by it what an earlier run paused."""
        self._vehicle = vehicle
        self._mission = mission
        self._work: EventWork | None = None  # Waits for its answer
        self._pauses = False  # What it asks for
        self._sequence: CommandSequence | None = None  # None: it waits until items fly
        self._resumed_in: frozenset[ModeRole] = frozenset()  # Modes that show a resume
        self._shown_until: float | None = None  # The vehicle has accepted the order
        self._late_until = 0.0  # An order to hold may still arrive
        self._resumes_until = 0.0  # An order to fly on may still arrive
        self._change: bool | None = None  # Paused or resumed, and not written into a report yet

    @property
    def is_paused(self) -> bool:
        """Whether an event has paused the mission, from the order on; in the journal."""
        return self._vehicle.recovery.paused == self._mission

    @property
    def has_obeyed(self) -> bool:
        """Whether the vehicle has obeyed an order to hold."""
        return self.is_paused and not (self._pauses and self._sequence is not None)

    def take_change(self) -> bool | None:
        """Whether the mission has been paused (True) or resumed since the last call, if either."""
        change, self._change = self._change, None
        return change

    def assume(self, last_note: str | None) -> None:
        """Take a mission of an earlier run as paused if its last report is that.

        The journal holds the same, unless it could not be written.
        """
        if last_note == PAUSED:
            self._vehicle.recovery.paused = self._mission

    def pause(
        self, work: EventWork, state: State, who: Authority, now: float, effects: Effects
    ) -> None:
        """Hold where the vehicle is; `state` is that of a mission whose vehicle is in the air."""
        if self._refuses(work, state, who, effects):
            return
        if self._vehicle.snapshot.armed is False:
            effects.for_edge.append(work.answer("refused", FLIES_NO_COMMAND))
            return
        if (reason := self._held_by_another) is not None:
            effects.for_edge.append(work.answer("refused", reason))
            return
        rests = self.is_paused and self._sequence is None and self._holds
        if self._sequence is not None and not self._pauses:
            self._resumes_until = now + LATE_WITHIN_S
        self._answer("refused", REPLACED, effects)
        self._work, self._pauses = work, True
        if rests:
            self._answer("done", None, effects)
        elif state in {State.RUNNING, State.FLYING_LIVE}:
            self._order(self._vehicle.family.pausing, now, effects)

    def resume(
        self,
        work: EventWork,
        state: State,
        who: Authority,
        now: float,
        effects: Effects,
        *,
        has_items: bool,
    ) -> None:
        """Fly on; `has_items` if mission items are still to be flown in this segment."""
        if self._refuses(work, state, who, effects):
            return
        reason = None
        if not self.is_paused:
            reason = NOT_PAUSED
        elif self._vehicle.snapshot.armed is False:
            reason = FLIES_NO_COMMAND
        else:
            reason = self._held_by_another
        if reason is not None:
            effects.for_edge.append(work.answer("refused", reason))
            return
        if self._sequence is not None and self._pauses:
            self._late_until = now + LATE_WITHIN_S
        self._answer("refused", REPLACED, effects)
        self._work, self._pauses = work, False
        family = self._vehicle.family
        if state is State.RUNNING and has_items:
            self._resumed_in = _FLYING_ITEMS
            self._order(family.resuming, now, effects)
        elif state is State.FLYING_LIVE or self._vehicle.mode == family.paused_mode:
            # The next command is flown live, which needs a mode in which the vehicle is guided
            self._resumed_in = _READY_FOR_LIVE
            self._order(family.holding, now, effects)
        else:
            self._settle_as(is_paused=False, effects=effects)

    @property
    def _held_by_another(self) -> str | None:
        """Why no event pauses or resumes it: another system or its failsafe decides.

        Where modes are not known, only its state shows that it returns or lands by itself.
        """
        vehicle = self._vehicle
        if not vehicle.family.knows_modes and vehicle.in_failsafe:
            return HELD_BY_FAILSAFE
        foreign = vehicle.foreign_order
        if foreign is None:
            return None
        return f"system {foreign.system} has paused or moved the vehicle meanwhile"

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle the answer of the vehicle."""
        if self._sequence is not None:
            effects.messages += self._sequence.receive(message, now)
            self._judge(now, effects)

    def tick(self, state: State, who: Authority, now: float, effects: Effects) -> None:
        """Repeat what is overdue, order what waited, and observe whether the vehicle still holds.

        Nothing is ordered while another system is in command.
        """
        if self._work is not None and who is not Authority.BROKER:
            seen = self._vehicle.observed_mode
            if self._pauses:  # The vehicle may obey late, and is not the mission's any more
                self._late_until, self._vehicle.recovery.paused = 0.0, None
            self._answer("refused", control_authority.reason(who, seen), effects)
        if self._work is not None and self._sequence is None:
            if state in {State.RUNNING, State.FLYING_LIVE}:
                self._order(self._vehicle.family.pausing, now, effects)
        elif self._sequence is not None:
            effects.messages += self._sequence.tick(now)
            self._judge(now, effects)
        else:
            self._observe(who, now, effects)

    def cancel(self, reason: str, effects: Effects) -> None:
        """End with the mission: nothing is paused any more, an event that waits is refused."""
        self._answer("refused", reason, effects)
        self._late_until = self._resumes_until = 0.0
        if self.is_paused:
            self._vehicle.recovery.paused = None

    def _refuses(self, work: EventWork, state: State, who: Authority, effects: Effects) -> bool:
        reason = None
        if state in ENDING:
            reason = MISSION_ENDED
        elif who is not Authority.BROKER:
            reason = control_authority.reason(who, self._vehicle.flown_mode)
        if reason is not None:
            effects.for_edge.append(work.answer("refused", reason))
        return reason is not None

    def _answer(self, status: str, message: str | None, effects: Effects) -> None:
        """Answer the event that waits, and order nothing more for it."""
        work, self._work = self._work, None
        self._sequence = self._shown_until = None
        if work is not None:
            effects.for_edge.append(work.answer(status, message))

    def _order(self, alternatives: CommandAlternatives, now: float, effects: Effects) -> None:
        vehicle = self._vehicle
        vehicle.recovery.paused = self._mission  # Before the vehicle can hold
        vehicle.forget_foreign_order()
        if self._pauses:
            vehicle.note_pause_order(now)
        self._sequence = vehicle.sequence(alternatives)
        effects.messages += self._sequence.start(now)

    def _judge(self, now: float, effects: Effects) -> None:
        """Answer when the vehicle has obeyed, refused, or does not show what it has accepted."""
        outcome = None if self._sequence is None else self._sequence.outcome
        if isinstance(outcome, Refused):
            is_answered = outcome.result is not None
            if not is_answered and self._vehicle.family.knows_modes and self._is_obeyed:
                self._settle_as(is_paused=self._pauses, effects=effects)  # Its answer was lost
                return
            reason = outcome.reason if is_answered else f"{outcome.reason}, {MAY_BE_OBEYED}"
            self._refuse(reason, now, effects)
        elif isinstance(outcome, Accepted):
            self._shown_until = self._shown_until or now + ACCEPTED_MODE_WITHIN_S
            if self._is_obeyed:
                self._settle_as(is_paused=self._pauses, effects=effects)
            elif now >= self._shown_until:
                stays = f"the vehicle accepts it and stays in {self._vehicle.mode}"
                self._refuse(stays, now, effects)

    def _refuse(self, reason: str, now: float, effects: Effects) -> None:
        """Refuse the event; a vehicle that has not answered may still obey an order to hold."""
        if self._pauses:
            self._late_until = now + LATE_WITHIN_S
            self._vehicle.recovery.paused = None
        self._answer("refused", reason, effects)

    def _settle_as(self, *, is_paused: bool, effects: Effects) -> None:
        self._answer("done", None, effects)
        self._note(is_paused=is_paused)

    def _note(self, *, is_paused: bool) -> None:
        self._change = is_paused
        if is_paused:
            self._late_until = 0.0
            self._vehicle.recovery.paused = self._mission
        else:
            self._vehicle.recovery.paused = None

    @property
    def _holds(self) -> bool:
        """Whether the vehicle holds; without known modes its answers count."""
        vehicle = self._vehicle
        is_hold = vehicle.mode_role is ModeRole.HOLD or vehicle.mode == vehicle.family.paused_mode
        return not vehicle.family.knows_modes or is_hold

    @property
    def _is_obeyed(self) -> bool:
        return self._holds if self._pauses else self._flies_on

    @property
    def _flies_on(self) -> bool:
        """Whether the vehicle is in a mode in which it continues."""
        vehicle = self._vehicle
        return not vehicle.family.knows_modes or vehicle.mode_role in self._resumed_in

    def _observe(self, who: Authority, now: float, effects: Effects) -> None:
        """Notice what follows an order late, and a mission that somebody else resumed."""
        vehicle = self._vehicle
        if not vehicle.family.knows_modes or not vehicle.snapshot.armed:
            return
        is_late = now < self._late_until and vehicle.foreign_order is None
        if is_late and not self.is_paused and self._holds and not vehicle.is_held_by_failsafe:
            self._note(is_paused=True)
        elif self.is_paused and self._is_flown_on:
            resumes_late = now < self._resumes_until and vehicle.foreign_order is None
            if resumes_late and who is Authority.BROKER:
                self._pauses = True
                self._order(vehicle.family.pausing, now, effects)
            else:
                self._note(is_paused=False)

    @property
    def _is_flown_on(self) -> bool:
        vehicle = self._vehicle
        return vehicle.mode_role is ModeRole.MISSION or vehicle.mode in LIVE_MODES


MISSION_ENDED: Final = "the mission has ended"
_CIRCLE: Final[int] = mavlink.MAV_CMD_NAV_LOITER_TURNS


class SpeedChanges:
    """The speed of one mission; a later change replaces an earlier one."""

    def __init__(self, vehicle: Vehicle, segments: Segments) -> None:
        self._vehicle = vehicle
        self._segments = segments
        self._running: tuple[EventWork | None, CommandSequence] | None = None
        self._may_refuse = False
        self._late_speed_m_s: float | None = None  # Came while the items were being transferred
        self._has_changed = False
        self._is_new = False  # It was ordered behind all items so far
        self._repeated_behind: tuple[int, int] | None = None  # Segment, last item with a speed

    def resume(self) -> None:
        """Note that an earlier run of the broker may have changed the speed."""
        self._has_changed = True

    def change(
        self,
        work: EventWork,
        speed_m_s: float,
        state: State,
        who: Authority,
        now: float,
        effects: Effects,
    ) -> None:
        """Fly at another speed [m/s] from now on; items of a transfer stay as they are.

        A vehicle in a live command may refuse: an orbit has its own speed, and everything behind
        it is flown at the new one anyway. One that follows a target gets it as a parameter.
        """
        if state in ENDING:
            effects.for_edge.append(work.answer("refused", MISSION_ENDED))
            return
        self._late_speed_m_s = speed_m_s if state in WITH_ITEMS else None
        if self._late_speed_m_s is None:
            self._segments.set_speed(speed_m_s)
        if state not in IN_FLIGHT:
            effects.for_edge.append(work.answer("done"))
        elif who is not Authority.BROKER:
            reason = control_authority.reason(who, self._vehicle.flown_mode)
            effects.for_edge.append(work.answer("refused", reason))
        else:
            self._may_refuse = state is State.FLYING_LIVE
            if self._may_refuse:  # A follower's speed is a parameter
                self._vehicle.override(self._segments.live.action.overrides)
            if self._running is not None and self._running[0] is not None:
                reason, earlier = "a later event gives another speed", self._running[0]
                effects.for_edge.append(earlier.answer("refused", reason))
            self._order(work, now, effects)

    def order_late(self, state: State, now: float, effects: Effects) -> None:
        """Order the speed that came during a transfer, when that is over."""
        speed_m_s = self._late_speed_m_s
        if speed_m_s is None or state in WITH_ITEMS:
            return
        self._late_speed_m_s = None
        self._segments.set_speed(speed_m_s)
        if state is State.RUNNING:
            self._order(None, now, effects)

    def repeat(self, now: float, effects: Effects) -> None:
        """Order a changed speed again behind items that set the one of the upload."""
        plan, mission = self._segments.plan, self._vehicle.snapshot.mission
        if mission is None:
            return
        flown = [seq for seq in _mission_speeds(plan) if seq < mission.seq]
        place = (plan.first_command, flown[-1]) if flown else None
        if self._is_new:
            self._is_new, self._repeated_behind = False, place
        if self._running is not None:
            return
        if place is not None and place != self._repeated_behind:
            self._repeated_behind = place
            if self._has_changed:
                self._order(None, now, effects)

    def cancel(self, reason: str, effects: Effects) -> None:
        """Order no speed any more; an event that waits is refused."""
        work = None if self._running is None else self._running[0]
        self._running = None
        if work is not None:
            effects.for_edge.append(work.answer("refused", reason))

    def _order(self, work: EventWork | None, now: float, effects: Effects) -> None:
        alternatives = ((speed_command(self._leg_speed_m_s),),)
        sequence = self._vehicle.sequence(alternatives)
        self._has_changed = self._is_new = True
        self._running = work, sequence
        effects.messages += sequence.start(now)

    @property
    def _leg_speed_m_s(self) -> float:
        """Speed of the leg that is flown, as the items would set it now."""
        plan, mission = self._segments.plan, self._vehicle.snapshot.mission
        flown = [] if mission is None else [n for n in _mission_speeds(plan) if n < mission.seq]
        return plan.items[flown[-1]].parameters[1] if flown else self._segments.speed_m_s

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle the answer."""
        if self._running is not None:
            effects.messages += self._running[1].receive(message, now)
            self._settle(effects)

    def tick(self, now: float, effects: Effects) -> None:
        """Repeat what is overdue."""
        if self._running is not None:
            effects.messages += self._running[1].tick(now)
            self._settle(effects)

    def _settle(self, effects: Effects) -> None:
        if self._running is None or self._running[1].outcome is None:
            return
        (work, sequence), self._running = self._running, None
        status, message = "done", None
        if isinstance(sequence.outcome, Refused):
            message = sequence.outcome.reason
            if self._may_refuse:
                message = f"from the next command on: {message}"
            else:
                status = "refused"
        if work is not None:
            effects.for_edge.append(work.answer(status, message))


def _mission_speeds(plan: FlightPlan) -> list[int]:
    """Find the items that set the speed of the mission, not that of a circle behind them."""
    found: list[int] = []
    speeds: list[int] = []
    for seq, item in enumerate(plan.items):
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            speeds.append(seq)
        elif item.command <= mavlink.MAV_CMD_NAV_LAST:
            found += speeds[:-1] if item.command == _CIRCLE else speeds
            speeds = []
    return found


class SoftAbort:
    """The soft abort of one mission that waits for the running command, if there is one."""

    def __init__(self, vehicle: Vehicle, ledger: MissionLedger) -> None:
        self.work: EventWork | None = None
        """The event that waits."""
        self.since = 0.0
        """When the newest one came, on the broker's clock [s]."""
        self._vehicle = vehicle
        self._ledger = ledger
        self._command: int | None = None  # Running when it came; None: it waits for nothing
        self._deadline_s = 0.0  # By the vehicle's time

    def begin(self, work: EventWork, now: float, effects: Effects, *, waits: bool) -> None:
        """Wait for the running command, or (not `waits`) for nothing.

        Another event changes the place, not the deadline.
        """
        if self.work is None:
            self._command = self._ledger.finished if waits else None
            self._deadline_s = self._vehicle.time_s(now) + COMMAND_WITHIN_S
            if work.was_accepted and work.expires_at is not None:
                # It waits since before its expiry
                self._deadline_s -= max(0.0, now - work.expires_at)
        self.answer("done", REPLACED, effects)
        self.work, self.since = work, now

    def take_due(self, now: float) -> EventWork | None:
        """Give the event if the mission ends by it now; it waits no more."""
        has_ended = self._command is None or self._ledger.commands[self._command].is_terminal
        return self.take() if has_ended or self._vehicle.time_s(now) >= self._deadline_s else None

    def take(self) -> EventWork | None:
        """Give the event that waits; it waits no more."""
        work, self.work = self.work, None
        return work

    def answer(self, status: str, message: str | None, effects: Effects) -> None:
        """Answer the event that waits; what replaces it has ended the mission if it is "done"."""
        work = self.take()
        if work is not None:
            effects.for_edge.append(work.answer(status, message))
