"""`python -m dst`: run seeds, print those that fail, replay one with its trace."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import logging
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from dst import coverage
from dst.faults.kinds import Fault, draw
from dst.simulate import FAULTS_S, Outcome, shrink, simulate
from dst.world.edge_process import prepared_folder

INTERRUPTED = 130
MEMORY = Path("/dev/shm")  # noqa: S108  # a folder of its own is made in it
"""A disk in memory, if there is one: nothing here has to survive the machine."""


def main(arguments: Sequence[str]) -> int:
    """Run; gives the exit status, 1 if a seed fails."""
    parser = argparse.ArgumentParser(prog="python -m dst", description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="how many seeds (20)")
    parser.add_argument("--first", type=int, default=1, help="the first of them (1)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument(
        "--hours", type=float, default=0.0, help="hours of farm, in shifts with breaks (one shift)"
    )
    parser.add_argument(
        "--shift-s", type=float, default=FAULTS_S, help=f"seconds with faults ({FAULTS_S:g})"
    )
    parser.add_argument(
        "--depth", action="store_true", help="one vehicle, with the whole flight stack on JSBSim"
    )
    parser.add_argument("--seed", type=int, help="replay this seed with its trace")
    parser.add_argument("--faults", help="replay with these faults: comma-separated, or none")
    parser.add_argument("--needs", help="only the seeds that enable these faults: as --faults")
    parser.add_argument("--stop", action="store_true", help="stop at the first seed that fails")
    parser.add_argument("--shrink", action="store_true", help="drop faults while the seed fails")
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    with _folder() as prepared:
        run = partial(
            simulate,
            prepared=prepared,
            hours=options.hours,
            shift_s=options.shift_s,
            is_deep=options.depth,
        )
        if options.seed is not None:
            replay = partial(run, options.seed, kept_lines=None)
            return _replay(replay, _faults(options.faults), must_shrink=options.shrink)
        needs = _faults(options.needs) or frozenset()
        every = range(options.first, options.first + options.seeds)
        return _run_all([seed for seed in every if draw(seed) >= needs], run, options)


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        yield prepared_folder(Path(folder) / "prepared")


def _faults(text: str | None) -> frozenset[Fault] | None:
    if text is None:
        return None
    return frozenset(Fault(name) for name in text.split(",") if name != "none")


def _replay(
    run: Callable[..., Outcome], faults: frozenset[Fault] | None, *, must_shrink: bool
) -> int:
    outcome = run(faults=faults)
    if must_shrink and outcome.failure is not None:
        outcome = shrink(outcome, lambda fewer: run(faults=fewer))
    print(*outcome.lines, sep="\n")
    print(outcome.describe())
    return outcome.failure is not None


def _run_all(
    seeds: Sequence[int], run: Callable[[int], Outcome], options: argparse.Namespace
) -> int:
    outcomes = []
    interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN)  # The processes inherit it
    with get_context("spawn").Pool(options.jobs, initializer=logging.disable) as pool:
        signal.signal(signal.SIGINT, interrupt)
        for outcome in pool.imap_unordered(run, seeds):
            outcomes.append(outcome)
            if outcome.failure is not None:
                print(outcome.describe(), flush=True)
                if options.stop:
                    break
    reached: Counter[str] = Counter()
    for outcome in outcomes:
        reached.update(outcome.reached)
    print(coverage.text_of(reached))
    failed = sum(outcome.failure is not None for outcome in outcomes)
    simulated_s = sum(outcome.simulated_s for outcome in outcomes)
    cpu_s = sum(outcome.cpu_s for outcome in outcomes)
    flight_s = sum(outcome.flight_s for outcome in outcomes)
    plans = sum(outcome.plans for outcome in outcomes)
    print(
        f"{len(outcomes)} seeds, {failed} failed; {plans} plans, "
        f"{simulated_s / 3600:.1f} simulated hours, {simulated_s / cpu_s:.0f} per hour and core; "
        f"{flight_s / 3600:.2f} flight hours, {flight_s / cpu_s:.1f} per hour and core"
    )
    return failed > 0


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # The folder is removed
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
