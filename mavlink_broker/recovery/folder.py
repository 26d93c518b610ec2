"""The journal: a file per recovery record, which holds the old record or the new one, never a part.

A record is written to a temporary file and synchronised; the file is renamed over the old one, and
the folder is synchronised too. A file that is not a valid record is renamed to `.bad` and logged.
"""

import logging
import os
import stat
from pathlib import Path
from typing import Final

from mavlink_broker.recovery.encoding import MAX_BYTES, JournalError, decode, encode
from mavlink_broker.recovery.record import EMPTY_RECORD, RecoveryRecord, VehicleIdentity

MAX_RECORDS: Final = 1000
"""That are read; each system id may have several vehicles."""
_PREFIX: Final = "vehicle-"
_SUFFIX: Final = ".json"

_LOG = logging.getLogger(__name__)


class JournalFolder:
    """The recovery records of one broker."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def path(self) -> Path:
        """The folder."""
        return self._folder

    def read_all(self) -> dict[VehicleIdentity, RecoveryRecord]:
        """Read every record; invalid files are renamed, unreadable ones logged."""
        try:
            names = sorted(
                path.name
                for path in self._folder.iterdir()
                if path.name.startswith(_PREFIX) and path.name.endswith(_SUFFIX)
            )
        except FileNotFoundError:
            return {}
        except OSError as error:
            _LOG.warning("the journal cannot be read: %s: %s", self._folder, error.strerror)
            return {}
        if len(names) > MAX_RECORDS:
            _LOG.warning("%s has %d records: %d are read", self._folder, len(names), MAX_RECORDS)
        records = (self._read(name) for name in names[:MAX_RECORDS])
        return dict(filter(None, records))

    def write(self, identity: VehicleIdentity, record: RecoveryRecord) -> None:
        """Replace the record of a vehicle; the file of an empty one is removed.

        Raises:
            OSError: if the disk refuses; the file holds the old record or the new one.
            JournalError: if it cannot be encoded; the file holds the old record.
        """
        path = self._folder / _name(identity)
        if record == EMPTY_RECORD:
            path.unlink(missing_ok=True)
            if self._folder.is_dir():
                self._sync_folder()
            return
        data = encode(identity, record)
        self._folder.mkdir(parents=True, exist_ok=True)
        temporary = path.with_suffix(".tmp")
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW
        with os.fdopen(os.open(temporary, flags, 0o600), "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
        self._sync_folder()

    def _sync_folder(self) -> None:
        descriptor = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _read(self, name: str) -> tuple[VehicleIdentity, RecoveryRecord] | None:
        path = self._folder / name
        try:
            identity, record = decode(_content(path))
        except OSError as error:
            _LOG.warning("%s cannot be read: %s", path, error.strerror)
            return None
        except JournalError as error:
            self._reject(path, str(error))
            return None
        if _name(identity) == name:
            return identity, record
        self._reject(path, f"it is the record of {identity}")
        return None

    def _reject(self, path: Path, reason: str) -> None:
        rejected = path.with_suffix(".bad")
        try:
            path.replace(rejected)
        except OSError as error:
            _LOG.warning("%s is rejected: %s; it stays: %s", path, reason, error.strerror)
        else:
            _LOG.warning("%s is rejected: %s; it is renamed to %s", path, reason, rejected.name)


def _name(identity: VehicleIdentity) -> str:
    uid = f"-{identity.uid}" if identity.uid else ""
    return f"{_PREFIX}{identity.system}{uid}{_SUFFIX}"


def _content(path: Path) -> bytes:
    """Read a regular file of a limited size.

    Raises:
        OSError: if it cannot be read.
        JournalError: if it is not a regular file, or too large.
    """
    if not stat.S_ISREG(path.lstat().st_mode):
        raise JournalError("it is not a regular file")
    with path.open("rb") as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise JournalError(f"it is larger than {MAX_BYTES} bytes")
    return data
