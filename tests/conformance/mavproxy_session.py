"""A MAVProxy session without a window: lines go in by a pipe, what it prints is waited for."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Self

PATIENCE_S = 60.0
_PROGRAM = Path(sys.executable).with_name("mavproxy.py")


class MavProxy:
    """MAVProxy on a port that is sent to, or `udpout` to one; its files go to the test's folder."""

    def __init__(self, port: int, folder: Path, way: str = "udpin") -> None:
        self.folder = folder
        self._heard = ""
        self._mark = 0
        self._changed = threading.Condition()
        command = [
            sys.executable,
            str(_PROGRAM),
            f"--master={way}:127.0.0.1:{port}",
            f"--state-basedir={folder}",
            "--aircraft=field",
        ]
        self._process = subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, "HOME": str(folder), "PYTHONUNBUFFERED": "1", "TERM": "dumb"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End of input is how MAVProxy is left; it unloads its modules and goes."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            raise
        finally:
            self._listener.join()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                with self._changed:
                    self._heard += line
                    self._changed.notify_all()

    def type(self, line: str) -> None:
        """Type a line; what is waited for from now on was printed after it."""
        with self._changed:
            self._mark = len(self._heard)
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def until(self, pattern: str) -> re.Match[str]:
        """Wait until something is printed, and give the match; it is not found again."""
        deadline_s = time.monotonic() + PATIENCE_S
        with self._changed:
            while True:
                found = re.compile(pattern).search(self._heard, self._mark)
                if found:
                    self._mark = found.end()
                    return found
                self._changed.wait(1.0)
                given_up = self._process.poll() is not None or time.monotonic() > deadline_s
                assert not given_up, f"never printed: {pattern!r}\n{self._heard[-4000:]}"

    def ask(self, line: str, pattern: str) -> re.Match[str]:
        """Type a line and wait for what it has to bring."""
        self.type(line)
        return self.until(pattern)

    @property
    def log_folder(self) -> Path:
        """Where MAVProxy saves what it has fetched."""
        (folder,) = (self.folder / "field" / "logs").glob("*/flight*")
        return folder
