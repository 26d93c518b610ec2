"""A real Mosquitto on a port of its own: started, stopped, killed and started again."""

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.polling import PATIENCE_S
from tests.support.system import free_ports

_PATH = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/usr/local/sbin"])


class Mosquitto:
    """A broker in a folder; its port stays the same over restarts."""

    def __init__(self, folder: Path, *lines: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.port = free_ports(1)[0]
        self._lines = lines
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"mqtt://127.0.0.1:{self.port}/afarcloud/farm"

    def configure(self, *lines: str) -> None:
        """Other lines of configuration from the next start on."""
        self._lines = lines

    def start(self) -> "Mosquitto":
        lines = [f"listener {self.port} 127.0.0.1", "set_tcp_nodelay true", *self._lines]
        if os.geteuid() == 0:
            lines.append("user root")  # Else it could not read this folder
        if not any(line.startswith(("allow_anonymous", "require_certificate")) for line in lines):
            lines.append("allow_anonymous true")
        file = self.folder / "mosquitto.conf"
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        with (self.folder / "mosquitto.log").open("ab") as log:
            self._process = subprocess.Popen(
                [program("mosquitto"), "-c", str(file)], stdout=log, stderr=log
            )
        self._wait_until_it_listens()
        return self

    def stop(self) -> None:
        """End in order: what is to persist is written."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._process = None

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def hang(self) -> None:
        """Keep all connections and do nothing."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        assert self._process is not None
        self._process.send_signal(signal.SIGCONT)

    def log(self) -> str:
        return (self.folder / "mosquitto.log").read_text(errors="replace")

    def _wait_until_it_listens(self) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while True:
            assert self._process is not None
            assert self._process.poll() is None, f"mosquitto ended: {self.log()}"
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1.0).close()
            except OSError:
                assert time.monotonic() < deadline, f"mosquitto does not listen: {self.log()}"
                time.sleep(0.02)
            else:
                return


def program(name: str) -> str:
    """Where a program of Mosquitto is; a machine without it cannot run these tests."""
    found = shutil.which(name, path=_PATH)
    assert found is not None, f"{name} is missing: apt-get install mosquitto"
    return found


def password_file(folder: Path, **passwords: str) -> Path:
    """Make a file of users for Mosquitto."""
    file = folder / "users"
    file.touch(mode=0o600)
    for user, password in passwords.items():
        subprocess.run(
            [program("mosquitto_passwd"), "-b", str(file), user, password],
            check=True,
            capture_output=True,
        )
    return file


@contextmanager
def running_mosquitto(folder: Path, *lines: str) -> Iterator[Mosquitto]:
    """Run a broker for a while."""
    broker = Mosquitto(folder, *lines).start()
    try:
        yield broker
    finally:
        broker.kill()
