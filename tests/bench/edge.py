"""How much the edge server takes in, keeps and sends on: `BENCH=edge make bench`.

Programs as in the field: server and relay under their supervisor, the mock cloud beside them, the
senders in this process. The senders and the cloud share the two cores with what is measured.
"""

import http.client
import json
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import requests
from ulid import ULID

from edge_server.config import Config
from edge_server.process.preparation import prepare
from tests.bench.process import cpu_seconds, resident_mb
from tests.bench.results import Result, at_least, at_most, percentile
from tests.support.polling import PATIENCE_S
from tests.support.system import free_ports, wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program

BULK: Final = 250
BULK_RECORDS: Final = 20_000
BULK_SENDERS: Final = 2
VEHICLES: Final = 10
SINGLE_SECONDS: Final = 8.0
SINGLE_CLIENTS: Final = 4
BACKLOG: Final = 10_000
FARM_RECORDS_PER_S: Final = 50.0
"""What ten vehicles send: pose, state vector, battery and now and then the rest, each at 1 Hz."""
URGENT: Final = 100
REQUESTS: Final = 30
"""For a state vector; the server lets 32 wait."""
URGENT_BACKLOG: Final = 40_000
"""So that 10,000 and more drain while the urgent ones are sent."""
QUEUED: Final = 1_000_000
_KINDS: Final = ("pose", "battery", "state_vector")
_ROWS_AT_ONCE: Final = 50_000


def measure() -> Iterator[Result]:
    """Give every figure, each from a state folder of its own."""
    for part in (_bulk, _single, _backlog, _million):
        with tempfile.TemporaryDirectory() as folder:
            yield from part(Path(folder))


class Cloud:
    """The mock cloud as a process, and what it says that it holds."""

    def __init__(self, folder: Path) -> None:
        (self._port,) = free_ports(1)
        self.url = f"http://127.0.0.1:{self._port}"
        command = [sys.executable, "-m", "sim.cloud", "--port", str(self._port)]
        self.process = subprocess.Popen(
            [*command, "--state-dir", str(folder)],
            env=os.environ | {"CLOUD_BATCH": "100"},
            stderr=subprocess.DEVNULL,
        )
        wait_for(lambda: self.count() == 0, "the mock cloud")

    def count(self) -> int | None:
        """How many records it holds; None while it does not answer."""
        try:
            counts = requests.get(self.url, timeout=PATIENCE_S).json()["counts"]
        except requests.RequestException:
            return None
        return int(sum(counts.values()))

    def records(self, kind: str) -> list[dict[str, Any]]:
        """What it holds of a kind."""
        found: list[dict[str, Any]] = requests.get(f"{self.url}/{kind}", timeout=PATIENCE_S).json()
        return found

    def stop(self) -> None:
        """End it."""
        self.process.terminate()
        self.process.wait(PATIENCE_S)


@contextmanager
def edge_server(folder: Path, cloud_url: str, *arguments: str) -> Iterator[Program]:
    program = Program(folder / "state", cloud_url)
    program.environment["LOG_LEVEL"] = "INFO"
    program.start(*arguments)
    try:
        yield program
    finally:
        if program.process is not None:
            program.end(signal.SIGTERM)


@contextmanager
def mock_cloud(folder: Path) -> Iterator[Cloud]:
    cloud = Cloud(folder / "cloud")
    try:
        yield cloud
    finally:
        cloud.stop()


class Client:
    """One sender on one kept-alive connection."""

    def __init__(self, program: Program, role: str = "broker") -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", program.port, timeout=PATIENCE_S)
        self._headers = {
            "Content-Type": "application/json",
            "Authorization": f"Bearer {program.key(role)}",
        }

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        """Ask and read the answer; one that is no success is an error."""
        content = None if body is None else json.dumps(body).encode()
        self._connection.request(method, path, content, self._headers)
        answer = self._connection.getresponse()
        raw = answer.read()
        if answer.status >= 300:
            raise RuntimeError(f"{method} {path}: {answer.status} {raw[:200]!r}")
        return json.loads(raw) if raw else None

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def _together(works: Sequence[Callable[[], None]]) -> float:
    """Do all of it at the same time; returns how long it took [s]."""
    threads = [threading.Thread(target=work) for work in works]
    began = time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return time.monotonic() - began


def _reports(first: int, count: int) -> list[dict[str, Any]]:
    """Reports as a broker bundles them: all vehicles, three kinds."""
    numbers = range(first, first + count)
    kinds = [_KINDS[number % len(_KINDS)] for number in numbers]
    return [
        {kind: documents.telemetry(kind, number, number % VEHICLES + 1)}
        for kind, number in zip(kinds, numbers, strict=True)
    ]


def _bulk(folder: Path) -> Iterator[Result]:
    with mock_cloud(folder) as cloud, edge_server(folder, cloud.url) as program:
        assert program.process is not None

        def send(sender: int) -> None:
            client = Client(program)
            share = BULK_RECORDS // BULK_SENDERS
            for first in range(sender * share, (sender + 1) * share, BULK):
                client.ask("POST", "/telemetry/", {"records": _reports(first, BULK)})
            client.close()

        used = cpu_seconds(program.process.pid)
        began = time.monotonic()
        ingest_s = _together([lambda s=s: send(s) for s in range(BULK_SENDERS)])  # type: ignore[misc]  # a loop's variable, bound
        wait_for(lambda: cloud.count() == BULK_RECORDS, "all records at the cloud")
        whole_s = time.monotonic() - began
        used = cpu_seconds(program.process.pid) - used
        rate = BULK_RECORDS / whole_s
        yield at_least("bulk: taken in, on disk and at the cloud", rate, "records/s", 1000, [rate])
        rate = BULK_RECORDS / ingest_s
        yield at_least("bulk: taken in, while the relay sends", rate, "records/s", 1000, [rate])
        each = used / BULK_RECORDS * 1e6
        yield at_most("bulk: processor time of server and relay", each, "us/record", 1000, [each])


def _single(folder: Path) -> Iterator[Result]:
    with edge_server(folder, "http://127.0.0.1:9") as program:
        assert program.process is not None
        counts: list[int] = []
        latencies: list[float] = []
        until = time.monotonic() + SINGLE_SECONDS

        def send(vehicle_id: int) -> None:
            client, number = Client(program), 0
            while (began := time.monotonic()) < until:
                client.ask("POST", "/pose/", documents.telemetry("pose", number, vehicle_id))
                latencies.append(time.monotonic() - began)
                number += 1
            counts.append(number)
            client.close()

        used = cpu_seconds(program.process.pid)
        took_s = _together([lambda v=v: send(v) for v in range(1, SINGLE_CLIENTS + 1)])  # type: ignore[misc]  # as above
        used = cpu_seconds(program.process.pid) - used
        rate = sum(counts) / took_s
        yield at_least(f"single POSTs, {SINGLE_CLIENTS} clients", rate, "records/s", 300, counts)
        millis = [latency * 1e3 for latency in latencies]
        yield at_most("single POST, p99", percentile(millis, 99), "ms", 500, millis)
        each = used / sum(counts) * 1e6
        yield at_most("single POST: processor time", each, "us/record", 3300, [each])


def _backlog(folder: Path) -> Iterator[Result]:
    """Drain a backlog; meanwhile alarms go out and events come in."""
    fill(folder / "state", BACKLOG)
    with mock_cloud(folder) as cloud, edge_server(folder, cloud.url, "serve") as program:
        began = time.monotonic()
        relay = program.spawn("relay", stderr=subprocess.DEVNULL)
        try:
            wait_for(lambda: cloud.count() == BACKLOG, "an empty outbox")
        finally:
            relay.terminate()
            relay.wait(PATIENCE_S)
        rate = BACKLOG / (time.monotonic() - began)
        bar = 10 * FARM_RECORDS_PER_S
        yield at_least("drain of 10,000 records", rate, "records/s", bar, [rate])
        yield at_least(
            "drain rate / what ten vehicles send", rate / FARM_RECORDS_PER_S, "", 10, [1]
        )
    urgent = folder / "urgent"
    fill(urgent / "state", URGENT_BACKLOG)
    with mock_cloud(urgent) as cloud, edge_server(urgent, cloud.url) as program:
        yield from _urgent(program, cloud)


def _urgent(program: Program, cloud: Cloud) -> Iterator[Result]:
    posted: dict[int, float] = {}
    events_s: list[float] = []
    broker, operator = Client(program), Client(program, "operator")
    broker.ask("PUT", "/vehicles/1", {"link_state": "connected"})
    cursor = broker.ask("GET", "/broker/commands?after=0")["cursor"]
    draining = 0
    for number in range(URGENT):
        posted[number] = time.time()
        broker.ask("POST", "/alarm/", documents.telemetry("alarm", number))
        if number < REQUESTS:
            began = time.monotonic()
            operator.ask("POST", "/latest_state_vector/", {"sequence_number": 0, "vehicle_id": 1})
            cursor = broker.ask("GET", f"/broker/commands?after={cursor}&wait=10")["cursor"]
            events_s.append(time.monotonic() - began)
        draining += (cloud.count() or 0) < URGENT_BACKLOG
    wait_for(lambda: len(cloud.records("alarm")) == URGENT, "all alarms at the cloud")
    delays_ms = [
        (record["received_at"] - posted[record["body"]["sequence_number"]]) * 1e3
        for record in cloud.records("alarm")
    ]
    name = f"alarm to the cloud while 10,000 records drain ({draining} of {URGENT} did), p99"
    yield at_most(name, percentile(delays_ms, 99), "ms", 500, delays_ms)
    events_ms = [delay * 1e3 for delay in events_s]
    name = "request to the waiting broker while they drain, p99"
    yield at_most(name, percentile(events_ms, 99), "ms", 500, events_ms)
    broker.close()
    operator.close()


def _million(folder: Path) -> Iterator[Result]:
    fill(folder / "state", QUEUED)
    began = time.monotonic()
    with edge_server(folder, "http://127.0.0.1:9") as program:
        assert program.process is not None
        took_s = time.monotonic() - began
        yield at_most("start to the first answer, 1,000,000 queued", took_s, "s", 5, [took_s])
        client = Client(program, "operator")
        for _ in range(3):
            for kind in _KINDS:
                client.ask("GET", f"/{kind}/?limit=100")
        for number in range(100):
            Client(program).ask("POST", "/pose/", documents.telemetry("pose", number))
        samples = [resident_mb(program.process.pid)]
        for _ in range(10):
            time.sleep(1.0)
            samples.append(resident_mb(program.process.pid))
        yield at_most(
            "resident memory of all its processes, 1,000,000 queued",
            max(samples),
            "MB",
            150,
            samples,
        )


def fill(state_dir: Path, records: int) -> None:
    """Make a state folder with so many records due, written past the API."""
    config = Config(state_dir=state_dir)
    prepare(config)
    connection = sqlite3.connect(config.database_path)
    beginning = str(ULID())[:10]
    now = time.time()
    with connection:
        for first in range(0, records, _ROWS_AT_ONCE):
            numbers = range(first, min(first + _ROWS_AT_ONCE, records))
            _insert(connection, [_row(number, beginning, now) for number in numbers])
    connection.close()


def _row(number: int, beginning: str, now: float) -> tuple[int, str, str, int, str, float]:
    kind, vehicle_id = _KINDS[number % len(_KINDS)], number % VEHICLES + 1
    message_id = f"{beginning}{number:016d}"
    body = documents.telemetry(kind, number, vehicle_id) | {"message_id": message_id}
    return number + 1, message_id, kind, vehicle_id, json.dumps(body), now


def _insert(
    connection: sqlite3.Connection, rows: Sequence[tuple[int, str, str, int, str, float]]
) -> None:
    connection.executemany(
        "INSERT INTO telemetry (id, message_id, kind, vehicle_id, payload, received_at, size_bytes)"
        " VALUES (?1, ?2, ?3, ?4, ?5, ?6, length(?5))",
        rows,
    )
    connection.executemany(
        "INSERT INTO outbox (record_id, vehicle_id, kind) VALUES (?, ?, ?)",
        [(row[0], row[3], row[2]) for row in rows],
    )
