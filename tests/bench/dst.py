"""How fast the deterministic simulation is: seeds, a farm day, and seeds with the flight stack.

Hours are simulated hours per hour of one core. With kinematic vehicles, a farm day has nights in
which every vehicle is switched off; the seeds are shifts in which all of them are on.
"""

import logging
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from dst.simulate import Outcome, simulate
from dst.world.edge_process import prepared_folder
from tests.bench.results import Result, at_least, at_most, without_bar

SEEDS: Final = range(1, 21)
DAYS: Final = range(1, 4)
DEEP: Final = range(1, 4)
DAY_H: Final = 24.0
KINEMATIC_BAR: Final = 2000.0
DEEP_BAR: Final = 50.0
SEED_BAR_S: Final = 0.48
"""Processor time of a seed with which 250 of them take 60 s of two cores."""


def measure() -> Iterator[Result]:
    """Simulate, and give the simulated and the flown hours per hour and core."""
    logging.disable(logging.CRITICAL)
    try:
        with tempfile.TemporaryDirectory() as folder:
            yield from _measure(prepared_folder(Path(folder) / "prepared"))
    finally:
        logging.disable(logging.NOTSET)


def _measure(prepared: Path) -> Iterator[Result]:
    simulate(SEEDS[0], prepared)  # What is loaded and compiled once
    shifts = [simulate(seed, prepared) for seed in SEEDS]
    cpu_s = [one.cpu_s for one in shifts]
    name = "one seed of the simulated farm"
    yield at_most(name, statistics.mean(cpu_s), "s of a core", SEED_BAR_S, cpu_s)
    yield from _hours("with kinematic vehicles, seeds", shifts, KINEMATIC_BAR)
    days = [simulate(seed, prepared, hours=DAY_H) for seed in DAYS]
    yield from _hours("with kinematic vehicles, farm days", days, KINEMATIC_BAR)
    deep = [simulate(seed, prepared, is_deep=True) for seed in DEEP]
    yield from _hours("with the flight stack on JSBSim", deep, DEEP_BAR)


def _hours(what: str, outcomes: Sequence[Outcome], bar: float) -> Iterator[Result]:
    speeds = [one.simulated_s / one.cpu_s for one in outcomes]
    flown = [one.flight_s / one.cpu_s for one in outcomes]
    cpu_s = sum(one.cpu_s for one in outcomes)
    simulated = sum(one.simulated_s for one in outcomes) / cpu_s
    yield at_least(f"simulated hours {what}", simulated, "per hour and core", bar, speeds)
    in_flight = sum(one.flight_s for one in outcomes) / cpu_s
    yield without_bar(f"flown hours {what}", in_flight, "per hour and core", flown)
