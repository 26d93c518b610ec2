"""A user at the tester's terminal: a program on a real pseudo-terminal, or behind a pipe."""

import fcntl
import os
import pty
import re
import select
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, Final

from tests.support.system import ROOT

PATIENCE_S: Final = 90.0


class TerminalUser:
    """Reads what the program shows and types; `meanwhile` advances the rest of the system."""

    def __init__(self, process: subprocess.Popen[bytes], screen: int, keys: int) -> None:
        self._process = process
        self._screen = screen
        self._keys = keys
        self._read = 0
        self.shown = ""
        self.meanwhile: Callable[[], object] = lambda: time.sleep(0.01)

    def type(self, *lines: str) -> None:
        """Type lines, without looking."""
        self.press("".join(f"{line}\n" for line in lines))

    def press(self, keys: str) -> None:
        """Press keys."""
        os.write(self._keys, keys.encode())

    def wait_for_texts(self, *texts: str) -> None:
        """Wait until the texts are shown, one behind the other, after what was read before."""
        for text in texts:
            self._read = self.wait_for(partial(self._found, text), text)

    def answer(self, asked: str, line: str) -> None:
        """Wait for a question and type the answer."""
        self.wait_for_texts(asked)
        self.type(line)

    def wait_for(self, condition: Callable[[], Any], what: str) -> Any:
        """Advance the system until the condition returns something true; return that."""
        deadline = time.monotonic() + PATIENCE_S
        while not (outcome := condition()):
            assert time.monotonic() < deadline, f"waited for {what}; shown: {self.shown[-1500:]}"
            self.meanwhile()
            self._look()
        return outcome

    def close_input(self) -> None:
        """Close the pipe: no more input follows."""
        if self._keys >= 0:
            os.close(self._keys)
            self._keys = -1

    def wait_for_exit(self) -> int:
        """Wait until the program has ended; return its exit code."""
        self.wait_for(lambda: self._process.poll() is not None, "the end")
        self._look()
        return self._process.wait()

    def _found(self, text: str) -> int:
        """Place behind a text, however lines are ended and whatever stands between words."""
        pattern = r"\s+".join(map(re.escape, text.split()))
        match = re.compile(pattern).search(self.shown, self._read)
        return match.end() if match else 0

    def _look(self) -> None:
        while select.select([self._screen], [], [], 0.0)[0]:
            try:
                chunk = os.read(self._screen, 65_536)
            except OSError:  # The other end of the terminal has gone
                return
            if not chunk:
                return
            self.shown += chunk.decode()


def _tester(port: int, arguments: Sequence[str], **more: Any) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "sim.tester", "--broker", f"127.0.0.1:{port}", *arguments]
    return subprocess.Popen(command, cwd=ROOT, start_new_session=True, **more)


def _take_terminal() -> None:
    """Make the terminal at the input the session's own, whose keys send signals."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@contextmanager
def at_terminal(port: int, *arguments: str) -> Iterator[TerminalUser]:
    """A user at a terminal, which echoes and sends signals as terminals do."""
    ours, theirs = pty.openpty()
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), theirs)
    process = _tester(port, ("--seed", "1", *arguments), preexec_fn=_take_terminal, **streams)
    try:
        os.close(theirs)
        yield TerminalUser(process, ours, ours)
    finally:
        process.kill()
        process.wait()
        os.close(ours)


@contextmanager
def behind_pipe(port: int, *arguments: str) -> Iterator[TerminalUser]:
    """A user whose lines come through a pipe."""
    screen, their_screen = os.pipe()
    their_keys, keys = os.pipe()
    process = _tester(port, arguments, stdin=their_keys, stdout=their_screen, stderr=their_screen)
    os.close(their_keys)
    os.close(their_screen)
    user = TerminalUser(process, screen, keys)
    try:
        yield user
    finally:
        process.kill()
        process.wait()
        os.close(screen)
        user.close_input()
