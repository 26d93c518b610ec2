"""Tracks whether the newest recovery record of a vehicle is on the disk; pure.

A command that changes a vehicle waits until its record is stored; so do the messages to the edge
server that follow from it. After a refusal of the disk nothing waits, after two seconds without an
answer neither: a bad disk ends no flight.
"""

import logging
from dataclasses import dataclass
from typing import Final

from mavlink_broker.recovery.record import EMPTY_RECORD, RecoveryRecord, VehicleIdentity

WRITE_TIMEOUT_S: Final = 2.0

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RecordUpdate:
    """A record to be written; if it is empty, its row is removed."""

    identity: VehicleIdentity
    number: int
    record: RecoveryRecord


class RecordTracker:
    """The records of one vehicle. A tracker that is not in use stores and delays nothing."""

    def __init__(self, *, in_use: bool = False) -> None:
        self._in_use = in_use
        self._newest = EMPTY_RECORD
        self._number = 0
        self._settled = 0  # The newest record that is on the disk, or was refused
        self._waits_since: float | None = None
        self._is_slow = False  # An answer of the disk is overdue
        self.identity: VehicleIdentity | None = None  # None: not known yet

    @property
    def in_use(self) -> bool:
        """Whether there is a disk to write to."""
        return self._in_use

    @property
    def is_loaded(self) -> bool:
        """Whether the record of an earlier run is known by now."""
        return not self._in_use or self.identity is not None

    def load(self, identity: VehicleIdentity, record: RecoveryRecord) -> None:
        """Take the vehicle's identity and the record that is on the disk."""
        self.identity = identity
        self._newest = record
        self._settled = self._number
        self._waits_since = None

    def update(self, record: RecoveryRecord, now: float) -> RecordUpdate | None:
        """Compare with the newest record; gives the update to write, if it differs."""
        if self.identity is None:
            return None
        self._check_timeout(now)
        if record == self._newest:
            return None
        self._number += 1
        self._newest = record
        if self._waits_since is None:
            self._waits_since = now
        return RecordUpdate(self.identity, self._number, record)

    def confirm(self, number: int) -> None:
        """Mark an update as written, or as refused by the disk."""
        self._is_slow = False
        self._settled = max(self._settled, min(number, self._number))
        if self._settled == self._number:
            self._waits_since = None

    @property
    def is_settled(self) -> bool:
        """Whether no update has to be waited for."""
        return not self._in_use or self._is_slow or self._settled == self._number

    def is_stored(self, record: RecoveryRecord) -> bool:
        """Whether this record is on the disk, as far as the disk takes it."""
        if not self._in_use:
            return True
        return self.identity is not None and self.is_settled and record == self._newest

    def _check_timeout(self, now: float) -> None:
        if self._is_slow or self._waits_since is None:
            return
        if now - self._waits_since >= WRITE_TIMEOUT_S:
            self._is_slow = True
            _LOG.warning("%s: the disk does not take its record: no command waits", self.identity)
