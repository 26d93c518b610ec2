"""Room that is held on the disk so that the relay can go on when everything else is full.

To delete a record takes room too: the change is written beside the database first. The ballast is
a file that means nothing; the relay gives it up when it finds no room, and while it is missing
nothing new is taken in. The server holds it again when there is room.
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
    """Hold room, if there is plenty; says whether it is held."""
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
    """Give the size of the ballast on the disk that has this path [bytes]."""
    return min(SIZE_BYTES, shutil.disk_usage(path.parent).total // _PART_OF_DISK)


def release(path: Path) -> bool:
    """Give the room up; says whether there was any."""
    with suppress(FileNotFoundError):
        path.unlink()
        return True
    return False
