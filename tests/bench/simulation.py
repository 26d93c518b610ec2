"""How fast a whole vehicle flies when nothing paces it, and how long its steps take."""

import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.bench import step
from tests.bench.hovering import fly_on, hovering_vehicle
from tests.bench.results import Result, at_least

SEEDS = range(1, 6)
FLIGHT_S = 30


def measure() -> Iterator[Result]:
    """Give simulated seconds per second of processor time, and the times of a step.

    Telemetry goes to two peers, the flight is logged.
    """
    ratios = []
    for seed in SEEDS:
        with (
            tempfile.TemporaryDirectory() as folder,
            hovering_vehicle(seed, Path(folder)) as tester,
        ):
            started = time.process_time()
            fly_on(tester, FLIGHT_S)
            ratios.append(FLIGHT_S / (time.process_time() - started))
    name = "whole vehicle in flight, unpaced, on one core"
    yield at_least(name, statistics.median(ratios), "x real time", 40.0, ratios)
    yield from step.measure()
