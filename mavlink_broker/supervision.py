"""Supervised threads: a thread that fails is logged, counted and restarted.

A thread runs a function that returns when the thread has to end. An exception in it is an error of
the program: it is logged with its traceback, and the function is called again after a pause that
doubles with each failure, 0.5 to 30 s.

A failure of a thread that is not supervised ends the program (`ThreadFailureHook`), because a
process without one of its threads looks alive and does not work.
"""

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

FIRST_PAUSE_S: Final = 0.5
LONGEST_PAUSE_S: Final = 30.0
STABLE_AFTER_S: Final = 60.0
"""After a thread has run for so long, its next pause is the shortest again."""

_LOG = logging.getLogger(__name__)


class SupervisedThread:
    """A daemon thread that is restarted when it fails, until its function returns."""

    def __init__(
        self,
        name: str,
        work: Callable[[], None],
        stopping: threading.Event,
        *,
        first_pause_s: float = FIRST_PAUSE_S,
    ) -> None:
        """Prepare a thread; `stopping` ends the pause after a failure."""
        self.name = name
        self.failures = 0
        self._work = work
        self._stopping = stopping
        self._first_pause_s = first_pause_s
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def join(self, within_s: float) -> None:
        """Wait for its end, at most `within_s`."""
        self._thread.join(within_s)

    @property
    def is_alive(self) -> bool:
        """Whether it runs, or will be restarted."""
        return self._thread.is_alive()

    def _run(self) -> None:
        pause_s = self._first_pause_s
        while True:
            began_at = time.monotonic()
            try:
                self._work()
            except Exception:  # noqa: BLE001  # logged, counted, restarted
                self.failures += 1
                if time.monotonic() - began_at >= STABLE_AFTER_S:
                    pause_s = self._first_pause_s
                _LOG.exception(
                    "thread %s has failed (failure %d); it restarts in %.1f s",
                    *(self.name, self.failures, pause_s),
                )
            else:
                return
            if self._stopping.wait(pause_s):
                return
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)


class ThreadFailureHook:
    """Detects the failure of a thread that is not supervised, so that the program ends."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """Observe all threads from now on; `wake` ends the wait of the program's loop."""
        self.has_fired = False
        self._wake = wake
        threading.excepthook = self._failed

    def _failed(self, failure: threading.ExceptHookArgs) -> None:
        name = failure.thread.name if failure.thread else "without a name"
        _LOG.critical(
            "thread %s has failed, the program ends: %r",
            name,
            failure.exc_value,
            exc_info=failure.exc_value,
        )
        self.has_fired = True
        self._wake()
