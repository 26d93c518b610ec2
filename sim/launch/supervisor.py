"""Starts programs, restarts them, and stops them with all their child processes.

A program that dies is restarted, as by a service manager. One that dies repeatedly ends the
system with the last lines that it printed.
"""

import ctypes
import os
import signal
import socket
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, Final, Self

from sim.launch.processes import Program

LOG_BYTES_MAX: Final = 10 * 1024 * 1024
"""Size at which a log is renamed and another begun."""
LOGS_KEPT: Final = 3
"""Former logs that are kept; `.1` is the latest."""


class ProgramLog:
    """Keeps what a program prints in files of bounded size: `edge.log`, `edge.log.1`, ...

    A failed write loses the lines, and the program that prints them continues.
    """

    def __init__(
        self, path: Path, *, bytes_max: int = LOG_BYTES_MAX, kept: int = LOGS_KEPT
    ) -> None:
        """Append to a file that may exist; it is opened with the first line."""
        self._path = path
        self._bytes_max = bytes_max
        self._kept = kept
        self._file: BinaryIO | None = None
        self.lines_lost = 0

    def append(self, line: bytes) -> bool:
        """Keep a line with its end; gives whether the medium has taken it."""
        try:
            file = self._opened()
            if file.tell() and file.tell() + len(line) > self._bytes_max:
                self._rotate()
                file = self._opened()
            file.write(line)
        except OSError:
            self.lines_lost += 1
            self.close()  # The next line opens whatever is there then
            return False
        return True

    def close(self) -> None:
        """Keep nothing more."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _opened(self) -> BinaryIO:
        if self._file is None:
            self._file = self._path.open("ab", buffering=0)
        return self._file

    def _rotate(self) -> None:
        """Rename every log to the next number; the last is replaced."""
        self.close()
        for number in range(self._kept, 0, -1):
            former = self._numbered(number - 1)
            if former.exists():
                former.replace(self._numbered(number))

    def _numbered(self, number: int) -> Path:
        return self._path.with_name(f"{self._path.name}.{number}") if number else self._path


RESTART_DELAY_S = 1.0
EARLY_DEATH_S = 5.0
EARLY_DEATHS_ALLOWED = 4
STOP_TIMEOUT_S = 10.0
LINE_BYTES_MAX = 64 * 1024
"""A longer line is shown and kept in pieces."""
_PR_SET_PDEATHSIG = 1

LineSink = Callable[[str, str], None]
"""Called with a program's name and one line that it printed."""


class SupervisorError(Exception):
    """The system cannot run; the message says why.

    SupervisorError
      +- PortTakenError     another program holds a port
      +- ProgramFailedError a program dies again and again
      +- StateTakenError    another system has the state folder (`sim/launch/launcher.py`)
      +- NotHealthyError    the system does not come up (`sim/launch/launcher.py`)
    """


class PortTakenError(SupervisorError):
    """A port is in use."""


class ProgramFailedError(SupervisorError):
    """A program cannot stay up."""


def check_ports(programs: Sequence[Program]) -> None:
    """Make sure that the programs' ports are free.

    Raises:
        PortTakenError: naming the program and the port.
    """
    owners: dict[tuple[int, int], str] = {}
    for program in programs:
        for port, kind in (
            (program.tcp_port, socket.SOCK_STREAM),
            (program.udp_port, socket.SOCK_DGRAM),
        ):
            if port is None:
                continue
            owner = owners.setdefault((port, kind), program.name)
            if owner != program.name:
                raise PortTakenError(f"{program.name}: port {port} is that of {owner} too")
            with socket.socket(socket.AF_INET, kind) as probe:
                if kind == socket.SOCK_STREAM:
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind(("127.0.0.1", port))
                except OSError as error:
                    hint = f"; {program.port_setting} chooses another" * bool(program.port_setting)
                    raise PortTakenError(
                        f"{program.name}: port {port} cannot be used: {error.strerror}{hint}"
                    ) from None


class _Child:
    """One running program with its log."""

    def __init__(self, program: Program, environment: Mapping[str, str], log_dir: Path) -> None:
        self.program = program
        self._environment = environment
        self._log = ProgramLog(log_dir / f"{program.name}.log")
        self._lost_reported = False
        self.early_deaths = 0
        self.last_lines: deque[str] = deque(maxlen=20)
        self.restart_at = 0.0
        self.has_printed = False

    @property
    def is_up(self) -> bool:
        """Whether it runs, and does not wait to be started again."""
        return self.restart_at == 0.0 and self.process.poll() is None

    def start(self, sink: LineSink) -> None:
        """Start the program in a session of its own, bound to die with this process."""
        self.started_at = time.monotonic()
        self.process = subprocess.Popen(  # noqa: S603  # our own programs
            self.program.arguments,
            env=dict(self._environment),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=_die_with_parent,  # noqa: PLW1509  # one system call, no locks
        )
        threading.Thread(target=self._pump, args=(self.process, sink), daemon=True).start()

    def _pump(self, process: subprocess.Popen[bytes], sink: LineSink) -> None:
        stream = process.stdout
        if stream is None:
            return
        with stream:
            while raw := stream.readline(LINE_BYTES_MAX):
                line = raw.decode("utf-8", "replace").rstrip("\n")
                self.has_printed = True
                self.last_lines.append(line)
                if not self._log.append(raw) and not self._lost_reported:
                    self._lost_reported = True
                    sink("sim", f"WARNING the log of {self.program.name} cannot be written")
                sink(self.program.name, line)
        self._log.close()

    def died_early(self) -> bool:
        """Count this death; whether there were too many soon after the start."""
        early = time.monotonic() - self.started_at < EARLY_DEATH_S
        self.early_deaths = self.early_deaths + 1 if early else 0
        return self.early_deaths > EARLY_DEATHS_ALLOWED

    def signal_session(self, number: int) -> None:
        """Send a signal to the program and all that it has started."""
        try:
            os.killpg(self.process.pid, number)
        except ProcessLookupError:
            return


def _die_with_parent() -> None:
    """Ask the kernel to end this process when its parent dies, however it dies."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


class Supervisor:
    """All programs of one system. Use from one thread: children die with that thread."""

    def __init__(
        self,
        programs: Sequence[Program],
        environment: Mapping[str, str],
        log_dir: Path,
        sink: LineSink,
    ) -> None:
        log_dir.mkdir(parents=True, exist_ok=True)
        self._sink = sink
        self._children = [_Child(program, environment, log_dir) for program in programs]

    def __enter__(self) -> Self:
        for child in self._children:
            child.start(self._sink)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def step(self) -> None:
        """Start again what has died.

        Raises:
            ProgramFailedError: with its last lines, if a program keeps dying.
        """
        now = time.monotonic()
        for child in self._children:
            code = child.process.poll()
            if code is None:
                continue
            if child.restart_at == 0.0:
                self._sink("sim", f"WARNING {child.program.name} ended with code {code}")
                if code == 2 or child.died_early():
                    last = "\n  ".join(child.last_lines)
                    raise ProgramFailedError(f"{child.program.name} cannot run:\n  {last}")
                child.signal_session(signal.SIGKILL)
                child.restart_at = now + RESTART_DELAY_S
            elif now >= child.restart_at:
                child.restart_at = 0.0
                child.start(self._sink)

    def down(self) -> list[str]:
        """Names of the programs that do not run now."""
        return [child.program.name for child in self._children if not child.is_up]

    def silent(self) -> list[str]:
        """Names of the programs that have printed nothing yet: they still start."""
        return [child.program.name for child in self._children if not child.has_printed]

    def process_id(self, name: str) -> int:
        """Give the process id of a program by name."""
        return next(c.process.pid for c in self._children if c.program.name == name)

    def stop(self) -> None:
        """End all programs: asked first, killed after a while."""
        for child in self._children:
            child.signal_session(signal.SIGTERM)
        deadline = time.monotonic() + STOP_TIMEOUT_S
        for child in self._children:
            try:
                child.process.wait(max(0.1, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                self._sink("sim", f"WARNING {child.program.name} did not stop and was killed")
            child.signal_session(signal.SIGKILL)
            child.process.wait()
