"""How the server wakes the relay: a named pipe in the state folder.

A byte makes the relay look at the database. A lost byte delays it until it looks by itself.
"""

import errno
import logging
import math
import os
import select
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

LOG = logging.getLogger(__name__)
CHANGED: Final = b"!"
"""Existing rows have been changed or deleted."""
_ADDED: Final = b"+"
_NO_READER: Final = {errno.ENXIO, errno.ENOENT, errno.EPIPE, errno.EAGAIN}


def open_for_reading(path: Path) -> int:
    """Make the pipe if needed and open its reading end, which stays open without any writer."""
    if path.exists() and not stat.S_ISFIFO(path.stat().st_mode):
        path.unlink()
    with suppress(FileExistsError):
        os.mkfifo(path, 0o600)
    return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)


def open_pair() -> tuple[int, int]:
    """Make a pipe without a name, for threads of one process: (reading, writing end)."""
    return os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)


class Ready(NamedTuple):
    """Descriptors of which a read, or a write, does not wait: there is room, data or an error."""

    readable: frozenset[int]
    writable: frozenset[int]


def wait(readers: Iterable[int], timeout_s: float, *, writers: Iterable[int] = ()) -> Ready:
    """Wait until a descriptor is ready or the time is over.

    It polls: `select` raises for a descriptor above 1023, which a server with many open connections
    and files may have. The timeout is rounded up to whole milliseconds.
    """
    to_read, to_write = frozenset(readers), frozenset(writers)
    poll = select.poll()
    for descriptor in to_read | to_write:
        reads = select.POLLIN if descriptor in to_read else 0
        poll.register(descriptor, reads | (select.POLLOUT if descriptor in to_write else 0))
    ready = poll.poll(math.ceil(timeout_s * 1000))
    return Ready(
        to_read.intersection(one for one, events in ready if events & ~select.POLLOUT),
        to_write.intersection(one for one, events in ready if events & ~select.POLLIN),
    )


def drain(descriptor: int) -> bytes:
    """Read all bytes that are in a pipe."""
    taken = b""
    with suppress(BlockingIOError):
        while chunk := os.read(descriptor, 4096):
            taken += chunk
    return taken


def wake(path: Path, *, changed: bool = False) -> None:
    """Notify the relay that records were added, or changed; harmless if there is no relay.

    It never raises: the change is committed, and the request that made it must be answered.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            write(descriptor, changed=changed)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _NO_READER:
            LOG.warning("cannot notify the relay, it looks by itself later: %s", error)


def write(descriptor: int, *, changed: bool) -> None:
    """Put a byte into an open pipe; harmless if the pipe is full or has no reader."""
    try:
        os.write(descriptor, CHANGED if changed else _ADDED)
    except OSError as error:
        if error.errno not in _NO_READER:
            raise


def close(descriptor: int) -> None:
    """Close an end of the pipe."""
    os.close(descriptor)
