"""The memory of edge server and broker on one small board, after `MINUTES` (60) of missions.

The programs of a farm with one vehicle, in real time: it flies one mission after the other, at the
pace of a vehicle that is charged in between. Proportional set sizes: a page that a program's
processes share is counted once.
"""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.bench.process import resident_mb
from tests.bench.results import Result, at_most
from tests.bench.system import ten_commands
from tests.support.system import FarmSystem

BARS_MB: Final = {"edge": 120.0, "broker": 60.0}
SAMPLE_S: Final = 15.0
MISSION_S: Final = 60.0
"""A mission begins every minute."""


def measure(state_dir: Path) -> Iterator[Result]:
    """Give the memory at the end, with the least and the most of the whole time."""
    minutes = float(os.environ.get("MINUTES") or 60.0)
    samples: dict[str, list[float]] = {name: [] for name in BARS_MB}
    with FarmSystem(state_dir, speed=1.0) as system:
        system.environment["TRUTH"] = "0"
        system.start("cloud", "edge", "broker", "vehicle-1").wait_until_connected()
        end = time.monotonic() + 60.0 * minutes
        number, next_mission = 0, 0.0
        while time.monotonic() < end:
            if time.monotonic() >= next_mission:
                next_mission = time.monotonic() + MISSION_S
                number += 1
                system.fly(ten_commands(number))
            for name, values in samples.items():
                values.append(resident_mb(system.process_id(name)))
            time.sleep(SAMPLE_S)
    for name, values in samples.items():
        title = f"memory of {name} after {minutes:g} min and {number} missions"
        yield at_most(title, values[-1], "MB", BARS_MB[name], values)
