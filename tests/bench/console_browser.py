"""What the console costs the browser that shows it: a part of `BENCH=console make bench`.

Fifty vehicles move twice a second for CONSOLE_MINUTES (10) in a real Chromium. It draws without a
graphics card: frames are slower than on a tablet that has one. The first load is measured with an
empty cache and a processor that is slowed down to a quarter, until the map zooms.
"""

import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any, Final, NamedTuple

from tests.bench.edge import Client, edge_server
from tests.bench.results import Result, at_most
from tests.support.browser import CONSOLE, browser_programs
from tests.unit.edge_server.program import Program

FLEET: Final = 50
SMALL_FARM: Final = 3
LOADS: Final = 9
UPDATE_S: Final = 0.5
MINUTES: Final = float(os.environ.get("CONSOLE_MINUTES", "10"))
SLACK_S: Final = 180.0
HOME: Final = (40.4434, -3.7382)
CIRCLE_DEG: Final = 5e-4


def measure(folder: Path) -> Iterator[Result]:
    """Give every figure; none, and a notice, where the browser or the console is missing."""
    programs = browser_programs()
    if isinstance(programs, str):
        sys.stderr.write(f"what the console costs its browser is not measured: {programs}\n")
        return
    browser = Browser(folder, *programs)
    loads = _watched(browser, SMALL_FARM, loads=LOADS)["loads"]
    megabytes = [one["first_load_bytes"] / 1e6 for one in loads]
    yield at_most("first load of the console", max(megabytes), "MB", 1.5, megabytes)
    seconds = [one["interactive_ms"] / 1e3 for one in loads]
    name = f"until the map zooms, {SMALL_FARM} vehicles, a quarter of the processor"
    yield at_most(name, median(seconds), "s", 2.0, seconds)
    seen = _watched(browser, FLEET, loads=1, minutes=MINUTES)
    growth = heap_growth(seen["heap"], MINUTES)
    megabytes = [used / 1e6 for _, used in seen["heap"]]
    yield at_most(f"heap, trend over {MINUTES:g} minutes", growth, "%", 10.0, megabytes)
    frame_ms = seen["frame_p95_ms"]
    yield at_most("time of a frame, without a graphics card, p95", frame_ms, "ms", 33.0, [frame_ms])


def heap_growth(samples: Sequence[tuple[float, float]], minutes: float) -> float:
    """Growth [%] within so many minutes, by the trend of samples of (minute, used bytes).

    The browser compiles and drops code meanwhile, so that two single samples differ by more than
    ten percent either way. The trend is the median of the slopes of all pairs (Theil and Sen).
    """
    slopes = [
        (later - earlier) / (until - since)
        for (since, earlier), (until, later) in combinations(samples, 2)
    ]
    slope = median(slopes)
    level = median(used - slope * minute for minute, used in samples)
    return 100.0 * slope * minutes / level


class Browser(NamedTuple):
    """What shows the console."""

    folder: Path
    node: str
    chromium: str


def _watched(
    browser: Browser, vehicles: int, *, loads: int, minutes: float = 0.0
) -> dict[str, Any]:
    """Load the console of a farm some times, and watch it for a while."""
    folder = browser.folder / str(vehicles)
    folder.mkdir()
    with edge_server(folder, "http://127.0.0.1:9", "serve") as program, _moving(program, vehicles):
        return _look(browser, program, vehicles, loads, minutes)


def _look(
    browser: Browser, program: Program, vehicles: int, loads: int, minutes: float
) -> dict[str, Any]:
    """Show the console to a browser, and take what it measures."""
    folder, node, chromium = browser
    out = folder / f"{vehicles}.json"
    admin = Client(program, "admin")
    admin.ask("POST", "/users/", {"name": "viewer", "role": "operator"})
    path = admin.ask("POST", "/users/viewer/link")["path"]
    admin.close()
    subprocess.run(
        [node, CONSOLE / "tests" / "browser" / "measure.mjs"],
        env={
            **os.environ,
            "CHROMIUM": chromium,
            "LINK": f"http://127.0.0.1:{program.port}{path}",
            "VEHICLES": str(vehicles),
            "LOADS": str(loads),
            "MINUTES": str(minutes),
            "OUT": str(out),
        },
        timeout=minutes * 60.0 + SLACK_S,
        check=True,
    )
    measured: dict[str, Any] = json.loads(out.read_text())
    return measured


@contextmanager
def _moving(program: Program, vehicles: int) -> Iterator[None]:
    """Let every vehicle fly a circle."""
    is_over = threading.Event()
    thread = threading.Thread(target=_move, args=(program, vehicles, is_over), daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def _move(program: Program, vehicles: int, is_over: threading.Event) -> None:
    client, began = Client(program), time.monotonic()
    turn = 0
    while not is_over.wait(max(0.0, began + turn * UPDATE_S - time.monotonic())):
        turn += 1
        for vehicle_id in range(1, vehicles + 1):
            angle = 0.02 * turn + math.tau * vehicle_id / vehicles
            state = {
                "link_state": "connected",
                "armed": True,
                "activity": "mission",
                "latitude": HOME[0] + CIRCLE_DEG * math.cos(angle),
                "longitude": HOME[1] + CIRCLE_DEG * math.sin(angle),
                "altitude": 10.0,
                "heading": math.degrees(angle + math.pi / 2.0) % 360.0,
                "speed": 5.0,
                "battery_percentage": 0.8,
            }
            client.ask("PUT", f"/vehicles/{vehicle_id}", state)
    client.close()
