"""The journal: the recovery records of all vehicles, one row per vehicle in the broker's database.

A row is replaced as a whole: a crash leaves the old record or the new one. A row that is not
a valid record is set aside and logged.
"""

import logging
from pathlib import Path
from typing import Any, Final

from mavlink_broker.database import Database, read_rows
from mavlink_broker.recovery.encoding import JournalError, decode, encode
from mavlink_broker.recovery.record import EMPTY_RECORD, RecoveryRecord, VehicleIdentity

_ALL: Final = "SELECT rowid, system, uid, CAST(data AS BLOB) FROM records"

_LOG = logging.getLogger(__name__)


class JournalTable:
    """The recovery records of one broker."""

    def __init__(self, database: Database) -> None:
        self._database = database

    @property
    def folder(self) -> Path:
        """The folder of the database."""
        return self._database.folder

    def read_all(self) -> dict[VehicleIdentity, RecoveryRecord]:
        """Read every record, also from a disk that takes none; invalid ones are set aside."""
        try:
            rows = self._rows()
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

    def _rows(self) -> list[tuple[Any, ...]]:
        try:
            return self._database.read(_ALL)
        except OSError:
            return read_rows(self.folder, _ALL)


def _record_of(identity: VehicleIdentity, data: bytes) -> RecoveryRecord:
    found, record = decode(data)
    if found != identity:
        raise JournalError(f"it is the record of {found}")
    return record
