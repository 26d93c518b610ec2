"""The process beside the vehicle that renders pictures during the flight.

Rendering takes a third of a second of a core for 3 megapixels; in the vehicle's process it would
stop the flight. The process is started with the first picture, and again if it has died.
"""

import json
import os
import select
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Final, NamedTuple

import sim
from sim.camera.film.orders import Frame, Order, to_line

_COMMAND: Final = (sys.executable, "-m", "sim.camera")
_ROOT: Final = Path(sim.__file__).resolve().parents[1]
_CLOSE_S: Final = 5.0
_PICTURE_S: Final = 60.0
"""A process that ends no picture for so long hangs: `finished(wait=True)` gives it up."""
_CHUNK: Final = 65_536


class Rendered(NamedTuple):
    """Result of an order."""

    number: int
    size_bytes: int  # [B] Of all files together
    files: int
    error: str  # A sentence; empty for success


class _Running(NamedTuple):
    """The process and its two pipes."""

    process: "subprocess.Popen[bytes]"
    orders: IO[bytes]
    ends: IO[bytes]


class RenderProcess:
    """Receives orders and returns their results, in the same sequence."""

    def __init__(self, command: Sequence[str] = _COMMAND, *, inherits: Sequence[int] = ()) -> None:
        """Start processes with a command, which inherit file descriptors."""
        self._command = command
        self._inherits = inherits
        self._running: _Running | None = None
        self._pending: deque[int] = deque()
        self._rest = b""

    @property
    def pending(self) -> int:
        """Orders without an end."""
        return len(self._pending)

    def begin(self, order: Order | Frame) -> None:
        """Have a picture or a frame made.

        Raises:
            OSError: if the process cannot be started or takes no orders.
        """
        if self._running is None:
            self._running = _start(self._command, self._inherits)
        self._running.orders.write(to_line(order).encode() + b"\n")
        self._pending.append(order.number)

    def finished(self, *, wait: bool = False) -> list[Rendered]:
        """What has ended since the last call; with `wait`, at least one of those pending."""
        found: list[Rendered] = []
        while self._pending and self._running is not None and not found:
            ends = self._running.ends
            if not select.select([ends], [], [], _PICTURE_S if wait else 0.0)[0]:
                if wait:
                    return self._died()
                break
            chunk = os.read(ends.fileno(), _CHUNK)
            if not chunk:
                return self._died()
            found += self._read(chunk)
        return found

    def close(self) -> None:
        """End the process and wait for its end; pending pictures are discarded.

        For a program that ends: it may take seconds. In flight it is `stop`.
        """
        running = self._give_up()
        if running is not None:
            _end(running)

    def stop(self) -> None:
        """End the process without waiting for it; the next order starts another.

        A control loop may call this. A thread waits instead, and kills what does not end.
        """
        running = self._give_up()
        if running is not None:
            threading.Thread(target=_end, args=(running,), name="camera-end", daemon=True).start()

    def _give_up(self) -> _Running | None:
        running, self._running = self._running, None
        self._pending.clear()
        self._rest = b""
        return running

    def _read(self, chunk: bytes) -> list[Rendered]:
        *lines, self._rest = (self._rest + chunk).split(b"\n")
        ended = [Rendered(**json.loads(line)) for line in lines]
        for each in ended:
            self._pending.remove(each.number)
        return ended

    def _died(self) -> list[Rendered]:
        """Every pending picture is lost with the process; the next order starts another."""
        lost = [Rendered(number, 0, 0, "the camera has stopped") for number in self._pending]
        self.stop()
        return lost


def _start(command: Sequence[str], inherits: Sequence[int]) -> _Running:
    process = subprocess.Popen(  # noqa: S603 - our own module
        command,
        bufsize=0,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=_ROOT,
        pass_fds=inherits,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    if process.stdin is None or process.stdout is None:
        raise OSError("the camera's process has no pipes")
    return _Running(process, process.stdin, process.stdout)


def _end(running: _Running) -> None:
    """Close its input, on which it ends; kill what hangs."""
    with suppress(BrokenPipeError):
        running.orders.close()
    try:
        running.process.wait(_CLOSE_S)
    except subprocess.TimeoutExpired:
        running.process.kill()
        running.process.wait()
    running.ends.close()
