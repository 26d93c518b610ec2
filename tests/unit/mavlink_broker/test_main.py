"""The broker as a process: it starts before everything else, and stops cleanly."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
LISTENING = "listening on UDP"


def start(port: int, state: Path) -> subprocess.Popen[str]:
    environment = os.environ | {
        "STATE_DIR": str(state),
        "MAVLINK_PORT": str(port),
        "EDGE_URL": "http://127.0.0.1:9",
    }
    return subprocess.Popen(
        [sys.executable, "-m", "mavlink_broker"],
        cwd=ROOT,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until_listening(process: subprocess.Popen[str]) -> None:
    assert process.stderr is not None
    assert any(LISTENING in line for line in process.stderr)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_status_0(number: int, tmp_path: Path) -> None:
    with start(0, tmp_path) as process:
        wait_until_listening(process)
        process.send_signal(number)
        assert process.wait(timeout=20) == 0


def test_a_busy_port_is_one_sentence_and_status_2(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("0.0.0.0", 0))
        port = other.getsockname()[1]
        with start(port, tmp_path) as process:
            _, errors = process.communicate(timeout=20)
    assert process.returncode == 2
    assert errors == f"mavlink_broker: UDP port {port} is in use by another program\n"
