"""The vehicles' records in the journal: stored after each change, recalled after a restart."""

import logging
from collections.abc import Callable
from typing import Final

from mavlink_broker.effects import Effects
from mavlink_broker.interfaces import Journal
from mavlink_broker.recovery.record import (
    EMPTY_RECORD,
    RecoveryRecord,
    VehicleIdentity,
    merge_records,
)
from mavlink_broker.recovery.record_tracker import RecordTracker, RecordUpdate
from mavlink_broker.session import Session
from mavlink_broker.vehicle.vehicle import Vehicle

NO_NUMBER: Final = ""
"""Number of a vehicle that has sent none, or not yet."""

_LOG = logging.getLogger(__name__)


class VehicleRecords:
    """All records of one broker; without a journal there are none."""

    def __init__(self, journal: Journal | None) -> None:
        self._journal = journal

    def new_tracker(self) -> RecordTracker:
        """Make the tracker of a new vehicle."""
        return RecordTracker(in_use=self._journal is not None)

    def recall(self, session: Session, now: float, effects: Effects) -> None:
        """Recall what an earlier run has noted of a vehicle, once its identity is known.

        A vehicle that sends its number late keeps its record; another vehicle in its place gets a
        record of its own.
        """
        vehicle = session.vehicle
        system, before = vehicle.route.target_system, vehicle.recovery.tracker.identity
        identity = VehicleIdentity(system, vehicle.uid)
        if self._journal is None or not vehicle.is_identified or identity == before:
            return
        if before is not None and (not identity.uid or not self._may_change(session, before)):
            return
        on_disk = self._journal.recall(identity)
        without_number = self._journal.recall(VehicleIdentity(system, NO_NUMBER))
        vehicle.recovery.tracker.load(identity, on_disk)
        self._recall(merge_records(on_disk, without_number), session, now, effects)
        if identity.uid and without_number != EMPTY_RECORD:
            self.store(vehicle, now)  # Under its own number first
            self._journal.put(RecordUpdate(VehicleIdentity(system, NO_NUMBER), 0, EMPTY_RECORD))

    def store(self, vehicle: Vehicle, now: float) -> bool:
        """Store what has changed; whether all of it is on the disk, or never will be."""
        update = vehicle.recovery.tracker.update(vehicle.recovery.record, now)
        if update is not None and self._journal is not None:
            self._journal.put(update)
        return vehicle.recovery.tracker.is_settled

    def confirm(self, find: Callable[[int], Session | None]) -> None:
        """Take which records are on the disk; `find` gives the session of a system id."""
        if self._journal is None:
            return
        for identity, number in self._journal.take_settled():
            session = find(identity.system)
            if session is not None and session.vehicle.recovery.tracker.identity == identity:
                session.vehicle.recovery.tracker.confirm(number)

    def _may_change(self, session: Session, before: VehicleIdentity) -> bool:
        return before.uid == NO_NUMBER or session.change_vehicle()

    def _recall(
        self, recalled: RecoveryRecord, session: Session, now: float, effects: Effects
    ) -> None:
        if recalled != EMPTY_RECORD:
            number = session.vehicle.vehicle_id
            _LOG.info("vehicle %d: an earlier run of the broker has left a record of it", number)
            session.missions.recall(recalled, now, effects)
