"""The vehicles' pages in the journal: whose each is, what is noted, what an earlier run left."""

import logging
from collections.abc import Callable
from typing import Final

from mavlink_broker.effects import Effects
from mavlink_broker.peers import Journal
from mavlink_broker.recovery.progress import Diary, Note
from mavlink_broker.recovery.record import NOTHING, Memo, Owner, merged
from mavlink_broker.session import Session
from mavlink_broker.vehicle.vehicle import Vehicle

NAMELESS: Final = ""
"""Number of a vehicle that has told none, or not yet."""

_LOG = logging.getLogger(__name__)


class Bookkeeping:
    """All pages of one broker; without a journal there are none."""

    def __init__(self, journal: Journal | None) -> None:
        self._journal = journal

    def new_diary(self) -> Diary:
        """Give a vehicle something to be noted in."""
        return Diary(in_use=self._journal is not None)

    def open(self, session: Session, now: float, effects: Effects) -> None:
        """Recall what an earlier run has noted of a vehicle, once it is known which one it is.

        One that tells its own number late takes its page with it; another one in its place gets
        a page of its own.
        """
        vehicle = session.vehicle
        system, before = vehicle.route.target_system, vehicle.diary.owner
        owner = Owner(system, vehicle.uid)
        if self._journal is None or not vehicle.is_identified or owner == before:
            return
        if before is not None and (not owner.uid or not self._may_change(session, before)):
            return
        on_disk = self._journal.recall(owner)
        nameless = self._journal.recall(Owner(system, NAMELESS))
        vehicle.diary.open(owner, on_disk)
        self._hand_out(merged(on_disk, nameless), session, now, effects)
        if owner.uid and nameless != NOTHING:
            self.note(vehicle, now)  # On its own page first
            self._journal.put(Note(Owner(system, NAMELESS), 0, NOTHING))

    def note(self, vehicle: Vehicle, now: float) -> bool:
        """Note what is new of a vehicle; whether all of it is on the disk, or never will be."""
        note = vehicle.diary.see(vehicle.memo, now)
        if note is not None and self._journal is not None:
            self._journal.put(note)
        return vehicle.diary.is_settled

    def settle(self, find: Callable[[int], Session | None]) -> None:
        """Learn what is on the disk; sessions are found by system id."""
        if self._journal is None:
            return
        for owner, number in self._journal.take_settled():
            session = find(owner.system)
            if session is not None and session.vehicle.diary.owner == owner:
                session.vehicle.diary.settle(number)

    def _may_change(self, session: Session, before: Owner) -> bool:
        return before.uid == NAMELESS or session.change_vehicle()

    def _hand_out(self, recalled: Memo, session: Session, now: float, effects: Effects) -> None:
        if recalled != NOTHING:
            number = session.vehicle.vehicle_id
            _LOG.info("vehicle %d: an earlier run of the broker has left notes of it", number)
            session.recall(recalled, now, effects)
