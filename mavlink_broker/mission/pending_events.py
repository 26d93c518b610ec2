"""Events that wait, the aborts of an earlier run of the broker, and when an answer may be sent.

A broker that has just started receives events together with the missions that they are about,
before it is connected to the vehicle. They wait for that. An event that was accepted and has ended
its mission already is resumed: the vehicle goes where it was sent. So is the return that an alarm
has ordered.

Of several aborts the newest one decides, by the numbers of their work, in whichever order they
arrive; the older ones are answered as replaced as soon as the newest is carried out.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Final, NamedTuple

from afarcloud.enumerations import EventType
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.edge.wire import EventWork
from mavlink_broker.effects import Acknowledgement, EdgeMessage, Effects
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission.abort_executor import (
    AbortExecutor,
    abort_note,
    noted_event,
    return_event,
)
from mavlink_broker.mission.flight_orders import REPLACED
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import AIRBORNE, DESCENDING, Authority
from mavlink_broker.vehicle.lost_mission import ABORT_ENDS_IT
from mavlink_broker.vehicle.recovery_state import PendingAbort, PendingReturn
from mavlink_broker.vehicle.vehicle import Vehicle

NO_MISSION = "no active mission"
TOO_MANY = "too many events wait for the vehicle"
MAX_WAITING: Final = 32
"""Events of one vehicle that wait; those that an earlier run has accepted are not counted."""
EDGE_WITHIN_S: Final = 5.0
"""How long an order that only the journal knows waits for the work of the edge server."""
EVENT_TELEMETRY_WITHIN_S: Final = 3.0
"""How long a vehicle may take to send its position and the state of its sensors."""
TOO_OLD: Final = "accepted too long ago by an earlier run of the broker: not carried on"
RESTARTED_SINCE: Final = "the vehicle was restarted since"
FLOWN_SINCE: Final = "a later mission flies since: whether the vehicle obeyed is not known"
NOT_SEEN: Final = "the vehicle lands, or has landed: whether it was there before is not known"
LANDED_UNSEEN: Final = "the vehicle has landed unseen: it may have flown its mission to the end"


class ReplacedOrders(NamedTuple):
    """What the vehicle does, or is to do, by orders that a newer abort replaces."""

    is_sent: bool  # An older abort or an alarm has sent it somewhere, or was about to
    is_noted: bool  # In the journal: an earlier run of the broker was about to order it, or has


class PendingEvents:
    """The events of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._waiting: list[EventWork] = []
        self._due: list[EventWork] = []  # Being carried out
        self._running: tuple[EventWork | None, AbortExecutor] | None = None  # None: for an alarm
        self._connected_since: float | None = None  # A vehicle that an earlier run has sent home
        self._noted_s: float | None = None  # When an abort of an earlier run was noted
        self._return: PendingReturn | None = None  # Ordered by an earlier run, not resumed yet
        self._return_until = -math.inf  # The edge server may still hand out what has flown since
        self._stale: set[int] = set()  # Accepted for a flight before the vehicle was restarted
        self._is_return_interrupted = False  # By a restart of the vehicle
        self._noted_until: dict[int, float] = {}  # Aborts by the journal alone, while they wait
        self._limited: set[int] = set()  # Events that came without a mission
        self._too_old: set[int] = set()  # Accepted so long ago that they are about another flight
        self._has_ended: set[int] = set()  # Aborts that have ended missions, and wait
        self._newest: tuple[int, str | None] = (0, None)  # Abort: work id, and why it was refused
        self.leaves_hovering = False  # The last abort has ended in a hover
        self.sends_down = False  # Or has ordered a return or a landing

    @property
    def is_aborting(self) -> bool:
        """Whether an abort of an earlier run, or a newer one, is carried out here."""
        return self._running is not None

    def is_before(self, work_id: int) -> bool:
        """Whether something has to end before this work may begin: an abort that came first."""
        if self._running is not None or self._return is not None:
            return True
        return any(waiting.is_abort and waiting.work_id < work_id for waiting in self._waiting)

    @property
    def is_waiting(self) -> bool:
        """Whether there is something that the vehicle is still to be ordered."""
        return bool(self._waiting) or self._running is not None or self._return is not None

    @property
    def waiting(self) -> tuple[EventWork, ...]:
        """What is still to be carried out."""
        return tuple(self._waiting)

    def add(self, work: EventWork, effects: Effects, *, is_too_old: bool = False) -> None:
        """Queue an event; one that is known from the journal already was accepted."""
        running = None if self._running is None else self._running[0]
        self._forget_noted(work)
        known = (*self._waiting, *self._due, running)
        same = next((each for each in known if each and each.is_same_as(work)), None)
        self._noted_until.pop(work.work_id, None)
        if same is None:
            self._waiting.append(work)
            if is_too_old:
                self._too_old.add(work.work_id)
        elif same.was_accepted and not work.was_accepted:
            effects.for_edge.append(work.answer("accepted"))

    def _forget_noted(self, work: EventWork) -> None:
        """Forget a noted abort whose number another abort has: it is of a database that was lost.

        The other one is newer.
        """
        for noted in self._waiting if work.is_abort else ():
            is_noted = noted.work_id in self._noted_until
            if is_noted and noted.work_id == work.work_id and not noted.is_same_as(work):
                self.remove(noted.work_id)
                self._vehicle.recovery.abort = None

    def waits_for_edge(self, work: EventWork, now: float) -> bool:
        """Whether the edge server may still hand out what has flown since an abort was noted."""
        return now < self._noted_until.get(work.work_id, -math.inf)

    def end_before(self, work_id: int, mission: str, effects: Effects) -> None:
        """End the orders of an earlier run that were over when a mission of it began.

        No mission begins before an abort or an alarm's return has ended: the disk did not take it.
        """
        for work in self._waiting:
            if work.was_accepted and work.is_abort and work.work_id < work_id:
                self.remove(work.work_id)
                self._vehicle.recovery.abort = None
                effects.for_edge.append(work.answer("refused", FLOWN_SINCE))
        if self._return is not None and self._return.mission != mission:
            self._return = self._vehicle.recovery.pending_return = None

    def limit_wait(self, work_id: int, latest: float) -> None:
        """Let a new event, which came without a mission, expire at a time [s] or before."""
        self._limited.add(work_id)
        for index, work in enumerate(self._waiting):
            if work.work_id == work_id and (work.expires_at is None or latest < work.expires_at):
                self._waiting[index] = replace(work, expires_at=latest)

    def is_limited(self, work: EventWork) -> bool:
        """Whether an event is new, and came when there was no mission."""
        return work.work_id in self._limited and not work.was_accepted

    def note_ended_missions(self, work: EventWork) -> None:
        """Note that an abort has ended missions, and waits for the vehicle itself."""
        self._has_ended.add(work.work_id)

    def has_ended_missions(self, work: EventWork) -> bool:
        """Whether an abort that waits for the vehicle has ended missions."""
        return work.work_id in self._has_ended

    def limit_number(self, effects: Effects) -> None:
        """Refuse the oldest of too many waiting events; the newest one counts most."""
        new = [work for work in self._waiting if not work.was_accepted]
        for work in new[: max(0, len(new) - MAX_WAITING)]:
            self.remove(work.work_id)
            effects.for_edge.append(work.answer("refused", TOO_MANY))

    @property
    def is_in_the_air(self) -> bool:
        """Whether the vehicle flies, so that an abort that does not move it has not stopped it."""
        vehicle = self._vehicle
        landed = vehicle.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        return bool(vehicle.snapshot.armed) and not landed and not vehicle.stays_on_ground

    @property
    def may_be_ours(self) -> bool:
        """Whether the journal may still show that a vehicle flies or hovers for the broker."""
        recovery = self._vehicle.recovery
        is_sought = recovery.hover.is_sought or recovery.descent.is_sought
        return is_sought or recovery.lost_mission.is_sought or not recovery.tracker.is_loaded

    @property
    def is_ours(self) -> bool:
        """Whether a vehicle without a mission waits for the broker, or flies its orders."""
        vehicle = self._vehicle
        flies = vehicle.own_descent.is_flown or vehicle.recovery.lost_mission.is_flown
        return vehicle.hovers or flies

    @property
    def reason_without_mission(self) -> str:
        """Why an event that needs a mission is refused where none is known."""
        is_flown = self._vehicle.recovery.lost_mission.is_flown
        return f"{NO_MISSION}: {ABORT_ENDS_IT}" if is_flown else NO_MISSION

    @property
    def reason_nothing_ends(self) -> str:
        """Why an abort finds no mission, and who can move a vehicle that is in the air."""
        if not self.is_in_the_air:
            return NO_MISSION
        who = "where another system or its pilot has to move it"
        return f"{NO_MISSION}: the vehicle is in {self._vehicle.mode}, {who}"

    def recall_abort(self, note: PendingAbort, now: float, effects: Effects) -> None:
        """Restore an abort that an earlier run was about to order, or has.

        The edge server may have forgotten it, or may not know yet that it was accepted. It may also
        know that it is over, where the disk took no later note: then a mission flies since.
        """
        event = noted_event(note, self._vehicle.vehicle_id)
        self._noted_s = note.noted_s
        self._too_old.discard(note.work_id)
        self._limited.discard(note.work_id)
        noted = EventWork(
            work_id=note.work_id, event=event, was_accepted=True, identity=note.identity
        )
        others = [work for work in self._waiting if not work.is_same_as(noted)]
        if any(work.is_abort and work.work_id == noted.work_id for work in others):
            self._vehicle.recovery.abort = None
            return  # It is of a database that was lost, and a newer abort has its number
        same = [work for work in self._waiting if work.is_same_as(noted)]
        self._waiting = [work for work in self._waiting if work not in same]
        if noted.identity is None and same:
            noted = replace(noted, identity=same[0].identity)
        self.add(noted, effects)
        if not same:
            self._noted_until[note.work_id] = now + EDGE_WITHIN_S
        if any(not work.was_accepted for work in same):
            effects.for_edge.append(noted.answer("accepted"))

    def take_due(
        self, is_too_early: Callable[[EventWork], bool], now: float, effects: Effects
    ) -> list[EventWork]:
        """Give what may be carried out by now, in order; what has expired meanwhile is refused.

        They stay known until `remove`, so that an error does not lose them.
        """
        self._refuse_too_old(effects)
        newest_id, refusal = self._newest
        for work in self._take_older(newest_id):
            _acknowledge(work, effects, refusal, done=REPLACED)
        due = [
            work
            for work in self._waiting
            if not is_too_early(work) and not self._needs_telemetry(work, now)
        ]
        newest = max((work.work_id for work in due if work.is_abort), default=0)
        due = [work for work in due if not work.is_abort or work.work_id == newest]
        self._waiting = [work for work in self._waiting if work not in due]
        self.refuse_expired(now, effects)
        self._due += due
        return due

    def _refuse_too_old(self, effects: Effects) -> None:
        """Refuse what is too old, once the journal is read, which may know it."""
        if not self._vehicle.recovery.tracker.is_loaded:
            return
        for work in [w for w in (*self._waiting, *self._due) if w.work_id in self._too_old]:
            self.remove(work.work_id)
            effects.for_edge.append(work.answer("refused", TOO_OLD))

    def refuse_expired(self, now: float, effects: Effects) -> None:
        """Refuse the waiting events that have expired, with what they have waited for."""
        self._refuse_too_old(effects)
        for work in list(self._waiting):
            if work.is_expired(now):
                answer = work.answer("refused", self._reason_of_expiry)
                if self.has_ended_missions(work):
                    note = f"{self._reason_of_expiry}: only the missions that waited were ended"
                    answer = work.answer("done", note)
                self.remove(work.work_id)
                effects.for_edge.append(answer)

    @property
    def _reason_of_expiry(self) -> str:
        """What the vehicle has not sent in time."""
        vehicle = self._vehicle
        if vehicle.snapshot.armed is None:
            return f"vehicle {vehicle.vehicle_id} is not known"
        if vehicle.recovery.hover.is_sought and vehicle.snapshot.position is None:
            return f"the position of vehicle {vehicle.vehicle_id} is not known"
        return "expired"

    def _needs_telemetry(self, work: EventWork, now: float) -> bool:
        """Whether an abort needs telemetry that has not arrived yet at a broker that just started.

        The vehicle's clock shows whether it was restarted since an abort of an earlier run. Without
        a home no place can be ordered, and without a position the vehicle lands.
        """
        of_earlier_run = work.was_accepted or self.is_before(work.work_id)
        snapshot = self._vehicle.snapshot
        if not work.is_abort or snapshot.armed is None:
            return False
        lands_here = work.event.event_type_id is EventType.ABORT_MISSION
        leads = snapshot.armed and (work.event.abort is not None or not lands_here)
        lacks_place = snapshot.home is None or not snapshot.knows_whether_placed
        lacks_time = of_earlier_run and self._noted_s is not None and snapshot.time_s is None
        if not (lacks_time or (leads and lacks_place)):
            return False
        self._connected_since = self._connected_since or now
        return now - self._connected_since < EVENT_TELEMETRY_WITHIN_S

    def remove(self, work_id: int) -> None:
        """Drop an event that was carried out, or that the caller answers."""
        self._waiting = [work for work in self._waiting if work.work_id != work_id]
        self._due = [work for work in self._due if work.work_id != work_id]
        self._limited.discard(work_id)
        self._has_ended.discard(work_id)
        self._too_old.discard(work_id)

    def refuse_all(self, reason: str, effects: Effects) -> None:
        """Refuse every event without an answer, and end the abort that is carried out."""
        vehicle = self._vehicle
        running = None if self._running is None else self._running[0]
        for work in (*self._due, *self._waiting, running):
            if work is not None:
                effects.for_edge.append(work.answer("refused", reason))
                vehicle.recovery.abort = None
        if self._running is not None or self._return is not None:
            vehicle.recovery.pending_return = None
        self._due, self._waiting = [], []
        self._limited.clear()
        self._has_ended.clear()
        self._too_old.clear()
        self._running = self._return = None

    def resume_abort(
        self, work: EventWork, now: float, effects: Effects, *, is_newer: bool
    ) -> None:
        """Send the vehicle where an abort leads, unless it descends already or another has it.

        `is_newer`: it replaces what the vehicle is doing, so that it has not been obeyed yet.
        """
        vehicle = self._vehicle
        seen = vehicle.observed_mode
        vehicle.recovery.abort = None
        hover_mode = vehicle.recovery.hover.own_mode(seen)
        lost_mission = vehicle.recovery.lost_mission
        flown_mode = hover_mode or lost_mission.own_mode(seen)
        own_mode = flown_mode or vehicle.own_descent.own_mode(seen)
        who = control_authority.authority_of(seen, DESCENDING._replace(mode=own_mode))
        comes_down = vehicle.family.knows_modes and seen.role is ModeRole.ENDING and not is_newer
        if not work.was_accepted:
            effects.for_edge.append(work.answer("accepted"))
        if who is not Authority.BROKER:
            vehicle.armed_period.take_away()
            effects.for_edge.append(work.answer("refused", control_authority.reason(who, seen)))
        elif self.is_past(work):
            effects.for_edge.append(work.answer("refused", RESTARTED_SINCE))
        elif comes_down or (not seen.armed and vehicle.shows_itself(now)):
            if comes_down:
                vehicle.begin_descent()
            is_seen = comes_down or not work.was_accepted
            note = NOT_SEEN if work.event.abort else None if is_seen else LANDED_UNSEEN
            effects.for_edge.append(work.answer("done", note))
        else:
            if is_newer:
                vehicle.forget_foreign_order()
            executor = AbortExecutor(
                work.event,
                vehicle,
                was_ours=is_newer or hover_mode is not None,
                replaces=is_newer and flown_mode is None,
            )
            lost_mission.end()
            vehicle.recovery.abort = abort_note(work.event, work, vehicle)
            self._running = work, executor
            effects.messages += executor.start(now)

    def is_past(self, work: EventWork) -> bool:
        """Whether the vehicle was switched off since an earlier run accepted an event."""
        was_restarted = work.work_id in self._stale or self._is_past(self._noted_s)
        return work.was_accepted and was_restarted

    def _is_past(self, noted_s: float | None) -> bool:
        """Whether the vehicle was switched off since that was noted, so that it is over."""
        time_s = self._vehicle.snapshot.time_s
        return time_s is not None and noted_s is not None and time_s < noted_s

    def vehicle_restarted(self, effects: Effects) -> None:
        """Note that the vehicle was restarted: nothing from before is resumed."""
        self._stale |= {work.work_id for work in self._waiting if work.was_accepted}
        self._is_return_interrupted |= self._return is not None
        if self._return is not None or self._running is not None:
            self._vehicle.recovery.pending_return = None
            self._vehicle.recovery.abort = None
        running, self._running, self._return = self._running, None, None
        if running is not None:
            self._is_return_interrupted |= running[0] is None
            _acknowledge(running[0], effects, RESTARTED_SINCE)

    def take_interrupted_return(self) -> bool:
        """Whether a restart of the vehicle has ended the return that an alarm had ordered, once."""
        was_interrupted, self._is_return_interrupted = self._is_return_interrupted, False
        return was_interrupted

    @contextmanager
    def replacing(self, newest: EventWork, effects: Effects) -> Iterator[ReplacedOrders]:
        """Leave the vehicle to this abort, and answer the older ones as it afterwards."""
        older = self._take_older(newest.work_id)
        noted = self._vehicle.recovery.abort
        was_sent = noted is not None and noted.work_id in {work.work_id for work in older}
        ended = self._has_ended & {work.work_id for work in older}
        self._has_ended = (self._has_ended - ended) | ({newest.work_id} if ended else set())
        is_sent = any(work.was_accepted for work in older) or self.is_aborting
        is_sent |= self._return is not None
        if self._running is not None and self._running[0] is not None:
            older.append(self._running[0])
        self._running = self._return = None
        self._vehicle.recovery.pending_return = None
        self._vehicle.recovery.abort = None
        before = len(effects.for_edge)
        refusal: str | None = "an internal error in a later event"
        try:
            yield ReplacedOrders(is_sent, was_sent)
            refusal = _refusal_of(newest, effects.for_edge[before:])
        finally:
            if newest.work_id >= self._newest[0]:
                self._newest = newest.work_id, refusal
            for work in older:
                _acknowledge(work, effects, refusal, done=REPLACED)

    def _take_older(self, newest: int) -> list[EventWork]:
        older = [work for work in self._waiting if work.is_abort and work.work_id < newest]
        self._waiting = [work for work in self._waiting if work not in older]
        return older

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""
        return [] if self._running is None else self._running[1].receive(message, now)

    def tick(self, now: float, effects: Effects) -> None:
        """Do what is due at a time."""
        if self._return is not None:
            self._resume_return(now, effects)
        if self._running is None:
            return
        work, executor = self._running
        effects.messages += executor.tick(now)
        if executor.is_over(now):
            self._running = None
            self._vehicle.recovery.abort = None
            self.leaves_hovering = executor.leaves_hovering
            self.sends_down = executor.sends_down
            _acknowledge(work, effects, executor.taken, done=executor.instead)

    def recall_return(self, pending: PendingReturn, now: float) -> None:
        """Restore a return that an alarm had ordered, and that the vehicle had not obeyed yet."""
        self._return, self._return_until = pending, now + EDGE_WITHIN_S

    def _resume_return(self, now: float, effects: Effects) -> None:
        """Resume an alarm's order, unless the vehicle descends or another system flies it."""
        vehicle = self._vehicle
        if vehicle.snapshot.armed is None or not vehicle.is_identified:
            return
        self._connected_since = self._connected_since or now
        if (
            not vehicle.snapshot.knows_whether_placed
            and now - self._connected_since < EVENT_TELEMETRY_WITHIN_S
        ):
            return  # One without a position is ordered to land, not to return
        if now < self._return_until:
            return
        pending, self._return = self._return, None
        self._is_return_interrupted |= pending is not None and self._is_past(pending.noted_s)
        who = control_authority.authority_of(vehicle.observed_mode, AIRBORNE)
        is_over = self._is_return_interrupted or who is not Authority.BROKER
        if not vehicle.snapshot.armed or is_over:
            vehicle.recovery.pending_return = None
            if vehicle.mode_role is ModeRole.ENDING and not self._is_return_interrupted:
                vehicle.begin_descent()  # It has obeyed
        else:
            executor = AbortExecutor(return_event(vehicle.vehicle_id), vehicle)
            self._running = None, executor
            effects.messages += executor.start(now)


def _acknowledge(
    work: EventWork | None, effects: Effects, taken: str | None = None, *, done: str | None = None
) -> None:
    if work is not None:
        status = "done" if taken is None else "refused"
        effects.for_edge.append(work.answer(status, taken or done))


def _refusal_of(work: EventWork, messages: Sequence[EdgeMessage]) -> str | None:
    """Give why an event was refused; None if it was not."""
    answers = (one for one in messages if isinstance(one, Acknowledgement))
    refusals = (one for one in answers if one.work_id == work.work_id and one.status == "refused")
    return next((one.message for one in refusals), None)
