"""Server and relay side by side: a part that dies is started again, until it is hopeless.

A part that ends with exit code 2 has been set up wrongly: everything stops, code 2. One that
dies five times within a minute stops everything too, code 1.
"""

import logging
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import Final

from edge_server.exit_codes import FAILED, OK, WRONG_SETUP

LOG = logging.getLogger(__name__)
PARENT_VARIABLE: Final = "EDGE_SERVER_PARENT"
DEATHS: Final = 5
WITHIN_S: Final = 60.0
STOP_WAIT_S: Final = 10.0
_LOOK_S: Final = 0.2


class Part:
    """One child process and its deaths."""

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.name = name
        self._command = [sys.executable, "-m", "edge_server", *arguments, name]
        self._deaths: deque[float] = deque(maxlen=DEATHS)
        self.process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
        return subprocess.Popen(self._command, env=environment, start_new_session=True)  # noqa: S603  # our own program

    def revive(self, now: float) -> bool:
        """Start it again; false when it has died too often."""
        self._deaths.append(now)
        if len(self._deaths) == DEATHS and now - self._deaths[0] < WITHIN_S:
            return False
        self.process = self._start()
        return True


class Supervisor:
    """Runs the parts until a signal, a wrong set-up or a hopeless case."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self._stopped = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        self._parts = [Part(name, arguments) for name in ("serve", "relay")]

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
                code = code or self._watch(part)
            time.sleep(_LOOK_S)
        return self._stop_all() or code

    def _watch(self, part: Part) -> int:
        code = part.process.poll()
        if code is None or self._stopped:
            return OK
        if code == WRONG_SETUP:
            return WRONG_SETUP
        LOG.warning("%s ended with code %d; starting it again", part.name, code)
        if part.revive(time.monotonic()):
            return OK
        LOG.error("%s died %d times within %.0f s; giving up", part.name, DEATHS, WITHIN_S)
        return FAILED

    def _stop_all(self) -> int:
        """Ask all parts to end, make them end if they do not; returns the worst code."""
        for part in self._parts:
            if part.process.poll() is None:
                part.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + STOP_WAIT_S
        for part in self._parts:
            try:
                part.process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                LOG.warning("%s does not end; killing it", part.name)
                part.process.kill()
                part.process.wait()
        return OK
