"""The broker's journal on a disk that is as slow as a test wants, in simulated time."""

import shutil
from collections.abc import Callable
from pathlib import Path

from mavlink_broker.journal import decode_record, encode_record
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    RecordUpdate,
    RecoveryRecord,
    VehicleIdentity,
)

DISK_LAG_S = 0.05
"""A slow disk: a broker may die between a change and its note."""


class ScriptedDisk:
    """Writes records after a delay; those that are not written yet are lost with the broker."""

    def __init__(self, folder: Path, clock: Callable[[], float], lag_s: float = 0.0) -> None:
        folder.mkdir(exist_ok=True)
        self._folder = folder
        self._clock = clock
        self._lag_s = lag_s
        self._known: dict[VehicleIdentity, RecoveryRecord] = {}
        self._queued: list[tuple[float, RecordUpdate]] = []
        self.refuses = False
        self.is_stuck = False
        self.written = 0
        self.begin()

    def begin(self) -> None:
        """Read the records of an earlier run."""
        self._queued = []
        self._known = dict(decode_record(path.read_bytes()) for path in self._folder.iterdir())

    def move(self, folder: Path) -> None:
        """Go on in another folder, with a copy of what is here."""
        shutil.copytree(self._folder, folder)
        self._folder = folder

    def recall(self, identity: VehicleIdentity) -> RecoveryRecord:
        """Give the record of a vehicle."""
        return self._known.get(identity, EMPTY_RECORD)

    def put(self, update: RecordUpdate) -> None:
        """Queue a record to be written."""
        self._known[update.identity] = update.record
        self._queued.append((self._clock() + self._lag_s, update))

    def take_settled(self) -> list[tuple[VehicleIdentity, int]]:
        """Write the records that are due; gives those that were written or refused."""
        if self.is_stuck:
            return []
        due = [update for at, update in self._queued if at <= self._clock()]
        self._queued = [one for one in self._queued if one[0] > self._clock()]
        for update in due:
            if not self.refuses:
                self._write(update)
                self.written += 1
        return [(update.identity, update.number) for update in due]

    def _write(self, update: RecordUpdate) -> None:
        """Replace the file of a vehicle: `vehicle-1.json`, or `vehicle-1-<uid>.json`."""
        name = f"vehicle-{update.identity.system}-{update.identity.uid}".removesuffix("-")
        path = self._folder / f"{name}.json"
        if update.record == EMPTY_RECORD:
            path.unlink(missing_ok=True)
        else:
            path.write_bytes(encode_record(update.identity, update.record))
