"""A reserve on the disk, so that the relay can go on when the disk is full.

Deleting a record takes room too: the change is first written beside the database. The ballast is a
file without meaning; the relay deletes it when it finds no room, and while it is missing no new
records are accepted. The server makes it again when there is room.
"""

import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Final

SIZE_BYTES: Final = 8 * 1024 * 1024
_PART_OF_DISK: Final = 8
_TIMES_FREE: Final = 2


def hold(path: Path) -> bool:
    """Make the ballast if there is enough room; returns whether it exists."""
    if path.exists():
        return True
    size = size_on(path)
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


def size_on(path: Path) -> int:
    """Return the size of the ballast on the disk of this path [bytes]."""
    return min(SIZE_BYTES, shutil.disk_usage(path.parent).total // _PART_OF_DISK)


def release(path: Path) -> bool:
    """Delete the ballast; returns whether it existed."""
    with suppress(FileNotFoundError):
        path.unlink()
        return True
    return False
