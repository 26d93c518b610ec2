"""How the server wakes the relay: a named pipe in the state folder.

A byte means "look"; a byte lost costs only the time until the relay looks by itself.
"""

import errno
import logging
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import Final

LOG = logging.getLogger(__name__)
CHANGED: Final = b"!"
"""Rows that were there before have been changed or deleted."""
_ADDED: Final = b"+"
_NOBODY_LISTENS: Final = {errno.ENXIO, errno.ENOENT, errno.EPIPE, errno.EAGAIN}


def open_for_reading(path: Path) -> int:
    """Make the pipe if needed and open our end; it stays readable when all writers leave."""
    if path.exists() and not stat.S_ISFIFO(path.stat().st_mode):
        path.unlink()
    with suppress(FileExistsError):
        os.mkfifo(path, 0o600)
    return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)


def open_pair() -> tuple[int, int]:
    """Make a pipe without a name, for notices that come from a database: (ours, theirs)."""
    return os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)


def drain(descriptor: int) -> bytes:
    """Take all bytes that lie in a pipe."""
    taken = b""
    with suppress(BlockingIOError):
        while chunk := os.read(descriptor, 4096):
            taken += chunk
    return taken


def wake(path: Path, *, changed: bool = False) -> None:
    """Notify the relay that something is due, or has changed; harmless when there is no relay.

    It never raises: what it is about is committed, and whoever asked for it must get its answer.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            write(descriptor, changed=changed)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _NOBODY_LISTENS:
            LOG.warning("the relay cannot be notified, it looks by itself later: %s", error)


def write(descriptor: int, *, changed: bool) -> None:
    """Put a byte into an open pipe; harmless when it is full or nobody reads it any more."""
    try:
        os.write(descriptor, CHANGED if changed else _ADDED)
    except OSError as error:
        if error.errno not in _NOBODY_LISTENS:
            raise


def close(descriptor: int) -> None:
    """Let go of our end; bytes that are written now wake nobody."""
    os.close(descriptor)
