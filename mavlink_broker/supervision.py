"""Threads that do not end unseen: one that fails is logged, counted and begun again.

What a thread does is a function that returns when it is to end. An exception in it is an error of
the program: it is logged with its traceback, and the function is called again after a pause that
doubles with each failure, 0.5 to 30 s. So a thread that fails at once costs little, and one that
has failed once goes on.

A thread that is not supervised and fails ends the program (`Alarm`), for a process that lives on
without one of its threads looks alive and is not.
"""

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

FIRST_PAUSE_S: Final = 0.5
LONGEST_PAUSE_S: Final = 30.0
HEALTHY_AFTER_S: Final = 60.0
"""A thread that has run for so long begins with the first pause again."""

_LOG = logging.getLogger(__name__)


class SupervisedThread:
    """A daemon thread that is begun again when it fails, until it ends by itself."""

    def __init__(
        self,
        name: str,
        work: Callable[[], None],
        stopping: threading.Event,
        *,
        first_pause_s: float = FIRST_PAUSE_S,
    ) -> None:
        """Name a thread and what it does; `stopping` ends the pause behind a failure."""
        self.name = name
        self.failures = 0
        self._work = work
        self._stopping = stopping
        self._first_pause_s = first_pause_s
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def join(self, within_s: float) -> None:
        """Wait for its end, at most so long."""
        self._thread.join(within_s)

    @property
    def is_alive(self) -> bool:
        """Whether it works, or is about to work again."""
        return self._thread.is_alive()

    def _run(self) -> None:
        pause_s = self._first_pause_s
        while True:
            began_at = time.monotonic()
            try:
                self._work()
            except Exception:  # noqa: BLE001  # logged, counted, begun again
                self.failures += 1
                if time.monotonic() - began_at >= HEALTHY_AFTER_S:
                    pause_s = self._first_pause_s
                _LOG.exception(
                    "thread %s has failed (failure %d); it is begun again in %.1f s",
                    *(self.name, self.failures, pause_s),
                )
            else:
                return
            if self._stopping.wait(pause_s):
                return
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)


class Alarm:
    """Notices a thread that nobody supervises and that has failed, so that the program ends."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """Watch all threads from now on; `wake` ends the sleep of the program's loop."""
        self.is_raised = False
        self._wake = wake
        threading.excepthook = self._failed

    def _failed(self, failure: threading.ExceptHookArgs) -> None:
        name = failure.thread.name if failure.thread else "of no name"
        _LOG.critical(
            "thread %s has failed, the program ends: %r",
            name,
            failure.exc_value,
            exc_info=failure.exc_value,
        )
        self.is_raised = True
        self._wake()
