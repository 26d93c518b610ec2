"""Health checks: a program is well only while it does its work."""

import fcntl
import socket
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from deploy import health
from deploy.health import UnwellError
from edge_server.config import Config
from edge_server.process.relay import StateFolderLock
from edge_server.relay_health import STALLED_AFTER_S

HEADER = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid\n"


class Answer(BaseHTTPRequestHandler):
    """Answers /readyz as the test chooses, and everything else with 404."""

    status = 200

    def do_GET(self) -> None:
        self.send_response(self.status if self.path in {"/readyz", "/healthz"} else 404)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@pytest.fixture
def server() -> Iterator[tuple[type[Answer], int]]:
    handler = type("Answering", (Answer,), {})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        thread = threading.Thread(target=running.serve_forever, args=(0.01,))
        thread.start()
        yield handler, running.server_address[1]
        running.shutdown()
        thread.join()


@pytest.mark.parametrize(
    ("program", "variable"), [("edge-server", "EDGE_PORT"), ("cloud", "CLOUD_PORT")]
)
def test_a_server_is_well_while_it_says_so(
    server: tuple[type[Answer], int],
    program: str,
    variable: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    handler, port = server
    assert health.main([program], {variable: str(port)}) == 0
    handler.status = 503
    assert health.main([program], {variable: str(port)}) == 1
    assert "503" in capsys.readouterr().err


def test_a_server_that_does_not_answer_is_unwell() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # Bound, but nobody listens
        with pytest.raises(UnwellError, match="does not answer"):
            health.ask_http(taken.getsockname()[1], "/readyz")


def test_where_only_known_clients_get_an_answer_a_connection_is_enough() -> None:
    environment = {"EDGE_TLS_CLIENT_CA_FILE": "ca.pem"}
    with socket.create_server(("127.0.0.1", 0)) as listener:
        environment["EDGE_PORT"] = str(listener.getsockname()[1])
        assert health.main(["edge-server"], environment) == 0
    assert health.main(["edge-server"], environment) == 1


@pytest.mark.parametrize("program", ["broker", "vehicle"])
def test_who_speaks_mavlink_is_well_while_it_listens(program: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        port = link.getsockname()[1]
        environment = {
            "MAVLINK_PORT": str(port),
            "SYSTEM_ID": "7",
            "VEHICLE_PORT_BASE": str(port - 7),
        }
        assert health.main([program], environment) == 0
    assert health.main([program], environment) == 1


def test_a_broker_with_links_of_its_own_is_looked_at_where_it_listens() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        port = link.getsockname()[1]
        environment = {"LINKS": f"serial:///dev/ttyUSB0:57600, udpin://127.0.0.1:{port}"}
        assert health.main(["broker"], environment) == 0
    assert health.main(["broker"], environment) == 1
    assert health.main(["broker"], {"LINKS": "serial:///dev/ttyUSB0:57600"}) == 0


@pytest.mark.parametrize(("unread", "well"), [(0, True), (131_072, True), (131_073, False)])
def test_who_leaves_its_socket_full_is_unwell(tmp_path: Path, unread: int, *, well: bool) -> None:
    table = tmp_path / "udp"
    row = "15440: 00000000:38CC 00000000:0000 07 00000000:{:08X} 00:00000000 00000000 10001\n"
    table.write_text(HEADER + row.format(unread))
    if well:
        health.look_at_socket(14540, (table,))
    else:
        with pytest.raises(UnwellError, match=str(unread)):
            health.look_at_socket(14540, (table,))
    with pytest.raises(UnwellError, match="nobody listens"):
        health.look_at_socket(14541, (table,))


def test_a_relay_is_well_while_it_holds_its_lock(tmp_path: Path) -> None:
    environment = {"STATE_DIR": str(tmp_path)}
    assert health.main(["relay"], environment) == 1  # There is no lock at all
    lock = tmp_path / "edge" / "relay.lock"
    lock.parent.mkdir()
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert health.main(["relay"], environment) == 0
    assert health.main(["relay"], environment) == 1


def test_a_relay_that_hangs_is_unwell_although_it_holds_its_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    environment = {"STATE_DIR": str(tmp_path)}
    (tmp_path / "edge").mkdir()
    lock = StateFolderLock(Config(state_dir=tmp_path))
    try:
        assert health.main(["relay"], environment) == 0
        later_s = time.monotonic() + STALLED_AFTER_S + 1.0
        monkeypatch.setattr(health, "time", SimpleNamespace(monotonic=lambda: later_s))
        assert health.main(["relay"], environment) == 1
        assert "relay: its loop has not run for 61 s" in capsys.readouterr().err
    finally:
        lock.close()


def test_the_health_check_and_the_edge_server_agree_on_when_a_relay_hangs() -> None:
    assert health.STALLED_AFTER_S == STALLED_AFTER_S


def test_a_relay_on_a_database_server_is_well_while_it_is_connected() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        environment = {"DATABASE_URL": f"postgresql+psycopg://farm@postgres:{port}/farm"}
        assert health.main(["relay"], environment) == 1  # Somebody listens, nobody is connected
        with socket.create_connection(("127.0.0.1", port)):
            assert health.main(["relay"], environment) == 0


def test_a_name_that_is_none_is_refused() -> None:
    assert health.main(["pilot"], {}) == 2
    assert health.main([], {}) == 2
