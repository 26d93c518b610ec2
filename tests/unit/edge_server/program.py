"""The edge server as a program: started, requested, killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import requests

from tests.support.polling import PATIENCE_S
from tests.support.system import free_ports

START_S = PATIENCE_S


class Program:
    """One run after the other over the same state folder."""

    def __init__(self, state_dir: Path, cloud_url: str) -> None:
        self.state_dir = state_dir
        self.port = free_ports(1)[0]
        self.environment = os.environ | {
            "STATE_DIR": str(state_dir),
            "EDGE_PORT": str(self.port),
            "CLOUD_URL": cloud_url,
            "RELAY_BACKOFF_CAP_S": "0.2",
            "RELAY_BACKOFF_BASE_S": "0.05",
        }
        self.process: subprocess.Popen[str] | None = None
        self._log = state_dir.with_name(f"{state_dir.name}.log")

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def spawn(
        self, *arguments: str, stderr: IO[str] | int = subprocess.PIPE
    ) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", "edge_server", *arguments]
        return subprocess.Popen(
            command,
            env=self.environment,
            stderr=stderr,
            stdout=subprocess.DEVNULL if stderr is not subprocess.PIPE else subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def start(self, *arguments: str) -> None:
        self.begin(*arguments)
        self.wait_ready()

    def begin(self, *arguments: str) -> None:
        """Start the program; its log goes to a file, since a full pipe would block it."""
        with self._log.open("w", encoding="utf-8") as log:
            self.process = self.spawn(*arguments, stderr=log)

    def wait_ready(self) -> None:
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline:
            assert self.process is None or self.process.poll() is None, "it ended"
            try:
                if requests.get(f"{self.url}/readyz", timeout=2.0).ok:
                    return
            except requests.RequestException:
                time.sleep(0.02)
        raise AssertionError("it never became ready")

    def key(self, role: str) -> str:
        return (self.state_dir / "keys" / f"{role}.key").read_text(encoding="ascii").strip()

    def end(self, how: int = signal.SIGTERM) -> tuple[int, str]:
        """Send a signal; returns exit code and log."""
        assert self.process is not None
        self.process.send_signal(how)
        return self.wait()

    def wait(self) -> tuple[int, str]:
        assert self.process is not None
        code = self.process.wait(PATIENCE_S)
        self.process = None
        return code, self.log()

    def log(self) -> str:
        """What the program has written since it was started."""
        return self._log.read_text(encoding="utf-8")


@contextmanager
def program_in(state_dir: Path, cloud_url: str = "http://127.0.0.1:9") -> Iterator[Program]:
    """Give a program, and leave nothing of it behind."""
    program = Program(state_dir, cloud_url)
    try:
        yield program
    finally:
        if program.process is not None:
            program.end(signal.SIGKILL)
