"""Events before they are carried out, and what an earlier run of the broker began for one.

A broker that has just started is handed events together with the missions that they are about,
before it has heard the vehicle. They wait for that. An event that was accepted and has ended its
mission already is seen through: the vehicle goes where it was sent. So is the return that an alarm
has ordered.

Of several aborts the newest one decides, by the numbers of their work, in whichever order they
become known; the older ones are answered with that as soon as the newest is carried out.
"""

from collections.abc import Callable
from typing import Final

from afarcloud.enumerations import EventType
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.edge.work import EventWork
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.abort_executor import Ending, abort_note, coming_home, noted_event
from mavlink_broker.mission.event_execution import REPLACED
from mavlink_broker.recovery.record import AbortNote, Homeward
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import Claim, InCommand
from mavlink_broker.vehicle.vehicle import Vehicle

EXPIRED = "expired"
TELLS_WITHIN_S: Final = 3.0
"""How long a vehicle may take to tell where it is and how its sensors are."""
RESTARTED = "the vehicle was restarted since"
_COMES_DOWN: Final = Claim(control_authority.COMING_DOWN)
_WAITS: Final = Claim(control_authority.ON_THE_WAY)


class EventDesk:
    """The events of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._held: list[EventWork] = []
        self._due: list[EventWork] = []  # Being carried out
        self._leaving: tuple[EventWork | None, Ending] | None = None  # None: for an alarm
        self._known_since: float | None = None  # A vehicle that an earlier run has sent home
        self._noted_s: float | None = None  # When an abort of an earlier run was noted
        self._homeward: Homeward | None = None  # Ordered by an earlier run, until that is judged
        self._stale: set[int] = set()  # Accepted for a flight before the vehicle was restarted
        self._is_return_broken = False  # By a restart of the vehicle
        self._newest_abort = 0  # Work id of the newest one that was carried out
        self.leaves_hovering = False  # What was last seen through has ended in a hover

    @property
    def is_leaving(self) -> bool:
        """Whether an event of an earlier run is seen through."""
        return self._leaving is not None

    def is_before(self, work_id: int) -> bool:
        """Whether something has to end before this work may begin: an abort that came first."""
        if self._leaving is not None or self._homeward is not None:
            return True
        return any(is_abort(held) and held.work_id < work_id for held in self._held)

    @property
    def is_waiting(self) -> bool:
        """Whether there is something that the vehicle is still to be ordered."""
        return bool(self._held) or self._leaving is not None or self._homeward is not None

    def put(self, work: EventWork) -> None:
        """Take an event, unless it is known from the journal already."""
        leaving = None if self._leaving is None else self._leaving[0]
        known = (*self._held, *self._due, leaving)
        if work.work_id not in {each.work_id for each in known if each}:
            self._held.append(work)

    def recall_abort(self, note: AbortNote) -> None:
        """Take an abort that an earlier run has accepted; the edge server may have forgotten it."""
        event = noted_event(note, self._vehicle.vehicle_id)
        self._noted_s = note.noted_s
        self.put(EventWork(work_id=note.work_id, event=event, was_accepted=True))

    def take_due(
        self, is_too_early: Callable[[EventWork], bool], now: float, effects: Effects
    ) -> list[EventWork]:
        """Give what may be carried out by now, in order; what has expired meanwhile is refused.

        What is given remains the desk's until `forget`, so that an error does not lose it.
        """
        self._answer_replaced(self._newest_abort, effects)
        due = [
            work
            for work in self._held
            if not is_too_early(work) and not self._awaits_news(work, now)
        ]
        newest = max((work.work_id for work in due if is_abort(work)), default=0)
        due = [work for work in due if not is_abort(work) or work.work_id == newest]
        self._held = [work for work in self._held if work not in due]
        for work in list(self._held):
            late = work.expires_at is not None and now >= work.expires_at
            if late and not work.was_accepted:
                self._held.remove(work)
                effects.for_edge.append(Acknowledgement(work.work_id, "refused", EXPIRED))
        self._due += due
        return due

    def _awaits_news(self, work: EventWork, now: float) -> bool:
        """Whether an abort of an earlier run needs what a new broker has yet to receive.

        The vehicle's clock shows whether it was restarted. Without a home no place can be ordered,
        and without a position the vehicle lands.
        """
        of_earlier_run = work.was_accepted or self.is_before(work.work_id)
        snapshot = self._vehicle.snapshot
        if not (is_abort(work) and of_earlier_run and snapshot.armed):
            return False
        leads = work.event.abort is not None or not _aborts_now(work)
        lacks_place = snapshot.home is None or not snapshot.knows_whether_placed
        lacks_time = self._noted_s is not None and snapshot.time_s is None
        if not (lacks_time or (leads and lacks_place)):
            return False
        self._known_since = self._known_since or now
        return now - self._known_since < TELLS_WITHIN_S

    def forget(self, work_id: int) -> None:
        """Drop an event that was carried out, or that the caller answers."""
        self._held = [work for work in self._held if work.work_id != work_id]
        self._due = [work for work in self._due if work.work_id != work_id]

    def refuse_all(self, reason: str, effects: Effects) -> None:
        """Refuse every event without an answer, and give up what is seen through."""
        vehicle = self._vehicle
        leaving = None if self._leaving is None else self._leaving[0]
        for work in (*self._due, *self._held, leaving):
            if work is not None:
                effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))
                vehicle.abort = None
        if self._leaving is not None or self._homeward is not None:
            vehicle.homeward = None
        self._due, self._held = [], []
        self._leaving = self._homeward = None

    def see_through(
        self, work: EventWork, now: float, effects: Effects, *, is_newer: bool = False
    ) -> None:
        """Send the vehicle where an abort leads, unless it descends already or another has it.

        `is_newer`: it replaces what the vehicle is doing, so that it has not been obeyed yet.
        """
        vehicle = self._vehicle
        seen = vehicle.seen
        vehicle.abort = None
        who = control_authority.in_command(seen, _COMES_DOWN)
        comes_down = vehicle.family.knows_modes and seen.role is ModeRole.ENDING and not is_newer
        if not work.was_accepted:
            effects.for_edge.append(Acknowledgement(work.work_id, "accepted"))
        if who is not InCommand.BROKER:
            vehicle.is_taken = True
            refusal = Acknowledgement(work.work_id, "refused", control_authority.reason(who, seen))
            effects.for_edge.append(refusal)
        elif work.was_accepted and (work.work_id in self._stale or self._is_past(self._noted_s)):
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", RESTARTED))
        elif not seen.armed or comes_down:
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))
        else:
            vehicle.ordered = None if is_newer else vehicle.ordered
            ending = Ending(work.event, vehicle)
            vehicle.abort = abort_note(work.event, work.work_id, vehicle)
            self._leaving = work, ending
            effects.messages += ending.start(now)

    def _is_past(self, noted_s: float | None) -> bool:
        """Whether the vehicle was switched off since that was noted, so that it is over."""
        time_s = self._vehicle.snapshot.time_s
        return time_s is not None and noted_s is not None and time_s < noted_s

    def restarted(self, effects: Effects) -> None:
        """Take that the vehicle was restarted: nothing of before is seen through any more."""
        self._stale |= {work.work_id for work in self._held if work.was_accepted}
        self._is_return_broken |= self._homeward is not None
        if self._homeward is not None or self._leaving is not None:
            self._vehicle.homeward = self._vehicle.abort = None
        leaving, self._leaving, self._homeward = self._leaving, None, None
        if leaving is not None:
            self._is_return_broken |= leaving[0] is None
            _acknowledge(leaving[0], effects, RESTARTED)

    def take_broken_return(self) -> bool:
        """Whether a restart of the vehicle has ended the return that an alarm had ordered, once."""
        is_broken, self._is_return_broken = self._is_return_broken, False
        return is_broken

    def replace(self, newest: EventWork, effects: Effects) -> bool:
        """Answer every older abort, and leave the vehicle to this one.

        Gives whether the vehicle is, or was to be, sent somewhere by an older one or by an alarm.
        """
        is_sent = self._answer_replaced(newest.work_id, effects) or self.is_leaving
        is_sent |= self._homeward is not None
        self._newest_abort = max(self._newest_abort, newest.work_id)
        if self._leaving is not None:
            _acknowledge(self._leaving[0], effects, done=REPLACED)
            self._leaving = None
        self._homeward = self._vehicle.homeward = self._vehicle.abort = None
        return is_sent

    def _answer_replaced(self, newest: int, effects: Effects) -> bool:
        """Answer the held aborts that came before; whether an earlier run had accepted one."""
        older = [work for work in self._held if is_abort(work) and work.work_id < newest]
        self._held = [work for work in self._held if work not in older]
        for work in older:
            status = "done" if work.was_accepted else "refused"
            effects.for_edge.append(Acknowledgement(work.work_id, status, REPLACED))
        return any(work.was_accepted for work in older)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        return [] if self._leaving is None else self._leaving[1].receive(message, now)

    def step(self, now: float, effects: Effects) -> None:
        """Let time pass."""
        if self._homeward is not None:
            self._come_home(now, effects)
        if self._leaving is None:
            return
        vehicle = self._vehicle
        work, ending = self._leaving
        effects.messages += ending.tick(now)
        if ending.is_over:
            self._leaving = vehicle.abort = None
            self.leaves_hovering = ending.leaves_hovering
            _acknowledge(work, effects, ending.taken)

    def recall(self, homeward: Homeward) -> None:
        """Learn that an alarm has ended a mission, and that the vehicle had not obeyed yet."""
        self._homeward = homeward

    def _come_home(self, now: float, effects: Effects) -> None:
        """Go on with an alarm's order, unless the vehicle comes down or another hand flies it."""
        vehicle = self._vehicle
        if vehicle.snapshot.armed is None or not vehicle.is_identified:
            return
        self._known_since = self._known_since or now
        if not vehicle.snapshot.knows_whether_placed and now - self._known_since < TELLS_WITHIN_S:
            return  # One without a position is ordered to land, not to return
        homeward, self._homeward = self._homeward, None
        self._is_return_broken |= homeward is not None and self._is_past(homeward.noted_s)
        is_over = self._is_return_broken
        is_over |= control_authority.in_command(vehicle.seen, _WAITS) is not InCommand.BROKER
        if not vehicle.snapshot.armed or is_over:
            vehicle.homeward = None
        else:
            ending = Ending(coming_home(vehicle.vehicle_id), vehicle)
            self._leaving = None, ending
            effects.messages += ending.start(now)


def _acknowledge(
    work: EventWork | None, effects: Effects, taken: str | None = None, *, done: str | None = None
) -> None:
    if work is not None:
        status = "done" if taken is None else "refused"
        effects.for_edge.append(Acknowledgement(work.work_id, status, taken or done))


def _aborts_now(work: EventWork) -> bool:
    return work.event.event_type_id is EventType.ABORT_MISSION


def is_abort(work: EventWork) -> bool:
    """Whether an event ends a mission."""
    return work.event.event_type_id is not EventType.DRONE_SPEED
