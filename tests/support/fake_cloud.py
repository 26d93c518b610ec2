"""A cloud that can misbehave: real sockets, real threads.

By default it stores each record once per Idempotency-Key and answers 200 with JSON. A fault is a
function that takes the request over; faults are used up in order, one per request, and `always`
stands when none is left.
"""

import json
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, cast


@dataclass(frozen=True)
class Received:
    """One request as it arrived, stored or not."""

    path: str
    key: str
    headers: Mapping[str, str]
    body: dict[str, Any]
    at: float


@dataclass
class Store:
    """What the cloud has seen and what it has kept."""

    seen: list[Received] = field(default_factory=list)
    kept: list[Received] = field(default_factory=list)
    faults: deque["Fault"] = field(default_factory=deque)
    always: "Fault | None" = None
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _keys: set[str] = field(default_factory=set)

    def keep(self, received: Received) -> None:
        with self._changed:
            if received.key not in self._keys:
                self._keys.add(received.key)
                self.kept.append(received)
            self._changed.notify_all()

    def see(self, received: Received) -> "Fault | None":
        with self._changed:
            self.seen.append(received)
            self._changed.notify_all()
            return self.faults.popleft() if self.faults else self.always

    def wait_until(self, condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
        with self._changed:
            if not self._changed.wait_for(condition, timeout_s):
                raise AssertionError(f"cloud saw {len(self.seen)}, kept {len(self.kept)}")

    def wait_for_another_request(self) -> None:
        so_far = len(self.seen)
        self.wait_until(lambda: len(self.seen) > so_far)

    def wait_for_stream(self, vehicle_id: int, kind: str, count: int) -> None:
        self.wait_until(lambda: len(self.stream(vehicle_id, kind)) >= count)

    def wait_for(self, count: int, timeout_s: float = 20.0) -> None:
        self.wait_until(lambda: len(self.kept) >= count, timeout_s)

    def stream(self, vehicle_id: int, kind: str) -> list[int]:
        """Sequence numbers kept of one stream, in order of arrival."""
        return [
            received.body["sequence_number"]
            for received in self.kept
            if received.path == f"/{kind}" and received.body["vehicle_id"] == vehicle_id
        ]


class Handler(BaseHTTPRequestHandler):
    """Reads a record, then behaves or misbehaves."""

    protocol_version = "HTTP/1.1"
    wbufsize = -1  # One packet per answer
    disable_nagle_algorithm = True

    @property
    def store(self) -> Store:
        return cast("_Server", self.server).store

    def do_POST(self) -> None:  # the base class wants this name
        raw = self.rfile.read(int(self.headers["Content-Length"]))
        received = Received(
            self.path,
            self.headers["Idempotency-Key"],
            dict(self.headers),
            _body(raw, self.headers["Content-Type"]),
            time.monotonic(),
        )
        fault = self.store.see(received)
        if fault is not None:
            fault(self, received)
            return
        self.store.keep(received)
        self.answer(200)

    do_GET = do_POST  # noqa: N815  # the base class wants this name

    def answer(
        self,
        status: int,
        body: bytes = b"{}",
        content_type: str = "application/json",
        headers: Mapping[str, str] | None = None,
    ) -> None:
        self.send_response(status)
        self.send_header("Content-Type", content_type)
        self.send_header("Content-Length", str(len(body)))
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)
        self.wfile.flush()

    def reset(self) -> None:
        """Cut the connection so that the other side gets a reset."""
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close_connection = True
        self.connection.close()

    def log_message(self, *_: object) -> None:
        """Log nothing."""


def _body(raw: bytes, media_type: str) -> dict[str, Any]:
    """The record, or the lines of a batch, which this cloud never takes."""
    if media_type == "application/x-ndjson":
        return {"lines": raw.decode().splitlines()}
    body: dict[str, Any] = json.loads(raw)
    return body


Fault = Callable[[Handler, Received], None]


def status(code: int, headers: Mapping[str, str] | None = None) -> Fault:
    """Answer with a status and keep nothing."""
    return lambda handler, _: handler.answer(code, headers=headers)


def html(handler: Handler, _: Received) -> None:
    """Answer like a captive portal."""
    handler.answer(200, b"<html>please log in</html>", "text/html")


def garbage(handler: Handler, _: Received) -> None:
    """Claim to be JSON and be something else."""
    handler.answer(200, b"{not json", "application/json")


def empty(handler: Handler, received: Received) -> None:
    """Keep the record and answer 200 without a body."""
    handler.store.keep(received)
    handler.answer(200, b"", "text/plain")


def lose_answer(handler: Handler, received: Received) -> None:
    """Keep the record, then cut the connection before the answer."""
    handler.store.keep(received)
    handler.reset()


def lose_record(handler: Handler, _: Received) -> None:
    """Cut the connection and keep nothing."""
    handler.reset()


def hold(release: threading.Event) -> Fault:
    """Answer only when released."""

    def fault(handler: Handler, received: Received) -> None:
        release.wait(30.0)
        handler.store.keep(received)
        handler.answer(200)

    return fault


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 64

    def __init__(self, store: Store, port: int) -> None:
        self.store = store
        self._open: set[socket.socket] = set()
        super().__init__(("127.0.0.1", port), Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        self._open.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        self._open.discard(request)
        super().shutdown_request(request)

    def handle_error(self, *_: object) -> None:
        """A client that is killed is no news."""

    def cut_all(self) -> None:
        for connection in list(self._open):
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                continue


class FakeCloud:
    """A cloud that can be started and stopped on one port; what it keeps survives."""

    def __init__(self, port: int = 0) -> None:
        self.store = Store()
        self._port = port
        self._server: _Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._port}"

    def start(self) -> "FakeCloud":
        self._server = _Server(self.store, self._port)
        self._port = self._server.server_address[1]
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.02,), daemon=True
        )
        self._thread.start()
        return self

    def stop(self) -> None:
        if self._server is None or self._thread is None:
            return
        self._server.shutdown()
        self._server.cut_all()
        self._server.server_close()
        self._thread.join()
        self._server = self._thread = None


@contextmanager
def running_cloud(port: int = 0) -> Iterator[FakeCloud]:
    """Run a cloud for a while."""
    cloud = FakeCloud(port).start()
    try:
        yield cloud
    finally:
        cloud.stop()
