"""Lines of input from a terminal, a pipe or a file.

One file descriptor is read as it has something, without a thread, so that a program may end while
somebody is about to type. MAVSDK's threads wake the same wait.
"""

import os
import selectors
import threading
from collections import deque
from typing import Final, Generic, TypeVar

_READ_BYTES: Final = 4096
_LONGEST_LINE_BYTES: Final = 65_536
T = TypeVar("T")


class WakeableQueue(Generic[T]):
    """A queue that any thread may fill and whose filling ends a wait."""

    def __init__(self) -> None:
        self._waiting: deque[T] = deque()
        self._lock = threading.Lock()
        self._read_end, self._write_end = os.pipe()
        os.set_blocking(self._read_end, False)
        os.set_blocking(self._write_end, False)

    def put(self, entry: T) -> None:
        """Add something."""
        with self._lock:
            self._waiting.append(entry)
            if self._write_end < 0 or len(self._waiting) > 1:
                return
            os.write(self._write_end, b"\0")

    def take(self) -> list[T]:
        """Give all that has come."""
        with self._lock:
            entries = list(self._waiting)
            self._waiting.clear()
            if entries:
                os.read(self._read_end, 1)
            return entries

    def fileno(self) -> int:
        """What is readable when something has come."""
        return self._read_end

    def close(self) -> None:
        """Give the pipe back; what comes later is kept and wakes nobody."""
        with self._lock:
            write_end, self._write_end = self._write_end, -1
        os.close(write_end)
        os.close(self._read_end)


class Lines:
    """Lines of one file descriptor; None: there are none."""

    def __init__(self, descriptor: int | None) -> None:
        self._descriptor = descriptor
        self._rest = b""
        self._lines: deque[str] = deque()

    @property
    def is_open(self) -> bool:
        """Whether more may come."""
        return self._descriptor is not None

    @property
    def is_over(self) -> bool:
        """Whether all has been taken, and nothing more will come."""
        return not self.is_open and not self._lines

    @property
    def has_line(self) -> bool:
        """Whether one can be taken."""
        return bool(self._lines)

    def pop(self) -> str:
        """Remove and return the oldest line."""
        return self._lines.popleft()

    def fileno(self) -> int:
        """What is to be waited on.

        Raises:
            ValueError: if nothing more will come.
        """
        if self._descriptor is None:
            raise ValueError("the end has been read")
        return self._descriptor

    def read(self) -> None:
        """Read what is there; to be called when the descriptor is readable."""
        try:
            chunk = os.read(self.fileno(), _READ_BYTES)
        except OSError:  # A terminal whose other end has gone
            chunk = b""
        if not chunk:
            self._descriptor = None
            if self._rest:
                self._add(self._rest)
            return
        *whole, self._rest = (self._rest + chunk).split(b"\n")
        for line in whole:
            self._add(line)
        if len(self._rest) > _LONGEST_LINE_BYTES:
            self._add(self._rest)
            self._rest = b""

    def _add(self, line: bytes) -> None:
        self._lines.append(line.decode("utf-8", "replace"))


def wait(lines: Lines, woken: WakeableQueue[T], timeout_s: float) -> None:
    """Wait until either has something, at most so long; reads the lines that have come."""
    with selectors.PollSelector() as selector:
        selector.register(woken.fileno(), selectors.EVENT_READ)
        if lines.is_open:
            selector.register(lines.fileno(), selectors.EVENT_READ)
        ready = {key.fd for key, _ in selector.select(max(0.0, timeout_s))}
    if lines.is_open and lines.fileno() in ready:
        lines.read()
