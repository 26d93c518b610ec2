"""A computer of the farm: a disk and the processes on it, which lose power together."""

import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Final, Protocol

from dst.disk import Disk
from dst.scheduler import Scheduler

SLOWEST_SYNC_S: Final = 3.0


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
        database: Path,
        processes: Sequence[Process],
    ) -> None:
        self.name = name
        self.disk = disk
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

    # Each begins a trouble of the disk, and gives what ends it.

    def fill(self, _random: Random) -> Callable[[], None]:
        """Have no free space."""
        self._note("the disk is full")
        self.disk.is_full = True
        return lambda: setattr(self.disk, "is_full", False)

    def protect(self, _random: Random) -> Callable[[], None]:
        """Have the file system mounted read-only after an error."""
        self._note("the disk is read-only")
        self.disk.is_read_only = True
        return lambda: setattr(self.disk, "is_read_only", False)

    def slow_down(self, random: Random) -> Callable[[], None]:
        """Have each sync take long."""
        self.disk.sync_s = random.uniform(0.05, SLOWEST_SYNC_S)
        self._note(f"a sync takes {self.disk.sync_s:.2f} s")
        return lambda: setattr(self.disk, "sync_s", 0.0)

    def lock(self, _random: Random) -> Callable[[], None]:
        """Have another program begin to write to the database, and not end."""
        try:
            locker = sqlite3.connect(self._database, isolation_level=None)
            locker.execute("BEGIN IMMEDIATE")
        except sqlite3.Error:
            return lambda: None
        self._unlock()
        self._note("the database is locked")
        self._locker = locker
        return self._unlock

    def restore(self) -> None:
        """Have the disk work as it should."""
        self.disk.is_full = self.disk.is_read_only = False
        self.disk.sync_s = 0.0
        self.disk.survive()
        self._unlock()

    def _unlock(self) -> None:
        locker, self._locker = self._locker, None
        if locker is not None:
            locker.close()

    def _note(self, text: str) -> None:
        self._scheduler.note("faults", self.name, text)
