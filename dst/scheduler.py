"""Virtual clock, event queue and trace of one simulated world.

Everything that happens in a world is an action of the queue. Actions are taken in the order of
their time; actions of the same time in an order drawn from the seed, because a real machine
promises none. The same seed gives the same trace, byte for byte.
"""

import hashlib
import heapq
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from random import Random
from typing import Final

EPOCH: Final = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
"""Time of day at the virtual time 0."""
KEPT_LINES: Final = 2000
"""Last lines of a trace that are kept for the report of a failure."""
BOOT_S: Final = 1000.0
"""Monotonic time of the machine at the virtual time 0."""


class Trace:
    """Who sent what to whom when: a digest of every line, and the last lines."""

    def __init__(self, kept_lines: int | None = KEPT_LINES) -> None:
        """Keep so many lines; None keeps all."""
        self._hash = hashlib.sha256()
        self.lines: deque[str] = deque(maxlen=kept_lines)

    def note(self, time_s: float, sender: str, receiver: str, text: str) -> None:
        """Add a line."""
        line = f"{time_s:12.4f}  {sender} > {receiver}: {text}"
        self._hash.update(line.encode() + b"\n")
        self.lines.append(line)

    @property
    def digest(self) -> str:
        """SHA-256 of all lines, hexadecimal."""
        return self._hash.hexdigest()


@dataclass(slots=True)
class Event:
    """An action that is due; `cancel` has it not taken."""

    time_s: float
    action: Callable[[], None] | None

    def cancel(self) -> None:
        """Have the action not taken."""
        self.action = None


class Scheduler:
    """Takes the actions of one world, one after the other."""

    def __init__(self, seed: int, *, kept_lines: int | None = KEPT_LINES) -> None:
        self.seed = seed
        self.now_s = 0.0
        self.trace = Trace(kept_lines)
        # By time, then by rank: the drawn order of events of the same time
        self._queue: list[tuple[float, float, int, Event]] = []
        self._ranks = self.random("scheduler")
        self._count = 0

    def random(self, name: str) -> Random:
        """Give a source of random numbers for one purpose.

        A fault that is left out does not change the numbers that the other faults draw.
        """
        return Random(f"{self.seed}/{name}")

    def after(self, delay_s: float, action: Callable[[], None]) -> Event:
        """Do an action after a delay [s]; one of 0 or less comes as soon as possible."""
        self._count += 1
        time_s = self.now_s + max(0.0, delay_s)
        event = Event(time_s, action)
        heapq.heappush(self._queue, (time_s, self._ranks.random(), self._count, event))
        return event

    def every(self, period_s: float, action: Callable[[], None]) -> None:
        """Do an action now and again, with a fixed period [s]."""

        def act() -> None:
            self.after(period_s, act)
            action()

        self.after(0.0, act)

    def run_until(self, time_s: float) -> None:
        """Do every action that is due up to a virtual time [s]."""
        while self._queue and self._queue[0][0] <= time_s:
            event = heapq.heappop(self._queue)[-1]
            if event.action is not None:
                self.now_s = event.time_s
                event.action()
        self.now_s = max(self.now_s, time_s)

    def note(self, sender: str, receiver: str, text: str) -> None:
        """Add a line to the trace."""
        self.trace.note(self.now_s, sender, receiver, text)


class Clock:
    """The clocks of one machine: both may run too fast, and the time of day may be stepped."""

    def __init__(self, scheduler: Scheduler) -> None:
        """Begin right."""
        self._scheduler = scheduler
        self._drift = 0.0  # By how much it is too fast, as a part of the time that passes
        self._drifts_since_s = 0.0
        self._passed_before_s = 0.0
        self._stepped_s = 0.0

    @property
    def error_s(self) -> float:
        """By how much the time of day is wrong."""
        return self._passed_s() + self._stepped_s - self._scheduler.now_s

    def step(self, seconds: float) -> None:
        """Change the time of day at once."""
        self._stepped_s += seconds

    def run(self, drift: float) -> None:
        """Run too fast from now on, by a part of the time that passes."""
        self._passed_before_s = self._passed_s()
        self._drifts_since_s = self._scheduler.now_s
        self._drift = drift

    def set_right(self) -> None:
        """Have the right time of day, and keep it, as by a time server."""
        self.run(0.0)
        self.step(-self.error_s)

    def _passed_s(self) -> float:
        running_s = self._scheduler.now_s - self._drifts_since_s
        return self._passed_before_s + running_s * (1.0 + self._drift)

    def monotonic(self) -> float:
        """Monotonic time [s]."""
        return BOOT_S + self._passed_s()

    def utc(self) -> datetime:
        """Time of day."""
        return EPOCH + timedelta(seconds=self._passed_s() + self._stepped_s)

    def epoch_s(self) -> float:
        """Seconds since 1970."""
        return EPOCH.timestamp() + self._passed_s() + self._stepped_s
