"""Backups of the database: which there are, and a new one on demand."""

import shutil
import threading
from typing import Any, Final

from edge_server.services import audit
from edge_server.services.context import Context, show_time
from edge_server.services.errors import (
    ConflictError,
    FullError,
    TooMuchError,
    UnavailableError,
)
from edge_server.store.files import backup
from edge_server.store.files.backup import BackupError, Copy, NoRoomError

KEPT: Final = 14
"""Backups that stay; a new one replaces the oldest."""
_RESERVE_BYTES: Final = 256 * 1024 * 1024
"""Of the disk, for everything else than a backup."""
_turn: Final = threading.Lock()


def overview(context: Context) -> dict[str, Any]:
    """Return the folder and its backups, the newest first; `fault` says why none can be made."""
    copies = backup.copies_in(context.config.backups_dir)
    return {
        "folder": str(context.config.backups_dir),
        "kept": KEPT,
        "fault": _fault(context),
        "backups": [_show(one) for one in copies],
    }


def make(context: Context) -> dict[str, Any]:
    """Make a backup now, and delete the oldest beyond `KEPT`.

    Raises:
        ConflictError: if the database is no file.
        TooMuchError: while another backup is made.
        FullError: if the disk has no room for it.
        UnavailableError: if it cannot be written.
    """
    fault = _fault(context)
    if fault is not None:
        raise ConflictError(fault)
    if not _turn.acquire(blocking=False):
        raise TooMuchError("a backup is being made already")
    try:
        return _make(context)
    except (BackupError, OSError) as error:
        is_full = isinstance(error, NoRoomError) or (
            isinstance(error, OSError) and backup.is_of_full_disk(error)
        )
        kind = FullError if is_full else UnavailableError
        raise kind(f"no backup could be made: {error}") from None
    finally:
        _turn.release()


def _make(context: Context) -> dict[str, Any]:
    folder, database = context.config.backups_dir, context.config.database_path
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    needed = database.stat().st_size + _RESERVE_BYTES
    free = shutil.disk_usage(folder).free
    if free < needed:
        mib = 1024 * 1024
        raise FullError(f"a backup needs {needed // mib} MiB of free disk, there are {free // mib}")
    path = backup.file_in(folder, context.clock())
    backup.back_up(database, path)
    backup.delete_older(folder, KEPT)
    with context.database.write():
        audit.about(f"backups/{path.name}")
    status = path.stat()
    return _show(Copy(path, status.st_size, status.st_mtime))


def _fault(context: Context) -> str | None:
    if context.database.is_shared:
        return f"{context.config.database_name} is backed up with pg_dump"
    return None


def _show(copy: Copy) -> dict[str, Any]:
    return {
        "name": copy.path.name,
        "path": str(copy.path),
        "size_bytes": copy.size_bytes,
        "made_at": show_time(copy.made_at),
    }
