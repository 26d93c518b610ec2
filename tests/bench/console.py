"""What the console costs and how fast its STOP acts: `BENCH=console make bench`.

The time from the release of STOP's button in a browser to the vehicle's acknowledgement of the
command that ends its mission, on a link that is listened to; and what a hundred viewers of the live
stream cost the edge server while ten vehicles are updated and reports come in, against the same
without them.
The browser's side is in `tests.bench.console_browser`.
"""

import multiprocessing
import os
import selectors
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Final, NamedTuple

from tests.bench import console_browser
from tests.bench.edge import Client, edge_server
from tests.bench.process import cpu_seconds
from tests.bench.results import Result, at_most, percentile
from tests.bench.system import ten_commands
from tests.bench.wiretap import Wiretap
from tests.support.browser import CONSOLE, browser_programs, sign_in_link
from tests.support.polling import PATIENCE_S
from tests.support.system import FarmSystem, free_ports, wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program

STOPS: Final = 12
COMMAND_ACK: Final = 77
"""Its payload begins with the command (uint16); the result (uint8) is cut off where it is 0."""
ENDING: Final = frozenset({20, 21, 176, 192})
"""NAV_RETURN_TO_LAUNCH, NAV_LAND, DO_SET_MODE, DO_REPOSITION."""
LANDED_WITHIN_S: Final = 60.0

VIEWERS: Final = 100
VEHICLES: Final = 10
UPDATE_S: Final = 0.4
ROUNDS: Final = 4
SECONDS: Final = 15.0
POST_S: Final = 0.05


def measure() -> Iterator[Result]:
    """Give every figure, each from a state folder of its own."""
    for part in (_stops, _viewers, console_browser.measure):
        with tempfile.TemporaryDirectory() as folder:
            yield from part(Path(folder))


def _stops(folder: Path) -> Iterator[Result]:
    (tap_port,) = free_ports(1)
    with FarmSystem(folder, speed=1.0) as system:
        system.environment["TRUTH"] = "0"
        with Wiretap(tap_port, system.settings.mavlink_port) as tap:
            system.start("cloud", "edge", "broker")
            system.environment["MAVLINK_PORT"] = str(tap_port)
            system.start("vehicle-1").wait_until_connected()
            system.fly(ten_commands(STOPS + 1))  # The first one waits for the estimator.
            with _stopping(system) as (name, stop):
                times_ms = [_stop_ms(system, tap, number, stop) for number in range(1, STOPS + 1)]
    yield at_most(f"{name}, p50", percentile(times_ms, 50), "ms", 300, times_ms)
    yield at_most(f"{name}, longest", max(times_ms), "ms", 1000, times_ms)


@contextmanager
def _stopping(system: FarmSystem) -> Iterator[tuple[str, Callable[[int], float]]]:
    """Give what orders a landing, with the time of the order as a result, and what is measured."""
    programs = browser_programs()
    if isinstance(programs, str):
        sys.stderr.write(f"STOP is measured without its button: {programs}\n")
        yield "POST of a stop to the vehicle's acknowledgement", partial(_stop_by_post, system)
        return
    node, chromium = programs
    link = sign_in_link(system, "operator", "stopper")
    with subprocess.Popen(
        [node, CONSOLE / "tests" / "browser" / "measure_stops.mjs"],
        env={**os.environ, "CHROMIUM": chromium, "LINK": link},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as browser:
        if browser.stdin is None or browser.stdout is None:
            raise RuntimeError("the browser has no pipes")
        lines = browser.stdout
        if lines.readline() != "ready\n":
            raise RuntimeError("the console could not be opened")

        def stop(number: int) -> float:
            print(number, file=browser.stdin, flush=True)
            return float(lines.readline()) / 1e3

        yield "release of STOP's button to the vehicle's acknowledgement", stop
        browser.stdin.close()


def _stop_by_post(system: FarmSystem, number: int) -> float:
    event = {"sequence_number": number, "vehicle_id": 1, "event_type_id": 1}
    began = time.time()
    system.post("/events/", event).raise_for_status()
    return began


def _stop_ms(system: FarmSystem, tap: Wiretap, number: int, stop: Callable[[int], float]) -> float:
    """Fly, and stop on the way."""
    answer = system.post("/plans/", ten_commands(number))
    answer.raise_for_status()
    wait_for(lambda: system.get("/vehicles/1").get("altitude", 0.0) > 1.5, "the take-off")
    noted = len(tap.passed)
    began = stop(number)
    acknowledged: float = wait_for(
        lambda: _acknowledged(tap, noted), "the vehicle's acknowledgement"
    )
    wait_for(lambda: system.get("/vehicles/1")["armed"] is False, "the landing", LANDED_WITHIN_S)
    return (acknowledged - began) * 1e3


def _acknowledged(tap: Wiretap, noted: int) -> float | None:
    for moment, number, payload in tap.passed[noted:]:
        if number != COMMAND_ACK:
            continue
        (command,) = struct.unpack_from("<H", payload.ljust(2, b"\0"))
        if command in ENDING and not any(payload[2:3]):
            return moment
    return None


def _viewers(folder: Path) -> Iterator[Result]:
    with edge_server(folder, "http://127.0.0.1:9", "serve") as program:
        alone, amid = [], []
        for _ in range(ROUNDS):  # In turn, so that a slow minute of the machine hits both
            alone.append(_load(program))
            with _watching(program):
                amid.append(_load(program))
    name = f"{VIEWERS} viewers of {VEHICLES} vehicles at {1 / UPDATE_S:g} Hz"
    costs = [(b.share - a.share) * 100.0 for a, b in zip(alone, amid, strict=True)]
    yield at_most(f"{name}: edge server, of a core", statistics.median(costs), "%", 15, costs)
    ratios = [_p99(b) / _p99(a) for a, b in zip(alone, amid, strict=True)]
    ratio = _p99(*amid) / _p99(*alone)
    yield at_most(f"{name}: POST p99 / without viewers", ratio, "", 1.3, ratios)


class Load(NamedTuple):
    """What the edge server did for a while."""

    posts_ms: list[float]
    share: float
    """Of a core."""


def _p99(*loads: Load) -> float:
    return percentile([post for load in loads for post in load.posts_ms], 99)


def _load(program: Program) -> Load:
    """Update vehicles and post reports for a while."""
    client = Client(program)
    if program.process is None:
        raise RuntimeError("the edge server does not run")
    process = program.process.pid
    began, used = time.monotonic(), cpu_seconds(process)
    updated_at, number, found = began - UPDATE_S, 0, []
    while (now := time.monotonic()) < began + SECONDS:
        if now >= updated_at + UPDATE_S:
            updated_at = now
            for vehicle_id in range(1, VEHICLES + 1):
                state = {"link_state": "connected", "armed": True, "altitude": number % 50 * 1.0}
                client.ask("PUT", f"/vehicles/{vehicle_id}", state)
        number += 1
        posted = time.monotonic()
        client.ask("POST", "/pose/", documents.telemetry("pose", number))
        found.append((time.monotonic() - posted) * 1e3)
        time.sleep(POST_S)
    client.close()
    return Load(found, (cpu_seconds(process) - used) / (time.monotonic() - began))


@contextmanager
def _watching(program: Program) -> Iterator[None]:
    """Read the live stream by many connections, in a process of their own."""
    context = multiprocessing.get_context("spawn")
    is_ready = context.Event()
    arguments = (program.port, program.key("operator"), is_ready)
    viewers = context.Process(target=_view, args=arguments, daemon=True)
    viewers.start()
    try:
        if not is_ready.wait(PATIENCE_S):
            raise RuntimeError("not every viewer has received the stream")
        yield
        if not viewers.is_alive():
            raise RuntimeError("a viewer was dropped")
    finally:
        viewers.kill()
        viewers.join()


def _view(port: int, key: str, is_ready: Event) -> None:
    """Read as browsers do, until a stream ends."""
    request = f"GET /live/ HTTP/1.1\r\nHost: edge\r\nX-API-Key: {key}\r\n\r\n".encode()
    waiting = set()
    with selectors.DefaultSelector() as selector:
        for _ in range(VIEWERS):
            sock = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
            sock.sendall(request)
            selector.register(sock, selectors.EVENT_READ)
            waiting.add(sock)
        while True:
            for selected, _ in selector.select():
                reader = selected.fileobj
                if not isinstance(reader, socket.socket) or not reader.recv(65_536):
                    return
                waiting.discard(reader)
            if not waiting:
                is_ready.set()
