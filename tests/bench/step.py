"""Where a control step's time goes: `python -m tests.bench.step [runs [alone]]`.

The same flight is flown several times. It is deterministic, so that the n-th step does the same
work in each of them: the least time of the runs is what the work takes, without what else the
machine was busy with. The clock is read between the rate groups, at some 0.1 us a reading.
`alone` is a vehicle without a broker that turns off what it does not read: PX4's onboard rates
then go to the broker's address.
"""

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.bench.hovering import hovering_vehicle
from tests.bench.results import Result, at_most, percentile
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.scheduler import RateGroup, Scheduler

STEPS: Final = 5000  # 20 s of flight: each rate's pattern many times over
WARM_UP_STEPS: Final = 250
RUNS: Final = 5
STEP_BAR_US: Final = {50: 100.0, 99: 400.0}
"""Forty times real time leaves 100 us on average; a tenth of its period is what a step may take."""


@dataclass(frozen=True, slots=True)
class StepTimes:
    """Least time [us] of every step, in all and per rate group."""

    steps_us: Sequence[float]
    groups_us: Mapping[str, Sequence[float]]  # 0 in a step in which the group did not run

    def mean_us(self, group: str) -> float:
        """Time of a group per step, those in which it does not run included."""
        return statistics.fmean(self.groups_us[group])


class Stopwatch:
    """Lets a vehicle run as ever and notes how long each rate group takes in each step."""

    def __init__(self, tester: AutopilotTester) -> None:
        autopilot = tester.autopilot
        groups = autopilot.scheduler.groups
        self.times_ns: dict[str, list[int]] = {group.name: [] for group in groups}
        timed = [
            group._replace(run=self._timed(group, self.times_ns[group.name])) for group in groups
        ]
        former = autopilot.scheduler
        autopilot.scheduler = Scheduler(former.step_us, timed, former.on_error)
        self._tester = tester

    def run(self, steps: int) -> None:
        """Fly; every group notes a time for every step."""
        for number in range(1, steps + 1):
            self._tester.run_for(self._tester.autopilot.vehicle.step_us * 1e-6)
            for times_ns in self.times_ns.values():
                times_ns.extend([0] * (number - len(times_ns)))

    def _timed(self, group: RateGroup, times_ns: list[int]) -> Callable[[], None]:
        run, clock = group.run, time.perf_counter_ns

        def timed() -> None:
            started_ns = clock()
            run()
            times_ns.append(clock() - started_ns)

        return timed


def fly(runs: int = RUNS, steps: int = STEPS, *, broker: bool = True) -> StepTimes:
    """Fly `runs` times and give the least times."""
    flights = []
    for _ in range(runs):
        with (
            tempfile.TemporaryDirectory() as folder,
            hovering_vehicle(1, Path(folder), broker=broker) as tester,
        ):
            tester.run_for(WARM_UP_STEPS * tester.autopilot.vehicle.step_us * 1e-6)
            stopwatch = Stopwatch(tester)
            stopwatch.run(steps)
            flights.append(stopwatch.times_ns)
    least = {
        name: [min(times) * 1e-3 for times in zip(*(f[name] for f in flights), strict=True)]
        for name in flights[0]
    }
    return StepTimes([sum(times) for times in zip(*least.values(), strict=True)], least)


def measure() -> Iterator[Result]:
    """Give median and 99th percentile of a step."""
    times = fly().steps_us
    for percent, bar in STEP_BAR_US.items():
        yield at_most(f"control step, p{percent}", percentile(times, percent), "us", bar, times)


def table(times: StepTimes) -> str:
    """Give a table of the rate groups, dearest first."""
    mean_us = statistics.fmean(times.steps_us)
    lines = ["| rate group | us per step | share |", "|---|---|---|"]
    for name in sorted(times.groups_us, key=times.mean_us, reverse=True):
        own_us = times.mean_us(name)
        lines.append(f"| {name} | {own_us:.1f} | {own_us / mean_us:.0%} |")
    lines.append(f"| all | {mean_us:.1f} | 100% |")
    return "\n".join(lines)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Measure where a step's time goes.")
    parser.add_argument("runs", type=int, nargs="?", default=RUNS, help="flights: %(default)s")
    parser.add_argument("alone", choices=("alone",), nargs="?", help="without a broker's requests")
    options = parser.parse_args()
    runs: int = options.runs
    times = fly(runs, broker=options.alone is None)
    percentiles = [
        f"p{percent} {percentile(times.steps_us, percent):.1f} us" for percent in STEP_BAR_US
    ]
    sys.stdout.write("\n".join((table(times), *percentiles, "")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
