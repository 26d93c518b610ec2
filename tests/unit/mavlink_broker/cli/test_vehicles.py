"""`vehicles` lists the vehicles on the link, or asks the edge server of the broker that uses it."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.cli.program import UsageError
from mavlink_broker.cli.vehicles import COLUMNS, row, run, table
from mavlink_broker.mavlink.dialect import Route
from mavlink_broker.vehicle.telemetry import version
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.support.broker_world import World
from tests.support.link_ends import fly_over_udp
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, PX4

ROOT = Path(__file__).parents[4]


def test_a_vehicle_is_described_by_what_it_has_described() -> None:
    world = World()
    world.add_vehicle(3, ARDUPILOT)
    world.run(5.0)
    described = row(world.app.sessions[3].vehicle, world.clock.now)
    assert tuple(described) == COLUMNS
    assert described["system_id"] == described["vehicle_id"] == 3
    assert (described["autopilot"], described["type"]) == ("ardupilotmega", "quadrotor")
    assert (described["family"], described["link_state"]) == ("ardupilot", "connected")
    assert (described["mode"], described["armed"]) == ("STABILIZE", False)
    assert (round(described["latitude"], 4), described["battery_percentage"]) == (40.4434, 0.8)


def test_what_is_not_known_is_left_open() -> None:
    described = row(Vehicle(7, Route(254, 191, 1, 1)), 0.0)
    assert described["vehicle_id"] == 7
    assert {described[name] for name in ("autopilot", "version", "mode", "armed", "latitude")} == {
        None
    }
    *_, line = table([described])
    assert line.split()[:4] == ["1", "7", "-", "-"]


def test_a_version_is_read_from_its_bytes() -> None:
    assert version(0x011002FF) == "1.16.2"
    assert version(0) is None


@pytest.mark.thorough
def test_the_program_lists_a_vehicle_on_a_real_socket(tmp_path: Path) -> None:
    port = free_port()
    command = started(tmp_path, "--connect", f"udp://127.0.0.1:{port}", "--seconds", "2", "--json")
    with command as process:
        vehicle = ScriptedVehicle(1, PX4, booted_at=time.monotonic())
        fly_over_udp(vehicle, port, lambda: process.poll() is not None)
        out, _ = process.communicate()
    assert process.returncode == 0
    (described,) = json.loads(out)["vehicles"]
    assert (described["system_id"], described["family"], described["armed"]) == (1, "px4", False)


@pytest.mark.thorough
def test_nobody_there_is_status_1(tmp_path: Path) -> None:
    link = f"udp://127.0.0.1:{free_port()}"
    with started(tmp_path, "--connect", link, "--seconds", "0.1") as process:
        out, errors = process.communicate(timeout=30)
    assert (process.returncode, out) == (1, "")
    assert "no vehicle is connected" in errors


@pytest.mark.thorough
def test_a_link_that_a_broker_has_is_looked_at_through_its_edge_server(tmp_path: Path) -> None:
    (tmp_path / "keys").mkdir()
    (tmp_path / "keys" / "broker.key").write_text("secret")
    listed = {"vehicle_id": 4, "link_state": "connected", "mode": "AUTO.MISSION", "armed": True}
    with served([listed]) as url, taken() as port:
        more = ["--edge-url", url, "--mavlink-host", "127.0.0.1", "--mavlink-port", str(port)]
        with started(tmp_path, *more) as process:
            out, errors = process.communicate(timeout=30)
    assert process.returncode == 0
    assert f"asking {url}/vehicles/ instead" in errors
    assert "AUTO.MISSION" in out


@pytest.mark.parametrize("shown", [{"message": "hello"}, [1], ["a"], None, 5])
def test_an_answer_that_is_not_a_list_of_vehicles_is_an_error(tmp_path: Path, shown: Any) -> None:
    (tmp_path / "keys").mkdir()
    (tmp_path / "keys" / "broker.key").write_text("secret")
    with served(shown) as url, taken() as port:
        link = ["--mavlink-host", "127.0.0.1", "--mavlink-port", str(port)]
        state = ["--state-dir", str(tmp_path), "--edge-url", url]
        with pytest.raises(UsageError, match="its answer is not a list of vehicles"):
            run([*link, *state], {})


@pytest.mark.thorough
def test_a_link_that_was_asked_for_and_is_taken_is_misuse(tmp_path: Path) -> None:
    with taken() as port, started(tmp_path, "--connect", f"udp://127.0.0.1:{port}") as process:
        _, errors = process.communicate(timeout=30)
    assert process.returncode == 2
    assert "is in use by another program" in errors


@contextmanager
def started(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "mavlink_broker", "vehicles", *arguments],
        cwd=ROOT,
        env=os.environ | {"STATE_DIR": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def free_port() -> int:
    with taken() as port:
        return port


@contextmanager
def taken() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        yield other.getsockname()[1]


@contextmanager
def served(vehicles: Any) -> Iterator[str]:
    """An edge server that knows nothing but its vehicles, or what it answers instead."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            allowed = self.headers["Authorization"] == "Bearer secret"
            body = json.dumps(vehicles if self.path == "/vehicles/" and allowed else {}).encode()
            self.send_response(200 if allowed else 401)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            """Keep quiet."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()
