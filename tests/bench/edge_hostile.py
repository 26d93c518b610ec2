"""The edge server among bad clients and behind a bad network: `BENCH=hostile make bench`.

Two figures that hold on any machine, since each is also given as a ratio to the same thing done in
peace: how long an abort takes while a thousand sockets send nothing or too little, and how fast a
backlog drains while the network cuts a part of the cloud's answers.
"""

import contextlib
import http.client
import itertools
import json
import random
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Self

from tests.bench.edge import Client, Cloud, edge_server, fill, mock_cloud
from tests.bench.results import Result, at_least, at_most, percentile
from tests.support.polling import PATIENCE_S
from tests.support.system import wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program

SLOW_SOCKETS: Final = 1000
ADDRESSES: Final = 5
"""Of the loopback, with fewer sockets each than one address may have."""
ABORTS: Final = 40
BACKLOG: Final = 3000
CUT_SHARE: Final = 0.05
"""Of the pieces of the cloud's answers; most answers are one piece."""
_BEGINNINGS: Final = (b"", b"P", b"POST /events/ HTTP/1.1\r\n", b"GET / HTTP/1.1\r\nX: y")


def measure() -> Iterator[Result]:
    """Give every figure, each from a state folder of its own."""
    for part in (_aborts, _cut_answers):
        with tempfile.TemporaryDirectory() as folder:
            yield from part(Path(folder))


def _aborts(folder: Path) -> Iterator[Result]:
    with edge_server(folder, "http://127.0.0.1:9", "serve") as program:
        broker = Client(program)
        broker.ask("PUT", "/vehicles/1", {"link_state": "connected", "armed": True})
        alone_ms = _abort_times_ms(program)
        with contextlib.ExitStack() as stack:
            slow = SlowSockets(program.port)
            stack.callback(slow.close)
            amid_ms = _abort_times_ms(program)
            held = slow.open
        broker.close()
    name = f"abort under {held} slow sockets"
    yield at_most(f"{name}, p99", percentile(amid_ms, 99), "ms", 1000, amid_ms)
    ratio = percentile(amid_ms, 50) / percentile(alone_ms, 50)
    yield at_most(f"{name} / alone, medians", ratio, "", 5, [ratio])


def _abort_times_ms(program: Program) -> list[float]:
    """Abort again and again, on a new connection each time, and let the broker take it."""
    found = []
    broker = Client(program)
    body = json.dumps(documents.event())
    headers = {"Content-Type": "application/json", "X-API-Key": program.key("operator")}
    for _ in range(ABORTS):
        began = time.monotonic()
        connection = http.client.HTTPConnection("127.0.0.1", program.port, timeout=PATIENCE_S)
        connection.request("POST", "/events/", body, headers)
        answer = connection.getresponse()
        raw = answer.read()
        found.append((time.monotonic() - began) * 1e3)
        connection.close()
        if answer.status != 201:
            raise RuntimeError(f"the abort was answered with {answer.status}: {raw!r}")
        (work,) = broker.ask("GET", "/broker/commands?after=0")["commands"]
        for status in ("accepted", "done"):
            broker.ask("POST", f"/broker/commands/{work['id']}/ack", {"status": status})
    broker.close()
    return found


class SlowSockets:
    """Connections that send a byte now and then, or nothing, and come back when they are closed."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._ended = threading.Event()
        self._sockets: list[socket.socket] = [self._connect(n) for n in range(SLOW_SOCKETS)]
        self._thread = threading.Thread(target=self._drip, daemon=True)
        self._thread.start()

    @property
    def open(self) -> int:
        """How many there are."""
        return len(self._sockets)

    def close(self) -> None:
        """Close all."""
        self._ended.set()
        self._thread.join()
        for sock in self._sockets:
            sock.close()

    def _connect(self, number: int) -> socket.socket:
        address = f"127.0.0.{1 + number % ADDRESSES}"
        sock = socket.create_connection(("127.0.0.1", self._port), PATIENCE_S, (address, 0))
        with contextlib.suppress(OSError):
            sock.sendall(_BEGINNINGS[number % len(_BEGINNINGS)])
        return sock

    def _drip(self) -> None:
        for number in itertools.cycle(range(SLOW_SOCKETS)):
            if self._ended.wait(0.002):
                return
            try:
                self._sockets[number].sendall(b"x")
            except OSError:
                self._sockets[number].close()
                with contextlib.suppress(OSError):
                    self._sockets[number] = self._connect(number)


def _cut_answers(folder: Path) -> Iterator[Result]:
    rates = {share: _drain_rate(folder / str(share), share) for share in (0.0, CUT_SHARE)}
    name = f"drain of {BACKLOG} records, {CUT_SHARE:.0%} of the cloud's answers cut"
    yield at_least(name, rates[CUT_SHARE], "records/s", 50, [rates[CUT_SHARE]])
    ratio = rates[CUT_SHARE] / rates[0.0]
    yield at_least(f"{name} / none cut", ratio, "", 0.02, [ratio])


def _drain_rate(folder: Path, share: float) -> float:
    """Drain a backlog through a network that cuts answers; every record arrives once."""
    fill(folder / "state", BACKLOG)
    with (
        mock_cloud(folder) as cloud,
        CuttingNetwork(cloud, share) as network,
        edge_server(folder, network.url, "serve") as program,
    ):
        began = time.monotonic()
        relay = program.spawn("relay", stderr=subprocess.DEVNULL)
        try:
            wait_for(lambda: cloud.count() == BACKLOG, "an empty outbox")
            rate = BACKLOG / (time.monotonic() - began)
        finally:
            ended = relay.poll()
            relay.terminate()
            relay.wait(PATIENCE_S)
    if ended is not None:
        raise RuntimeError(f"the relay ended with code {ended}")
    return rate


class CuttingNetwork:
    """Forwards connections to the cloud, and ends some of them within what the cloud says."""

    def __init__(self, cloud: Cloud, share: float) -> None:
        self._cloud_port = int(cloud.url.rsplit(":", 1)[1])
        self._share = share
        self._draw = random.Random(5)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"

    def __enter__(self) -> Self:
        threading.Thread(target=self._serve, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                cloud = socket.create_connection(("127.0.0.1", self._cloud_port))
                for work in (self._forward, self._answer):
                    threading.Thread(target=work, args=(client, cloud), daemon=True).start()

    def _forward(self, client: socket.socket, cloud: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := client.recv(65_536):
                cloud.sendall(data)
            cloud.shutdown(socket.SHUT_WR)

    def _answer(self, client: socket.socket, cloud: socket.socket) -> None:
        with contextlib.suppress(OSError), client, cloud:
            while data := cloud.recv(65_536):
                if self._draw.random() < self._share:
                    client.sendall(data[: self._draw.randrange(len(data))])
                    client.shutdown(socket.SHUT_RDWR)
                    cloud.shutdown(socket.SHUT_RDWR)
                    return
                client.sendall(data)
