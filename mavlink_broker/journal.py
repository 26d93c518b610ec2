"""The journal: the recovery records of all vehicles, one row per vehicle in the broker's database.

A row is replaced as a whole: a crash leaves the old record or the new one. A row that is not
a valid record is set aside and logged.

A thread writes, so that the loop never waits for the disk. Only the newest record of each vehicle
is written. A refusal of the disk is logged once, and the write is retried every five seconds. The
thread only waits: `write_due` is what it does between. A simulation calls it without the thread.
"""

import logging
import threading
from collections.abc import Callable
from typing import Final

from mavlink_broker.database import Database
from mavlink_broker.supervision import SupervisedThread, reason_of
from mavlink_broker.vehicle.record_encoding import JournalError, decode, encode
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    RecordUpdate,
    RecoveryRecord,
    VehicleIdentity,
)

_ALL: Final = "SELECT rowid, system, uid, CAST(data AS BLOB) FROM records"
_LOG = logging.getLogger(__name__)
RETRY_AFTER_S: Final = 5.0
STOP_TIMEOUT_S: Final = 5.0
"""How long an ending program waits for a slow disk."""


class JournalTable:
    """The recovery records of one broker."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self.folder = database.folder

    def read_all(self) -> dict[VehicleIdentity, RecoveryRecord]:
        """Read every record, also from a disk that takes none; invalid ones are set aside."""
        try:
            rows = self._database.read(_ALL)
        except OSError as error:
            _LOG.warning("the journal cannot be read: %s: %s", self.folder, error.strerror)
            return {}
        records = {}
        for row_id, system, uid, data in rows:
            identity = VehicleIdentity(system, uid)
            try:
                records[identity] = _record_of(identity, data)
            except JournalError as error:
                self._database.set_aside("records", row_id, f"{identity}: {error}")
        return records

    def write(self, identity: VehicleIdentity, record: RecoveryRecord) -> None:
        """Replace the record of a vehicle; an empty one is removed.

        Raises:
            OSError: if the disk refuses; the old record stays.
            JournalError: if it cannot be encoded; the old record stays.
        """
        data = None if record == EMPTY_RECORD else encode(identity, record)
        with self._database.change() as rows:
            if data is None:
                rows.execute("DELETE FROM records WHERE system = ? AND uid = ?", identity)
            else:
                rows.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", (*identity, data))


def _record_of(identity: VehicleIdentity, data: bytes) -> RecoveryRecord:
    found, record = decode(data)
    if found != identity:
        raise JournalError(f"it is the record of {found}")
    return record


class JournalWriter:
    """The recovery records of one broker, read once, and a thread that writes them, if started."""

    def __init__(self, journal: JournalTable, wake: Callable[[], None]) -> None:
        """Read the records of an earlier run; `wake` ends the loop's sleep."""
        self._journal = journal
        self._wake = wake
        self._known: dict[VehicleIdentity, RecoveryRecord] = journal.read_all()
        self._changed = threading.Condition()
        self._due: dict[VehicleIdentity, RecordUpdate] = {}
        self._refused: dict[VehicleIdentity, RecordUpdate] = {}
        self._settled: list[tuple[VehicleIdentity, int]] = []
        self._is_ending = False
        self._is_refusal_logged = False
        self._stopping = threading.Event()
        self._thread = SupervisedThread("journal", self._run, self._stopping)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def recall(self, identity: VehicleIdentity) -> RecoveryRecord:
        """Give the record of a vehicle."""
        return self._known.get(identity, EMPTY_RECORD)

    def put(self, update: RecordUpdate) -> None:
        """Queue a record to be written; never waits for the disk."""
        self._known[update.identity] = update.record
        with self._changed:
            self._due[update.identity] = update
            self._changed.notify()

    def take_settled(self) -> list[tuple[VehicleIdentity, int]]:
        """Give the updates that were written or refused since the last call."""
        if not self._settled:
            return []
        with self._changed:
            settled, self._settled = self._settled, []
        return settled

    def close(self) -> None:
        """Write the records that wait, if the disk takes them, and end."""
        with self._changed:
            self._is_ending = True
            self._stopping.set()
            self._changed.notify()
        self._thread.join(STOP_TIMEOUT_S)

    def write_due(self) -> bool:
        """Write the records that wait; gives whether the disk has taken all that there are."""
        with self._changed:
            due, self._due = {**self._refused, **self._due}, {}
        for update in due.values():
            self._write(update)
        return not self._refused

    def _run(self) -> None:
        while True:
            with self._changed:
                timeout_s = RETRY_AFTER_S if self._refused else None
                self._changed.wait_for(lambda: self._due or self._is_ending, timeout_s)
                is_ending = self._is_ending
            self.write_due()
            if is_ending and not self._due:
                return

    def _write(self, update: RecordUpdate) -> None:
        try:
            self._journal.write(update.identity, update.record)
        except (OSError, JournalError) as error:
            self._refuse(update, getattr(error, "strerror", None) or str(error))
        except Exception as error:  # noqa: BLE001  # the boundary of one record, logged
            _LOG.exception("the record of %s", update.identity)
            self._refuse(update, reason_of(error))
        else:
            self._refused.pop(update.identity, None)
            if self._is_refusal_logged and not self._refused:
                self._is_refusal_logged = False
                _LOG.warning("%s: the broker's journal can be written again", self._journal.folder)
        with self._changed:
            self._settled.append((update.identity, update.number))
        self._wake()

    def _refuse(self, update: RecordUpdate, reason: str) -> None:
        self._refused[update.identity] = update
        if not self._is_refusal_logged:
            self._is_refusal_logged = True
            _LOG.warning(
                "no journal is kept in %s: %s; make room, or make it writable: a broker that is "
                "killed now forgets accepted aborts until the edge server repeats them, and what "
                "it has to restore on the vehicles",
                self._journal.folder,
                reason,
            )
