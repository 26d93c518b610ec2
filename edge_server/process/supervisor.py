"""Server and relay side by side: a part that dies is started again.

A server that dies five times within a minute stops everything, code 1: without it there is nothing
to watch over. The relay never stops the server: reports, plans and aborts are served while it is
started again, each time after a longer wait. Its deaths are counted in a tally, which `/metrics`
and `/readyz` show.

A server that ends with exit code 2 has been set up wrongly, and so has a relay that does so when it
is first started: everything stops, code 2.
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
from edge_server.store.tally import PART_DEATHS, Tally

LOG = logging.getLogger(__name__)
PARENT_VARIABLE: Final = "EDGE_SERVER_PARENT"
DEATHS: Final = 5
WITHIN_S: Final = 60.0
STOP_WAIT_S: Final = 10.0
FIRST_WAIT_S: Final = 0.2
LONGEST_WAIT_S: Final = 30.0
_LOOK_S: Final = 0.2


class Deaths:
    """When a part has died, and what follows from it; times are monotonic seconds."""

    def __init__(self) -> None:
        self._at: deque[float] = deque(maxlen=DEATHS)
        self._in_a_row = 0
        self.total = 0

    def note(self, started_at: float, now: float) -> float:
        """Note a death; returns after how long the part should be started again [s].

        The wait doubles from death to death, and is short again for a part that has run for a
        minute.
        """
        self.total += 1
        self._in_a_row = self._in_a_row + 1 if now - started_at < WITHIN_S else 1
        self._at.append(now)
        return float(min(FIRST_WAIT_S * 2.0 ** min(self._in_a_row - 1, 30), LONGEST_WAIT_S))

    @property
    def are_hopeless(self) -> bool:
        """Whether the part has died too often within a minute."""
        return len(self._at) == DEATHS and self._at[-1] - self._at[0] < WITHIN_S


class Kind(NamedTuple):
    """A part: its command, and whether everything ends when it is hopeless."""

    name: str
    is_vital: bool


_KINDS: Final = (Kind("serve", is_vital=True), Kind("relay", is_vital=False))


class Part:
    """One child process and its deaths."""

    def __init__(self, kind: Kind, arguments: Sequence[str]) -> None:
        self.kind = kind
        self._command = [sys.executable, "-m", "edge_server", *arguments, kind.name]
        self.deaths = Deaths()
        self.start(time.monotonic())

    def start(self, now: float) -> None:
        """Start the process."""
        environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
        self.process = subprocess.Popen(self._command, env=environment, start_new_session=True)  # noqa: S603  # our own program
        self.started_at = now
        self.start_at: float | None = None

    def has_died(self, now: float) -> float:
        """Note the end of the process; returns after how long it is started again [s]."""
        wait_s = self.deaths.note(self.started_at, now)
        self.start_at = now + wait_s
        return wait_s


class Supervisor:
    """Runs the parts until a signal, a wrong set-up or a server that cannot be kept alive."""

    def __init__(self, arguments: Sequence[str], config: Config) -> None:
        self._config = config
        self._tally: Tally | None = None
        self._stopped = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        self._parts = [Part(kind, arguments) for kind in _KINDS]

    def _on_signal(self, *_: object) -> None:
        """End in order; a second signal is an order to end now (the parts die with us)."""
        if self._stopped:
            os._exit(FAILED)
        self._stopped = True

    def run(self) -> int:
        """Watch over the parts; returns the exit code."""
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
        if code == WRONG_SETUP and (part.kind.is_vital or part.deaths.total == 0):
            return WRONG_SETUP
        wait_s = part.has_died(now)
        self._count(part)
        if not part.kind.is_vital:
            LOG.error(
                "%s ended with code %d (%d times so far); it is started again in %.1f s; meanwhile"
                " records are kept, and reports, plans and aborts are served",
                *(part.kind.name, code, part.deaths.total, wait_s),
            )
        elif not part.deaths.are_hopeless:
            LOG.warning("%s ended with code %d; starting it again", part.kind.name, code)
        else:
            LOG.error("%s died %d times within %.0f s; giving up", part.kind.name, DEATHS, WITHIN_S)
            return FAILED
        return OK

    def _count(self, part: Part) -> None:
        if self._tally is None:  # Not before there is something to count: its folder may be missing
            self._tally = Tally(self._config.supervisor_tally_path)
        self._tally.add(PART_DEATHS, part.kind.name)

    def _stop_all(self) -> None:
        """Ask all parts to end, make them end if they do not."""
        for part in self._parts:
            if part.process.poll() is None:
                part.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + STOP_WAIT_S
        for part in self._parts:
            try:
                part.process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                LOG.warning("%s does not end; killing it", part.kind.name)
                part.process.kill()
                part.process.wait()
