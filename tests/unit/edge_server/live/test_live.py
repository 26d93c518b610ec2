"""`/live/` of a running edge server: what a browser receives over its socket."""

import json
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import requests

from tests.support.polling import PATIENCE_S, wait_until
from tests.unit.edge_server.documents import plan, telemetry
from tests.unit.edge_server.program import Program, program_in


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    folder: Path = tmp_path_factory.mktemp("live") / "state"
    with program_in(folder) as program:
        program.start()
        yield program


def send(server: Program, method: str, path: str, body: Any, role: str) -> requests.Response:
    headers = {"X-API-Key": server.key(role)}
    return requests.request(
        method, server.url + path, json=body, headers=headers, timeout=PATIENCE_S
    )


class Viewer:
    """Reads the stream from a socket."""

    def __init__(self, server: Program, last_id: str = "", key: str | None = None) -> None:
        self.sock = socket.create_connection(("127.0.0.1", server.port), PATIENCE_S)
        head = [
            "GET /live/ HTTP/1.1",
            "Host: edge",
            f"X-API-Key: {key or server.key('operator')}",
            *([f"Last-Event-ID: {last_id}"] if last_id else []),
        ]
        self.sock.sendall(("\r\n".join(head) + "\r\n\r\n").encode())
        self._received = b""
        self.head = self._until(b"\r\n\r\n").decode()
        self.last_id = ""

    def _until(self, end: bytes) -> bytes:
        while end not in self._received:
            data = self.sock.recv(65_536)
            if not data:
                raise EOFError
            self._received += data
        part, _, self._received = self._received.partition(end)
        return part

    def next(self, name: str) -> Any:
        """Wait for the next event of this name."""
        while True:
            lines = self._until(b"\n\n").decode().split("\n")
            fields = dict(line.split(": ", 1) for line in lines if line != ":")
            self.last_id = fields.get("id", self.last_id)
            if fields.get("event") == name:
                return json.loads(fields["data"])


def test_a_viewer_sees_a_vehicle_move_and_its_plan_arrive(server: Program) -> None:
    send(server, "PUT", "/vehicles/1", {"link_state": "connected", "altitude": 0.0}, "broker")
    with closing(Viewer(server).sock) as _, closing((viewer := Viewer(server)).sock):
        assert "HTTP/1.1 200 OK" in viewer.head
        assert "text/event-stream" in viewer.head
        assert "no-store" in viewer.head
        state = viewer.next("snapshot")
        assert [row["vehicle_id"] for row in state["vehicles"]] == [1]
        assert state["uplink"]["records_waiting"] == 0
        send(server, "PUT", "/vehicles/1", {"link_state": "connected", "altitude": 7.5}, "broker")
        assert viewer.next("vehicle")["altitude"] == 7.5
        assert send(server, "POST", "/plans/", plan(), "operator").status_code == 201
        mission = viewer.next("mission")
        assert (mission["vehicle_id"], mission["mission_status_id"]) == (1, 1)
        last_id = viewer.last_id
    send(server, "PUT", "/vehicles/1", {"link_state": "lost"}, "broker")
    with closing((again := Viewer(server, last_id)).sock):
        assert again.next("vehicle")["link_state"] == "lost"


def test_a_viewer_sees_an_alarm_and_who_acknowledges_it(server: Program) -> None:
    send(server, "PUT", "/vehicles/1", {"link_state": "connected"}, "broker")
    with closing((viewer := Viewer(server)).sock):
        known = [one["id"] for one in viewer.next("snapshot")["alarms"]]
        body = telemetry("alarm", 1)
        assert send(server, "POST", "/alarm/", body, "broker").status_code == 201
        alarm = viewer.next("alarm")
        assert alarm["id"] not in known
        assert (alarm["vehicle_id"], alarm["acknowledged_at"]) == (1, None)
        path = f"/alarms/history/{alarm['id']}/acknowledge"
        assert send(server, "POST", path, None, "operator").status_code == 200
        assert viewer.next("alarm")["acknowledged_by"]
    with closing((again := Viewer(server)).sock):
        assert alarm["id"] in [one["id"] for one in again.next("snapshot")["alarms"]]


def test_a_broker_is_asked_for_frequent_updates_while_somebody_watches(server: Program) -> None:
    state = {"link_state": "connected"}
    with closing((viewer := Viewer(server)).sock):
        viewer.next("snapshot")
        answer = send(server, "PUT", "/vehicles/1", state, "broker")
        assert 0.2 <= float(answer.headers["Update-Interval"]) <= 0.5


def test_without_a_key_there_is_no_stream(server: Program) -> None:
    with closing((viewer := Viewer(server, key="wrong")).sock):
        assert "401" in viewer.head.split("\r\n")[0]


def test_the_stream_of_a_revoked_key_ends(server: Program) -> None:
    body = {"name": "tablet", "role": "farmer"}
    made = send(server, "POST", "/keys/", body, "admin").json()
    with closing((viewer := Viewer(server, key=made["key"])).sock):
        viewer.next("snapshot")
        send(server, "DELETE", f"/keys/{made['prefix']}", None, "admin")
        with pytest.raises(EOFError):
            viewer.next("never")


def test_a_hundred_viewers_hold_no_thread_of_the_api(server: Program) -> None:
    viewers = [Viewer(server) for _ in range(100)]
    try:
        for viewer in viewers:
            viewer.next("snapshot")
        abort = {"sequence_number": 1, "vehicle_id": 99, "event_type_id": 1}
        assert send(server, "POST", "/events/", abort, "operator").status_code == 404
        send(server, "PUT", "/vehicles/2", {"link_state": "connected"}, "broker")
        for viewer in viewers:
            assert viewer.next("vehicle")["vehicle_id"] == 2
    finally:
        for viewer in viewers:
            viewer.sock.close()


def test_a_reader_that_does_not_read_is_dropped_and_costs_nothing_else(server: Program) -> None:
    slow = Viewer(server)
    with closing(slow.sock):
        slow.sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        with closing((viewer := Viewer(server)).sock):
            viewer.next("snapshot")
            for number in range(20):
                body = {"link_state": "connected", "warning": f"{number}"}
                send(server, "PUT", "/vehicles/3", body, "broker")
            wait_until(lambda: viewer.next("vehicle")["warning"] == "19")
