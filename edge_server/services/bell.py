"""Wakes those who wait for work, at once."""

import threading
from collections.abc import Callable


class Bell:
    """Rings for every waiting thread; a ring is never missed between looking and waiting.

    `tell_others` lets the bells of other servers on the same database ring too.
    """

    def __init__(self, tell_others: Callable[[], None] = lambda: None) -> None:
        self._tell_others = tell_others
        self._changed = threading.Condition()
        self._rings = 0
        self._closed = False

    @property
    def rings(self) -> int:
        """How often it has rung; read it before looking for work."""
        return self._rings

    @property
    def closed(self) -> bool:
        """Whether nobody should wait any more."""
        return self._closed

    def ring(self) -> None:
        """Wake everybody, here and at the other servers."""
        self.ring_here()
        self._tell_others()

    def ring_here(self) -> None:
        """Wake everybody who waits at this server."""
        with self._changed:
            self._rings += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Wake everybody for the last time: the server stops."""
        self._closed = True
        self.ring_here()

    def wait(self, seen: int, timeout_s: float) -> None:
        """Wait until it has rung more often than seen, or for so long."""
        with self._changed:
            self._changed.wait_for(lambda: self._rings != seen or self._closed, timeout_s)
