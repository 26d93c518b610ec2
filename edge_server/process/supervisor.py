"""Supervises server and relay: a process that exits is restarted.

A server that exits five times within a minute stops the program with code 1. The relay never stops
it: reports, plans and aborts are served while the relay is restarted, each time after a longer
delay. Exits are counted in a tally, which `/metrics` and `/readyz` show.

Exit code 2 of the server, or of the relay at its first start, is a wrong setup: the program stops
with code 2.
"""

import logging
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

from edge_server.config import Config
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.store.files.read_only import is_read_only
from edge_server.store.files.tally import PART_DEATHS, Tally

LOG = logging.getLogger(__name__)
PARENT_VARIABLE: Final = "EDGE_SERVER_PARENT"
MAXIMUM_EXITS: Final = 5
WITHIN_S: Final = 60.0
STOP_WAIT_S: Final = 10.0
SETTLED_S: Final = 5.0
"""So long after its start a server that cannot serve may still run."""
FIRST_WAIT_S: Final = 0.2
LONGEST_WAIT_S: Final = 30.0
_LOOK_S: Final = 0.2


class Exits:
    """Exits of a process and its restart delay; times are monotonic seconds."""

    def __init__(self) -> None:
        self._at: deque[float] = deque(maxlen=MAXIMUM_EXITS)
        self._in_a_row = 0
        self.total = 0

    def note(self, started_at: float, now: float) -> float:
        """Record an exit; returns the delay before the restart [s].

        The delay doubles with every exit, and starts again after a run of a minute.
        """
        self.total += 1
        self._in_a_row = self._in_a_row + 1 if now - started_at < WITHIN_S else 1
        self._at.append(now)
        return float(min(FIRST_WAIT_S * 2.0 ** min(self._in_a_row - 1, 30), LONGEST_WAIT_S))

    @property
    def are_too_many(self) -> bool:
        """Whether the process has exited too often within a minute."""
        return len(self._at) == MAXIMUM_EXITS and self._at[-1] - self._at[0] < WITHIN_S


class Kind(NamedTuple):
    """A kind of process: its command, and whether its failure stops the program."""

    name: str
    is_vital: bool


_KINDS: Final = (Kind("serve", is_vital=True), Kind("relay", is_vital=False))


class Part:
    """One child process and its exits."""

    def __init__(self, kind: Kind, arguments: Sequence[str]) -> None:
        self.kind = kind
        self._command = [sys.executable, "-m", "edge_server", *arguments, kind.name]
        self.exits = Exits()
        self.start(time.monotonic())

    def start(self, now: float) -> None:
        """Start the process."""
        environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
        self.process = subprocess.Popen(self._command, env=environment, start_new_session=True)  # noqa: S603  # this program
        self.started_at = now
        self.start_at: float | None = None

    def has_exited(self, now: float) -> float:
        """Record the exit of the process; returns the delay before the restart [s]."""
        wait_s = self.exits.note(self.started_at, now)
        self.start_at = now + wait_s
        return wait_s


class Supervisor:
    """Runs the processes until a signal, a wrong setup or a server that keeps failing."""

    def __init__(self, arguments: Sequence[str], config: Config) -> None:
        self._config = config
        self._tally: Tally | None = None
        self._stopped = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        self._parts = [Part(kind, arguments) for kind in _KINDS]

    def _on_signal(self, *_: object) -> None:
        """Shut down; exit at once at the second signal (the children exit with this process)."""
        if self._stopped:
            os._exit(FAILED)
        self._stopped = True

    def run(self) -> int:
        """Supervise the processes; returns the exit code."""
        code = OK
        while not self._stopped and code == OK:
            for part in self._parts:
                code = code or self._watch(part, time.monotonic())
            time.sleep(_LOOK_S)
        self._stop_all()
        return code

    def _watch(self, part: Part, now: float) -> int:
        if part.start_at is not None:
            if now >= part.start_at:
                part.start(now)
            return OK
        code = part.process.poll()
        if code is None or self._stopped:
            return OK
        if code == WRONG_SETUP and (part.kind.is_vital or part.exits.total == 0):
            return WRONG_SETUP
        wait_s = part.has_exited(now)
        self._count(part)
        if not part.kind.is_vital:
            LOG.error(
                "%s exited with code %d (%d times so far); it restarts in %.1f s; meanwhile %s",
                *(part.kind.name, code, part.exits.total, wait_s, self._what_is_served()),
            )
        elif not part.exits.are_too_many:
            LOG.warning("%s exited with code %d; restarting it", part.kind.name, code)
        else:
            LOG.error(
                "%s exited %d times within %.0f s; giving up",
                part.kind.name,
                MAXIMUM_EXITS,
                WITHIN_S,
            )
            return FAILED
        return OK

    def _what_is_served(self) -> str:
        vital = [one for one in self._parts if one.kind.is_vital]
        if any(one.process.poll() is not None for one in vital):
            return "nothing is stored or served: the server does not run either"
        if any(time.monotonic() - one.started_at < SETTLED_S for one in vital):
            return "the server starts too: /readyz shows when it is ready"
        if is_read_only(self._config.edge_dir):
            return "nothing is stored: the file system of the state folder is read-only"
        return "records are stored, and reports, plans and aborts are served"

    def _count(self, part: Part) -> None:
        if self._tally is None:  # Created late: the state folder may not exist before
            self._tally = Tally(self._config.supervisor_tally_path)
        self._tally.add(PART_DEATHS, part.kind.name)

    def _stop_all(self) -> None:
        """Terminate all processes; kill those that do not exit in time."""
        for part in self._parts:
            if part.process.poll() is None:
                part.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + STOP_WAIT_S
        for part in self._parts:
            try:
                part.process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                LOG.warning("%s does not exit; killing it", part.kind.name)
                part.process.kill()
                part.process.wait()
