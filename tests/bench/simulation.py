"""How fast a whole vehicle flies when nothing paces it."""

import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from sim.config import SimulationConfig
from tests.bench.results import Result, at_least
from tests.support.autopilot_tester import AutopilotTester

SEEDS = range(1, 6)
FLIGHT_S = 30.0


def measure() -> Iterator[Result]:
    """Give simulated seconds per second of processor time, telemetry to a ground station on."""
    ratios = []
    for seed in SEEDS:
        with tempfile.TemporaryDirectory() as folder:
            tester = AutopilotTester(SimulationConfig(seed=seed), Path(folder))
            tester.wait_until_ready()
            tester.take_off(5.0)
            tester.run_for(5.0)
            started = time.process_time()
            tester.run_for(FLIGHT_S)
            ratios.append(FLIGHT_S / (time.process_time() - started))
    name = "whole vehicle in flight, unpaced, on one core"
    yield at_least(name, statistics.median(ratios), "x real time", 40.0, ratios)
