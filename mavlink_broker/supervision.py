"""Error boundaries: supervised threads, and the record of every internal error.

An unexpected error ends only what it occurred in: the loop catches it at the boundary of one
vehicle's session, one datagram or one piece of work. Every caught error is recorded here.

A thread that fails is restarted. A thread runs a function that returns when the thread has to end.
An exception in it is an error of the program: it is logged with its traceback, and the function is
called again after a pause that doubles with each failure, 0.5 to 30 s.

A failure of a thread that is not supervised ends the program (`ThreadFailureHook`), because a
process without one of its threads looks alive and does not work.
"""

import logging
import math
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable
from typing import Final

TRACEBACK_INTERVAL_S: Final = 30.0
"""Shortest interval of log entries about the same error of the same vehicle."""
WARNING_DURATION_S: Final = 600.0
"""A warning expires so long after the latest error."""
LOCATIONS_KEPT: Final = 256
_LOG = logging.getLogger(__name__)
FIRST_PAUSE_S: Final = 0.5
LONGEST_PAUSE_S: Final = 30.0
STABLE_AFTER_S: Final = 60.0
"""After a thread has run for longer, its next pause is the shortest one."""


def reason_of(error: Exception) -> str:
    """Describe an internal error in one line."""
    return f"internal error of the broker: {type(error).__name__}: {error}"


class InternalErrors:
    """The internal errors of one broker."""

    def __init__(self) -> None:
        self.count = 0
        self._counts: Counter[str] = Counter()
        self._latest: dict[str, tuple[str, float]] = {}
        self._logged_at: dict[tuple[str, str], float] = {}

    def record(self, owner: str, error: Exception, now: float) -> str:
        """Count an error of an owner, such as a vehicle; returns its description in one line."""
        self.count += 1
        self._counts[owner] += 1
        reason = reason_of(error)
        self._latest[owner] = reason, now
        if self._is_due(owner, error, now):
            _LOG.error("%s: %s (error %d)", owner, reason, self._counts[owner], exc_info=error)
        return reason

    def warning(self, owner: str, now: float) -> str | None:
        """Latest error of an owner and their count.

        None without an error in the last 10 minutes; the count continues.
        """
        reason, noted_at = self._latest.get(owner, ("", -math.inf))
        if now - noted_at >= WARNING_DURATION_S:
            return None
        return f"{reason} ({self._counts[owner]} so far)"

    def _is_due(self, owner: str, error: Exception, now: float) -> bool:
        frames = traceback.extract_tb(error.__traceback__)
        last = frames[-1] if frames else None
        place = owner, f"{type(error).__name__} {last and (last.filename, last.lineno)}"
        if now - self._logged_at.get(place, -math.inf) < TRACEBACK_INTERVAL_S:
            return False
        if len(self._logged_at) >= LOCATIONS_KEPT:
            self._logged_at.clear()
        self._logged_at[place] = now
        return True


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
