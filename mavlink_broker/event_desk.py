"""Events before they are carried out, and what an earlier run of the broker began for one.

A broker that has just started is handed events together with the missions that they are about,
before it has heard the vehicle. They wait for that. An event that was accepted and has ended its
mission already is seen through: the vehicle goes where it was sent. So is the return that an alarm
has ordered.
"""

from collections.abc import Callable
from typing import Final

from afarcloud.enumerations import EventType
from mavlink_broker.dialect import Message
from mavlink_broker.effects import Acknowledgement, Effects
from mavlink_broker.ending import Ending, coming_home
from mavlink_broker.journal.memo import Homeward
from mavlink_broker.translation.modes import ModeRole
from mavlink_broker.vehicle import Vehicle
from mavlink_broker.work import EventWork

EXPIRED = "expired"
ANOTHER_HAND = "another hand flies the vehicle"
_OVER: Final = frozenset({ModeRole.ENDING, ModeRole.OTHER})


class EventDesk:
    """The events of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._held: list[EventWork] = []
        self._leaving: tuple[EventWork | None, Ending] | None = None  # None: for an alarm
        self._homeward: Homeward | None = None  # Ordered by an earlier run, until that is judged
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

    def put(self, work: EventWork) -> None:
        """Take an event."""
        self._held.append(work)

    def take_due(
        self, is_too_early: Callable[[EventWork], bool], now: float, effects: Effects
    ) -> list[EventWork]:
        """Give what may be carried out by now, in order; what has expired meanwhile is refused."""
        due = [work for work in self._held if not is_too_early(work)]
        self._held = [work for work in self._held if is_too_early(work)]
        for work in list(self._held):
            late = work.expires_at is not None and now >= work.expires_at
            if late and not work.was_accepted:
                self._held.remove(work)
                effects.for_edge.append(Acknowledgement(work.work_id, "refused", EXPIRED))
        return due

    def see_through(self, work: EventWork, now: float, effects: Effects) -> None:
        """Send the vehicle where an abort said, unless it is on its way down or another has it."""
        vehicle = self._vehicle
        knows_modes, role = vehicle.family.knows_modes, vehicle.mode_role
        if not vehicle.snapshot.armed or (knows_modes and role is ModeRole.ENDING):
            effects.for_edge.append(Acknowledgement(work.work_id, "done"))
        elif knows_modes and role is ModeRole.OTHER:
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", ANOTHER_HAND))
        else:
            ending = Ending(work.event, vehicle)
            self._leaving = work, ending
            effects.messages += ending.start(now)

    def give_way(self, effects: Effects) -> None:
        """Leave the vehicle to a newer event."""
        if self._leaving is not None:
            _acknowledge(self._leaving[0], effects)
            self._leaving = None
        self._homeward = self._vehicle.homeward = None

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        return [] if self._leaving is None else self._leaving[1].receive(message, now)

    def step(self, now: float, effects: Effects) -> None:
        """Let time pass."""
        if self._homeward is not None:
            self._come_home(now, effects)
        if self._leaving is None:
            return
        work, ending = self._leaving
        effects.messages += ending.tick(now)
        if ending.is_over:
            self._leaving = None
            self.leaves_hovering = ending.leaves_hovering
            _acknowledge(work, effects)

    def recall(self, homeward: Homeward) -> None:
        """Learn that an alarm has ended a mission, and that the vehicle had not obeyed yet."""
        self._homeward = homeward

    def _come_home(self, now: float, effects: Effects) -> None:
        """Go on with an alarm's order, unless the vehicle comes down or another hand flies it."""
        vehicle = self._vehicle
        if vehicle.snapshot.armed is None or not vehicle.is_identified:
            return
        self._homeward = None
        is_over = vehicle.family.knows_modes and vehicle.mode_role in _OVER
        if not vehicle.snapshot.armed or is_over:
            vehicle.homeward = None
        else:
            ending = Ending(coming_home(vehicle.vehicle_id), vehicle)
            self._leaving = None, ending
            effects.messages += ending.start(now)


def _acknowledge(work: EventWork | None, effects: Effects) -> None:
    if work is not None:
        effects.for_edge.append(Acknowledgement(work.work_id, "done"))


def is_abort(work: EventWork) -> bool:
    """Whether an event ends a mission."""
    return work.event.event_type_id is not EventType.DRONE_SPEED
