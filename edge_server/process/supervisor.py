"""Supervises server and relay: a process that exits is restarted.

Both are forked from this process, which has loaded the modules that both use: SQLAlchemy alone
takes 17 MB, and they share its pages.

A server that exits five times within a minute stops the program with code 1. The relay never stops
it: reports, plans and aborts are served while the relay is restarted, each time after a longer
delay. Exits are counted in a tally, which `/metrics` and `/readyz` show.

Exit code 2 of the server, or of the relay at its first start, is a wrong setup: the program stops
with code 2.
"""

import gc
import importlib
import logging
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from setproctitle import getproctitle, setproctitle

from edge_server.config import Config
from edge_server.process import children
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.store.files.read_only import is_read_only
from edge_server.store.files.tally import PART_DEATHS, Tally
from edge_server.uplinks.mqtt_protocol import is_mqtt

LOG = logging.getLogger(__name__)
_STOP_SIGNALS: Final = (signal.SIGTERM, signal.SIGINT)
_SHARED_MODULES: Final = ("edge_server.process.relay", "edge_server.process.server")
MAXIMUM_EXITS: Final = 5
WITHIN_S: Final = 60.0
STOP_WAIT_S: Final = 10.0
SETTLED_S: Final = 5.0
"""So long after its start a server that cannot serve may still run."""
FIRST_WAIT_S: Final = 0.2
LONGEST_WAIT_S: Final = 30.0
FORK_WAIT_S: Final = 2.0
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
    """A kind of process: its command's name and function, and whether its failure is the end."""

    name: str
    run: Callable[[], int]
    """Returns the exit code."""
    is_vital: bool


class Part:
    """One child process and its exits."""

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.exits = Exits()
        self.process: multiprocessing.context.ForkProcess | None = None
        self.started_at = 0.0
        self.start_at: float | None = 0.0

    @property
    def is_running(self) -> bool:
        """Whether the process runs."""
        return self.process is not None and self.process.exitcode is None

    def start(self, now: float) -> None:
        """Start the process; where the system has no room for one more, try again later."""
        try:
            self.process = fork(self.kind)
        except OSError as error:
            self.start_at = now + FORK_WAIT_S
            LOG.error("%s cannot be started now (%s)", self.kind.name, error.strerror)  # noqa: TRY400  # the reason is enough
        else:
            self.started_at = now
            self.start_at = None

    def has_exited(self, now: float) -> float:
        """Record the exit of the process; returns the delay before the restart [s]."""
        wait_s = self.exits.note(self.started_at, now)
        self.start_at = now + wait_s
        return wait_s


def load_shared_modules(config: Config) -> None:
    """Load what the processes have in common, and keep the garbage collector from its pages."""
    for name in _SHARED_MODULES:
        importlib.import_module(name)
    if not is_mqtt(config.cloud_url):
        importlib.import_module("edge_server.uplinks.cloud_http")
    gc.collect()
    gc.freeze()
    children.bound_free_memory()


def fork(kind: Kind) -> "multiprocessing.context.ForkProcess":
    """Start a process in a session of its own, named after its command."""
    process = multiprocessing.get_context("fork").Process(
        target=_run_in_child, args=(kind, os.getpid()), name=kind.name
    )
    # A signal that comes before the child handles it by itself must not be lost in our handler
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _STOP_SIGNALS)
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    return process


def _run_in_child(kind: Kind, parent: int) -> None:
    os.setsid()
    for number in _STOP_SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOP_SIGNALS)
    children.exit_with_parent(parent)
    setproctitle(f"{getproctitle()} {kind.name}")
    try:
        code = kind.run()
    except Exception:  # noqa: BLE001  # logged as where it ends a program
        sys.excepthook(*sys.exc_info())
        code = FAILED
    sys.exit(code)


class Supervisor:
    """Runs the processes until a signal, a wrong setup or a server that keeps failing.

    It handles signals from the beginning; `run` starts the processes.
    """

    def __init__(self, kinds: Sequence[Kind], config: Config) -> None:
        self._config = config
        self._tally: Tally | None = None
        self._stopped = False
        for number in _STOP_SIGNALS:
            signal.signal(number, self._on_signal)
        self._parts = [Part(kind) for kind in kinds]

    def _on_signal(self, *_: object) -> None:
        """Shut down; exit at once at the second signal (the children exit with this process)."""
        if self._stopped:
            os._exit(FAILED)
        self._stopped = True

    def run(self) -> int:
        """Supervise the processes; returns the exit code."""
        code = OK
        try:
            while not self._stopped and code == OK:
                for part in self._parts:
                    code = code or self._watch(part, time.monotonic())
                time.sleep(_LOOK_S)
        finally:  # Also of its own failure: the end of this process waits for them
            self._stop_all()
        return code

    def _watch(self, part: Part, now: float) -> int:
        if part.start_at is not None:
            if now >= part.start_at:
                part.start(now)
            return OK
        code = None if part.process is None else part.process.exitcode
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
        if not all(one.is_running for one in vital):
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
        running = [(one.kind.name, one.process) for one in self._parts if one.process is not None]
        for _, process in running:
            if process.exitcode is None:
                process.terminate()
        deadline = time.monotonic() + STOP_WAIT_S
        for name, process in running:
            process.join(max(deadline - time.monotonic(), 0.0))
            if process.exitcode is None:
                LOG.warning("%s does not exit; killing it", name)
                process.kill()
                process.join()
