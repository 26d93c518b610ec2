"""The broker as a process: it starts before everything else, and stops cleanly."""

import dataclasses
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.database import Database
from tests.support.broker_world import first_flight
from tests.support.fake_edge import FakeEdgeServer
from tests.support.link_ends import fly_over_udp
from tests.support.process_tree import full_pipe
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.system import free_ports
from tests.support.vehicle_script import PX4

ROOT = Path(__file__).parents[3]
LISTENING = "links udpin://0.0.0.0:"


def start(
    port: int,
    state: Path,
    edge_url: str = "http://127.0.0.1:9",
    stderr: int = subprocess.PIPE,
) -> subprocess.Popen[str]:
    environment = os.environ | {
        "STATE_DIR": str(state),
        "MAVLINK_PORT": str(port),
        "EDGE_URL": edge_url,
    }
    return subprocess.Popen(
        [sys.executable, "-m", "mavlink_broker"],
        cwd=ROOT,
        env=environment,
        stderr=stderr,
        text=True,
    )


def wait_until_listening(process: subprocess.Popen[str]) -> int:
    """Give the port that it listens on."""
    assert process.stderr is not None
    line = next(line for line in process.stderr if LISTENING in line)
    return int(line.split(LISTENING)[1].split(",")[0])


@pytest.mark.first_case
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_status_0(number: int, tmp_path: Path) -> None:
    with start(0, tmp_path) as process:
        wait_until_listening(process)
        process.send_signal(number)
        assert process.wait(timeout=20) == 0


@pytest.mark.thorough
def test_sigint_ends_it_also_where_its_starter_ignores_it(tmp_path: Path) -> None:
    """As `nohup` and `&` in a script do."""
    former = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process = start(0, tmp_path)
    finally:
        signal.signal(signal.SIGINT, former)
    with process:
        try:
            wait_until_listening(process)
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=20) == 0
        finally:
            process.kill()


@pytest.mark.thorough
def test_a_busy_port_is_one_sentence_and_status_2(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("0.0.0.0", 0))
        port = other.getsockname()[1]
        with start(port, tmp_path) as process:
            _, errors = process.communicate(timeout=20)
    assert process.returncode == 2
    assert errors == f"mavlink_broker: UDP port {port} is in use by another program\n"


@pytest.mark.thorough
def test_a_state_folder_that_another_broker_has_is_one_sentence_and_status_2(
    tmp_path: Path,
) -> None:
    database = Database(tmp_path / "broker")
    database.open()
    with start(0, tmp_path) as process:
        _, errors = process.communicate(timeout=20)
    database.close()
    assert process.returncode == 2
    expected = f"another broker uses {tmp_path}/broker; each broker needs a STATE_DIR of its own"
    assert errors == f"mavlink_broker: {expected}\n"


@pytest.mark.thorough
def test_a_state_folder_that_cannot_be_used_is_no_reason_not_to_fly(tmp_path: Path) -> None:
    (tmp_path / "broker").write_text("no folder")
    with start(0, tmp_path) as process:
        assert process.stderr is not None
        message = "posts that wait for the edge server are kept in memory only"
        assert any(message in line for line in process.stderr)
        wait_until_listening(process)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=20) == 0


@pytest.mark.thorough
def test_it_flies_a_mission_between_a_real_socket_and_real_http(tmp_path: Path) -> None:
    key = tmp_path / "keys" / "broker.key"
    script = dataclasses.replace(PX4, item_time_s=0.05)
    vehicle = ScriptedVehicle(1, script, booted_at=time.monotonic())
    with FakeEdgeServer(0, "secret").running() as server, start(0, tmp_path, server.url) as broker:
        port = wait_until_listening(broker)
        key.parent.mkdir()
        key.write_text("secret")
        server.plan(first_flight())
        fly_over_udp(vehicle, port, lambda: server.edge.status(1201) == Status.FINISHED)
        broker.send_signal(signal.SIGTERM)
        assert broker.wait(timeout=20) == 0
    assert server.edge.statuses(1201) == [Status.FINISHED] * 3
    assert vehicle.uploads == 1
    keys = [key for path, key in server.keys_seen if path == "/pose/"]
    assert len(set(keys)) == len(keys) == 3


@pytest.mark.thorough
def test_it_flies_while_the_reader_of_its_log_has_stalled(tmp_path: Path) -> None:
    """A pager that shows the first page, a terminal that is paused, a collector that hangs."""
    key = tmp_path / "keys" / "broker.key"
    key.parent.mkdir()
    key.write_text("secret")
    script = dataclasses.replace(PX4, item_time_s=0.05)
    vehicle = ScriptedVehicle(1, script, booted_at=time.monotonic())
    (port,) = free_ports(1)
    read_end, write_end = full_pipe()
    with (
        FakeEdgeServer(0, "secret").running() as server,
        start(port, tmp_path, server.url, stderr=write_end) as broker,
    ):
        os.close(write_end)
        try:
            server.plan(first_flight())
            fly_over_udp(vehicle, port, lambda: server.edge.status(1201) == Status.FINISHED)
            broker.send_signal(signal.SIGTERM)
            assert broker.wait(timeout=20) == 0
        finally:
            broker.kill()
            os.close(read_end)
