"""Copies of the database, made while it is in use: each complete, as of one moment.

BackupError   the copy could not be made; no file was left
+- NoRoomError  the disk is full
"""

import errno
import os
import sqlite3
import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path
from typing import Final, NamedTuple

_NAME: Final = "edge-%Y%m%dT%H%M%SZ.sqlite3"
_COMPANIONS: Final = ("-journal", "-wal", "-shm")
"""Files that SQLite makes beside a database, and leaves there after an error."""
_PATTERN: Final = "edge-*Z.sqlite3"


class BackupError(Exception):
    """The copy could not be made."""


class NoRoomError(BackupError):
    """The disk has no room for the copy."""


class Copy(NamedTuple):
    """A copy in a folder."""

    path: Path
    size_bytes: int
    made_at: float


def file_in(folder: Path, now: float) -> Path:
    """Return the file of a copy that is made now [s since 1970], by its time of day (UTC)."""
    return folder / time.strftime(_NAME, time.gmtime(now))


def copies_in(folder: Path) -> list[Copy]:
    """List the copies of a folder that are named by their time, the newest first."""
    found = []
    for path in sorted(folder.glob(_PATTERN), reverse=True):
        with suppress(OSError):  # Deleted meanwhile
            status = path.stat()
            found.append(Copy(path, status.st_size, status.st_mtime))
    return found


def delete_older(folder: Path, keep: int) -> None:
    """Delete all but the newest copies that this command has named.

    Raises:
        BackupError: if one cannot be deleted.
    """
    try:
        for old in sorted(folder.glob(_PATTERN))[:-keep]:
            old.unlink()
    except OSError as error:
        raise BackupError(f"cannot delete an older copy: {error}") from None


def back_up(database: Path, target: Path) -> int:
    """Copy the database into a new file with mode 0600; returns its size [bytes].

    Raises:
        NoRoomError: if the disk is full.
        BackupError: if there is no database, the target exists, or the disk fails.
    """
    if not database.exists():
        raise BackupError(f"there is no database {database}")
    if target.exists():
        raise BackupError(f"{target} exists; a backup overwrites nothing")
    parts: list[Path] = []
    try:
        part = _new_part(target)
        parts = [part.with_name(part.name + suffix) for suffix in ("", *_COMPANIONS)]
        _copy(database, part)
        os.link(part, target)  # Unlike a rename it fails if the target exists by now
        sync(target.parent)
    except FileExistsError:
        raise BackupError(
            f"{target} has been made by another backup meanwhile; a backup overwrites nothing"
        ) from None
    except (OSError, sqlite3.Error) as error:
        kind = NoRoomError if is_of_full_disk(error) else BackupError
        raise kind(f"cannot write {target}: {error}") from None
    finally:
        for left in parts:
            left.unlink(missing_ok=True)
    return target.stat().st_size


def is_of_full_disk(error: OSError | sqlite3.Error) -> bool:
    """Whether something could not be written because the disk, or a quota of it, is used up."""
    if isinstance(error, OSError):
        return error.errno in {errno.ENOSPC, errno.EDQUOT}
    return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL


def _new_part(target: Path) -> Path:
    """Make an empty file with mode 0600 that no other backup to the same target uses."""
    descriptor, name = tempfile.mkstemp(prefix=f"{target.name}.", suffix=".part", dir=target.parent)
    os.close(descriptor)
    return Path(name)


def _copy(database: Path, part: Path) -> None:
    with (
        closing(sqlite3.connect(f"{database.absolute().as_uri()}?mode=ro", uri=True)) as source,
        closing(sqlite3.connect(part)) as copy,
    ):
        # In one step, which reads one state while others write (WAL). Between two steps SQLite
        # would begin again for each commit, and with many commits a second it would never end.
        source.backup(copy, pages=-1)
        (found,) = copy.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise sqlite3.DatabaseError(f"the copy is broken: {found}")
    sync(part)


def sync(path: Path) -> None:
    """Write a file or folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
