"""Many vehicles in real time: `python -m tests.bench.fleet [vehicles] [seconds]`.

Starts the whole system at SPEED=1, sends every vehicle on a mission, and counts over the time
given what processor time each program took and how many control steps missed their deadline: a
step is due when the wall clock reaches the simulated time at its end. Not part of `make bench`,
because it wants the machine for itself; on one that has other work, `nice -n -10` in front of it
comes close.
"""

import argparse
import re
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from sim.launch.demo import for_vehicles
from tests.bench.process import cpu_seconds
from tests.bench.results import Result, at_most, page
from tests.support.system import FarmSystem, example_plan

VEHICLES: Final = 20
SECONDS: Final = 60.0
SETTLING_S: Final = 15.0
"""Twenty programs that start at once miss deadlines; nobody flies by then."""

MISSIONS_PER_PLAN: Final = 10
MISSES_BAR_PERCENT: Final = 0.1
VEHICLE_BAR_PERCENT: Final = 6.0
STEPS_PER_SECOND: Final = 250.0
_LATE: Final = re.compile(r"vehicle \d+ +([0-9.]+) s  (\d+) of the last (\d+) steps late")


def late_steps(log: str, since_s: float) -> int:
    """Count the late steps that a vehicle reported after `since_s` of its time."""
    return sum(int(late) for moment, late, _ in _LATE.findall(log) if float(moment) >= since_s)


def measure(
    state_dir: Path, vehicles: int = VEHICLES, seconds: float = SECONDS
) -> Iterator[Result]:
    """Fly a fleet and give its missed deadlines and its processor time."""
    with FarmSystem(state_dir, vehicles=vehicles, speed=1.0) as system:
        system.environment["TRUTH"] = "0"
        system.start().wait_until_connected()
        names = [f"vehicle-{number}" for number in range(1, vehicles + 1)]
        time.sleep(SETTLING_S)
        lines_before = {name: len(system.log_of(name)) for name in names}
        before = _used(system, names)
        started = time.monotonic()
        _send_off(system, vehicles)
        time.sleep(seconds)
        passed = time.monotonic() - started
        shares = {
            name: (used - before[name]) / passed * 100.0
            for name, used in _used(system, names).items()
        }
        misses = [
            late_steps(system.log_of(name)[lines_before[name] :], 0.0)
            / (passed * STEPS_PER_SECOND)
            * 100.0
            for name in names
        ]
    yield at_most(
        f"missed deadlines of the worst of {vehicles} vehicles",
        max(misses),
        "%",
        MISSES_BAR_PERCENT,
        misses,
    )
    of_vehicles = [shares[name] for name in names]
    yield at_most(
        f"share of one core of one of {vehicles} flying vehicles",
        statistics.median(of_vehicles),
        "%",
        VEHICLE_BAR_PERCENT,
        of_vehicles,
    )
    for name in ("broker", "edge"):
        yield at_most(
            f"share of one core, {name} with {vehicles} vehicles",
            shares[name],
            "%",
            2.0 * vehicles,
            [shares[name]],
        )


def _send_off(system: FarmSystem, vehicles: int) -> None:
    """Give every vehicle a mission, in plans of no more missions than a plan may have."""
    missions = for_vehicles(example_plan(), max(vehicles, 2))["missions"][:vehicles]
    for first in range(0, vehicles, MISSIONS_PER_PLAN):
        some = {"name": "fleet", "missions": missions[first : first + MISSIONS_PER_PLAN]}
        system.post("/plans/", some).raise_for_status()


def _used(system: FarmSystem, names: list[str]) -> Mapping[str, float]:
    return {
        name: cpu_seconds(system.process_id(name)) for name in (*names, "broker", "edge", "cloud")
    }


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Fly a fleet with the whole system.")
    parser.add_argument(
        "vehicles", type=int, nargs="?", default=VEHICLES, help="how many: %(default)s"
    )
    parser.add_argument(
        "seconds", type=float, nargs="?", default=SECONDS, help="how many: %(default)s"
    )
    options = parser.parse_args()
    vehicles: int = options.vehicles
    seconds: float = options.seconds
    with tempfile.TemporaryDirectory() as folder:
        sys.stdout.write(page(list(measure(Path(folder), vehicles, seconds))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
