"""One vehicle as a process of its own: start, serve, stop."""

import json
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

pytestmark = pytest.mark.scenario


@contextmanager
def udp_socket() -> Iterator[socket.socket]:
    """A socket on a free port, patient for ten seconds."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(10.0)
        yield peer


@pytest.fixture
def broker() -> Iterator[socket.socket]:
    with udp_socket() as peer:
        yield peer


@pytest.fixture
def ground_station() -> Iterator[socket.socket]:
    with udp_socket() as peer:
        yield peer


def address(peer: socket.socket) -> str:
    host, port = peer.getsockname()
    return f"{host}:{port}"


def command_line(folder: Path, *flags: str) -> list[str]:
    return [
        *(sys.executable, "-m", "uav_firmware", "--system-id", "9", "--port", "0"),
        *("--state-dir", str(folder), *flags),
    ]


@contextmanager
def running(folder: Path, *flags: str) -> Iterator[subprocess.Popen[str]]:
    """A vehicle that has said that it flies."""
    with subprocess.Popen(
        command_line(folder, *flags), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert "flying jsbsim" in process.stdout.readline()
            yield process
        finally:
            process.kill()


def messages_of(datagram: bytes) -> list[common.MAVLink_message]:
    codec = common.MAVLink(None)
    codec.robust_parsing = True
    return codec.parse_buffer(datagram) or []


def wait_for(peer: socket.socket, kind: str) -> tuple[common.MAVLink_message, tuple[str, int]]:
    """The next message of a kind and where it came from."""
    while True:
        datagram, sender = peer.recvfrom(4096)
        for message in messages_of(datagram):
            if message.get_type() == kind:
                return message, sender


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_sends_to_both_peers_and_stops_on_request(
    tmp_path: Path, broker: socket.socket, ground_station: socket.socket, number: int
) -> None:
    peers = ("--broker", address(broker), "--gcs", address(ground_station), "--truth")
    with running(tmp_path, *peers) as process:
        for peer in (broker, ground_station):
            heartbeat, _ = wait_for(peer, "HEARTBEAT")
            assert heartbeat.get_srcSystem() == 9
            assert heartbeat.autopilot == common.MAV_AUTOPILOT_PX4
        process.send_signal(number)
        output, errors = process.communicate(timeout=10)
        assert process.returncode == 0
        assert "stopped after" in output
        assert errors == ""
    truth = (tmp_path / "vehicle-9" / "truth.csv").read_text()
    assert truth.startswith("time_s,")
    assert truth.endswith("\n")


def test_a_changed_parameter_is_on_disk_when_it_is_acknowledged(
    tmp_path: Path, broker: socket.socket, ground_station: socket.socket
) -> None:
    peers = ("--broker", address(broker), "--gcs", address(ground_station))
    codec = common.MAVLink(None, srcSystem=255, srcComponent=190)
    change = common.MAVLink_param_set_message(
        9, 1, b"MIS_TAKEOFF_ALT", 7.5, common.MAV_PARAM_TYPE_REAL32
    )
    with running(tmp_path, *peers) as process:
        _, vehicle = wait_for(ground_station, "HEARTBEAT")
        ground_station.sendto(change.pack(codec), vehicle)
        answer, _ = wait_for(ground_station, "PARAM_VALUE")
        assert struct.pack("<f", answer.param_value) == struct.pack("<f", 7.5)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=10)
    stored = json.loads((tmp_path / "vehicle-9" / "parameters.json").read_text())
    assert stored == {"MIS_TAKEOFF_ALT": 7.5}


def test_a_taken_port_is_one_sentence(tmp_path: Path, broker: socket.socket) -> None:
    _, port = broker.getsockname()
    run = subprocess.run(
        command_line(tmp_path, "--port", str(port)), check=False, capture_output=True, text=True
    )
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert str(port) in run.stderr


@pytest.mark.parametrize(
    ("flags", "named"),
    [
        (["--system-id", "0"], "--system-id"),
        (["--broker", "no.such.host.invalid:1"], "--broker"),
        (["--state-dir", "/dev/null/nowhere"], "/dev/null"),
        (["--broker-signing-key", "/nowhere.key"], "/nowhere.key"),
        (["--gcs-signing-key", "/dev/null"], "--gcs-signing-key"),
        (["--setup-signing", "everybody"], "--setup-signing"),
    ],
)
def test_an_unusable_input_is_refused_with_one_sentence(
    tmp_path: Path, flags: list[str], named: str
) -> None:
    run = subprocess.run(
        command_line(tmp_path, *flags), check=False, capture_output=True, text=True
    )
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert named in run.stderr


def test_a_signing_state_that_cannot_be_understood_is_one_sentence(tmp_path: Path) -> None:
    folder = tmp_path / "vehicle-9"
    folder.mkdir()
    (folder / "signing.json").write_text("?")
    run = subprocess.run(command_line(tmp_path), check=False, capture_output=True, text=True)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "signing.json" in run.stderr


def test_beyond_loopback_a_vehicle_without_a_key_warns_that_it_is_open(tmp_path: Path) -> None:
    with subprocess.Popen(
        command_line(tmp_path, "--bind", "0.0.0.0"), stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert "is unsigned" in process.stdout.readline()
        finally:
            process.kill()
