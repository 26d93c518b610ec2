"""How fast a whole vehicle flies when nothing paces it: in Python, compiled, and JSBSim alone.

Machines differ by a factor of two from day to day, so the figures that count are ratios of one
run. A process of its own flies each build, in turn with the other; `python -m
tests.bench.simulation SEED` is such a process. Without `make compile` there is no compiled column.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from sim.config import SimulationConfig
from sim.physics.quadrotor import Quadrotor
from tests.bench import step
from tests.bench.hovering import fly_on, hovering_vehicle
from tests.bench.results import Result, at_least, at_most, without_bar
from uav_firmware import compiled

SEEDS: Final = range(1, 6)
FLIGHT_S: Final = 30
BARS: Final = {False: 11.0, True: 5.0}
"""What a control step may cost, in steps of JSBSim alone: in Python, compiled."""
LEAST_GAIN: Final = 2.2
_NAMES: Final = {False: "pure Python", True: "compiled"}
_STEPS_PER_S: Final = 250
_CLIMB: Final = (0.6, 0.6, 0.6, 0.6)  # Straight up: nothing has to be controlled


class Flight(NamedTuple):
    """Processor time of one flight."""

    is_compiled: bool
    vehicle_s: float  # [s] Of the whole vehicle
    jsbsim_s: float  # [s] Of JSBSim alone, for the same simulated time


def measure() -> Iterator[Result]:
    """Give the speed of each build, its ratio to JSBSim alone, and the times of a step.

    Telemetry goes to two peers, the flight is logged.
    """
    builds = (False, True) if _is_compiled() else (False,)
    flights = [_flight(seed, is_compiled=build) for seed in SEEDS for build in builds]
    by_build = {build: [f for f in flights if f.is_compiled is build] for build in builds}
    alone_us = [f.jsbsim_s / (FLIGHT_S * _STEPS_PER_S) * 1e6 for f in flights]
    yield without_bar("JSBSim alone, a control step", statistics.median(alone_us), "us", alone_us)
    for build, flown in by_build.items():
        yield from _of_build(_NAMES[build], flown, BARS[build])
    if len(by_build) > 1:
        gains = [
            pure.vehicle_s / fast.vehicle_s
            for pure, fast in zip(by_build[False], by_build[True], strict=True)
        ]
        yield at_least(
            "compiled over pure Python", statistics.median(gains), "x", LEAST_GAIN, gains
        )
    yield from step.measure()


def _of_build(name: str, flights: Sequence[Flight], bar: float) -> Iterator[Result]:
    speeds = [FLIGHT_S / flight.vehicle_s for flight in flights]
    costs = [flight.vehicle_s / flight.jsbsim_s for flight in flights]
    yield at_least(
        f"whole vehicle in flight, unpaced, on one core, {name}",
        statistics.median(speeds),
        "x real time",
        40.0,
        speeds,
    )
    yield at_most(
        f"whole vehicle over JSBSim alone, {name}", statistics.median(costs), "x", bar, costs
    )


def _is_compiled() -> bool:
    manifest = compiled.read_manifest()
    return manifest is not None and compiled.obstacle(manifest) is None


def _flight(seed: int, *, is_compiled: bool) -> Flight:
    """Fly in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench.simulation", str(seed)],
        env={**os.environ, "FARM_PURE": "0" if is_compiled else "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return Flight(**json.loads(done.stdout))


def fly(seed: int) -> Flight:
    """Fly in this process."""
    with tempfile.TemporaryDirectory() as folder, hovering_vehicle(seed, Path(folder)) as tester:
        started = time.process_time()
        fly_on(tester, FLIGHT_S)
        vehicle_s = time.process_time() - started
    quadrotor = Quadrotor(SimulationConfig(seed=seed))
    quadrotor.command(_CLIMB)
    run = quadrotor._run
    started = time.process_time()
    for _ in range(FLIGHT_S * SimulationConfig().physics_rate_hz):
        run()
    return Flight(compiled.is_installed(), vehicle_s, time.process_time() - started)


if __name__ == "__main__":
    sys.stdout.write(json.dumps(fly(int(sys.argv[1]))._asdict()))
