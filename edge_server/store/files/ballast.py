"""A reserve on the disk, so that the relay can go on when the disk is full.

Deleting a record takes room too: the change is first written beside the database. The ballast is a
file without meaning; the relay deletes it when it finds no room, and while it is missing no new
records are accepted. The server makes it again when there is room.

Opening the database takes room as well, also where nothing is to be written. A relay at work may
have used up the ballast, so a second, small file of this kind is kept for the next start.
"""

import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Final

SIZE_BYTES: Final = 8 * 1024 * 1024
START_BYTES: Final = 512 * 1024
_PART_OF_DISK: Final = 8
_START_PART_OF_DISK: Final = 32
_TIMES_FREE: Final = 2


def hold(path: Path) -> bool:
    """Make the ballast if there is enough room; returns whether it exists."""
    return _hold(path, size_on(path))


def hold_for_start(path: Path) -> bool:
    """Make the reserve for the next start if there is enough room; returns whether it exists."""
    return _hold(path, start_size_on(path))


def _hold(path: Path, size: int) -> bool:
    if path.exists():
        return True
    if shutil.disk_usage(path.parent).free < _TIMES_FREE * size:
        return False
    unfinished = path.with_suffix(".part")
    try:
        descriptor = os.open(unfinished, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            os.posix_fallocate(descriptor, 0, size)
        finally:
            os.close(descriptor)
        unfinished.rename(path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        return False
    return True


def bytes_to_hold(path: Path) -> int:
    """Return how much has to be free so that the ballast is made [bytes]."""
    return _TIMES_FREE * size_on(path)


def size_on(path: Path) -> int:
    """Return the size of the ballast on the disk of this path [bytes]."""
    return min(SIZE_BYTES, shutil.disk_usage(path.parent).total // _PART_OF_DISK)


def start_size_on(path: Path) -> int:
    """Return the size of the reserve for a start on the disk of this path [bytes]."""
    return min(START_BYTES, shutil.disk_usage(path.parent).total // _START_PART_OF_DISK)


def release(path: Path) -> bool:
    """Delete the ballast, or the reserve for a start; returns whether it existed."""
    with suppress(FileNotFoundError):
        path.unlink()
        return True
    return False
