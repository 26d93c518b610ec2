"""A computer of the farm: a disk and the processes on it, which lose power together."""

import math
import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Final, Protocol

from dst.scheduler import Clock, Scheduler
from dst.world.disk import Disk

SLOWEST_SYNC_S: Final = 3.0
STEPS_S: Final = (5.0, 300.0, 7200.0, 90_000.0)
"""Largest step of the time of day: a late time server, a wrong zone, a dead battery."""
MOST_DRIFT: Final = 500e-6
"""By which Linux slews a clock at most."""


class Process(Protocol):
    """A program that is killed and started at any time."""

    @property
    def is_up(self) -> bool:
        """Whether it runs."""

    def start(self) -> None:
        """Start on what is on the disk."""

    def kill(self) -> None:
        """Lose everything that is not on the disk."""


class Machine:
    """One computer."""

    def __init__(
        self,
        scheduler: Scheduler,
        name: str,
        disk: Disk,
        clock: Clock,
        database: Path,
        processes: Sequence[Process],
    ) -> None:
        self.name = name
        self.disk = disk
        self.clock = clock
        self.processes = processes
        self._scheduler = scheduler
        self._database = database
        self._locker: sqlite3.Connection | None = None

    def lose_power(
        self, then: Callable[[], None] = lambda: None, *, after_changes: int = 0
    ) -> None:
        """Lose power now, or in the middle of a later commit; then call `then`."""

        def die() -> None:
            for process in self.processes:
                process.kill()
            self._unlock()
            lost = self.disk.restore_power()
            self._note(f"power lost with {lost} changes of files")
            then()

        def soon() -> None:
            self._scheduler.after(0.0, die)

        if after_changes:
            self.disk.die_after(after_changes, soon)
        else:
            self.disk.lose_power()
            die()

    def step_clock(self, random: Random) -> None:
        """Have the time of day stepped, and the clocks drift, as without a time server."""
        largest_s = random.choice(STEPS_S)
        self.clock.step(random.uniform(-largest_s, largest_s))
        self.clock.run(random.uniform(-MOST_DRIFT, MOST_DRIFT))
        self._note(f"the clock is off by {self.clock.error_s:.0f} s")

    def set_clock(self) -> None:
        """Have the time of day set right."""
        self.clock.set_right()

    # Each begins a trouble of the disk; `restore` ends all.

    def fill(self, _random: Random) -> None:
        """Have no free space."""
        self._note("the disk is full")
        self.disk.is_full = True
        self.disk.troubled_s = math.inf

    def protect(self, _random: Random) -> None:
        """Have the file system mounted read-only after an error."""
        self._note("the disk is read-only")
        self.disk.is_read_only = True
        self.disk.troubled_s = math.inf

    def slow_down(self, random: Random) -> None:
        """Have each sync take long."""
        self.disk.sync_s = random.uniform(0.05, SLOWEST_SYNC_S)
        self._note(f"a sync takes {self.disk.sync_s:.2f} s")
        self.disk.troubled_s = math.inf

    def lock(self, _random: Random) -> None:
        """Have another program begin to write to the database, and not end."""
        try:
            locker = sqlite3.connect(self._database, isolation_level=None)
        except sqlite3.Error:
            return
        try:
            locker.execute("BEGIN IMMEDIATE")
        except sqlite3.Error:
            locker.close()
            return
        self._unlock()
        self._note("the database is locked")
        self._locker = locker
        self.disk.troubled_s = math.inf

    def restore(self) -> None:
        """Have the disk work as it should."""
        self.disk.is_full = self.disk.is_read_only = False
        self.disk.sync_s = 0.0
        self.disk.survive()
        self._unlock()
        self.disk.troubled_s = self._scheduler.now_s

    def _unlock(self) -> None:
        locker, self._locker = self._locker, None
        if locker is not None:
            locker.close()

    def _note(self, text: str) -> None:
        self._scheduler.note("faults", self.name, text)
