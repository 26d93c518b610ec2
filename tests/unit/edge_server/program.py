"""The edge server as a program: started, asked, killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import requests

START_S = 30.0


def free_port() -> int:
    """A port that nobody uses right now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def descendants(pid: int) -> list[int]:
    """Process ids below one, from /proc."""
    parents: dict[int, int] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(stat.parent.name)] = int(fields[1])
    found = [child for child, parent in parents.items() if parent == pid]
    return found + [below for child in found for below in descendants(child)]


def gone(pids: list[int], within_s: float = 5.0) -> bool:
    """Whether none of these runs any more, after a moment."""
    deadline = time.monotonic() + within_s
    while any(_runs(pid) for pid in pids):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _runs(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


class Program:
    """One run after the other over the same state folder."""

    def __init__(self, state_dir: Path, cloud_url: str) -> None:
        self.state_dir = state_dir
        self.port = free_port()
        self.environment = os.environ | {
            "STATE_DIR": str(state_dir),
            "EDGE_PORT": str(self.port),
            "CLOUD_URL": cloud_url,
            "RELAY_BACKOFF_CAP_S": "0.2",
            "RELAY_BACKOFF_BASE_S": "0.05",
        }
        self.process: subprocess.Popen[str] | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def spawn(self, *arguments: str) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", "edge_server", *arguments]
        return subprocess.Popen(
            command,
            env=self.environment,
            stderr=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def start(self, *arguments: str) -> None:
        self.process = self.spawn(*arguments)
        self.wait_ready()

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
        """Send a signal; returns exit code and what it wrote to stderr."""
        assert self.process is not None
        self.process.send_signal(how)
        return self.wait()

    def wait(self) -> tuple[int, str]:
        assert self.process is not None
        _, errors = self.process.communicate(timeout=30.0)
        code = self.process.returncode
        self.process = None
        return code, errors


@contextmanager
def program_in(state_dir: Path, cloud_url: str = "http://127.0.0.1:9") -> Iterator[Program]:
    """Give a program, and leave nothing of it behind."""
    program = Program(state_dir, cloud_url)
    try:
        yield program
    finally:
        if program.process is not None:
            program.end(signal.SIGKILL)
