"""Wakes the long polls that wait for work."""

import threading
from collections.abc import Callable


class WorkSignal:
    """Wakes every waiting thread; a signal between reading `count` and `wait` is not lost.

    `notify_others` wakes the long polls at other servers on the same database.
    """

    def __init__(self, notify_others: Callable[[], None] = lambda: None) -> None:
        self._notify_others = notify_others
        self._changed = threading.Condition()
        self._count = 0
        self._closed = False

    @property
    def count(self) -> int:
        """How often it was signalled; read it before looking for work."""
        return self._count

    @property
    def closed(self) -> bool:
        """Whether the server stops, so that no thread should wait any more."""
        return self._closed

    def notify(self) -> None:
        """Wake every waiting thread, here and at the other servers."""
        self.notify_here()
        self._notify_others()

    def notify_here(self) -> None:
        """Wake every thread that waits at this server."""
        with self._changed:
            self._count += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Wake every thread for the last time: the server stops."""
        self._closed = True
        self.notify_here()

    def wait(self, seen: int, timeout_s: float) -> None:
        """Wait until `count` differs from `seen`, or for the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._count != seen or self._closed, timeout_s)
