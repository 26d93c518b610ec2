"""One seed from beginning to end, and the search for fewer faults with which it still fails."""

import shutil
import tempfile
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dst.faults import Fault, Faults, draw
from dst.laws import LawError, Laws
from dst.operator_person import Operator
from dst.scheduler import KEPT_LINES
from dst.world import World

FAULTS_S: Final = 300.0
"""Virtual time with faults."""
QUIET_S: Final = 1200.0
"""Virtual time after which everything has come to its end without faults."""
LOOK_S: Final = 20.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one seed."""

    seed: int
    faults: frozenset[Fault]
    failure: str | None
    digest: str
    lines: tuple[str, ...]
    simulated_s: float
    cpu_s: float
    plans: int


def simulate(
    seed: int,
    prepared: Path,
    *,
    faults: Collection[Fault] | None = None,
    kept_lines: int | None = KEPT_LINES,
    vehicles: int = 2,
) -> Outcome:
    """Run one seed, by default with the faults that it draws."""
    enabled = draw(seed) if faults is None else frozenset(faults)
    folder = Path(tempfile.mkdtemp(prefix="dst-", dir=prepared.parent))
    began_s = time.process_time()
    world = World(seed, prepared, folder, vehicles=vehicles, kept_lines=kept_lines)
    operator = Operator(world, enabled)
    failure = None
    try:
        _run(world, operator, enabled)
    except LawError as error:
        failure = str(error)
    except Exception as error:  # noqa: BLE001  # an exception of the product is a failure too
        failure = f"{type(error).__name__}: {error}"
    finally:
        world.close()
        shutil.rmtree(folder)
    trace = world.scheduler.trace
    return Outcome(
        seed=seed,
        faults=enabled,
        failure=failure,
        digest=trace.digest,
        lines=tuple(trace.lines),
        simulated_s=world.scheduler.now_s,
        cpu_s=time.process_time() - began_s,
        plans=len(operator.plans),
    )


def _run(world: World, operator: Operator, enabled: frozenset[Fault]) -> None:
    laws = Laws(world, operator)
    faults = Faults(world, enabled)
    world.run(FAULTS_S)
    operator.stop()
    faults.stop()
    end_s = world.scheduler.now_s + QUIET_S
    while world.scheduler.now_s < end_s:
        world.run(LOOK_S)
        if not laws.open_matters():
            break
    laws.check_end()


def shrink(outcome: Outcome, run: Callable[[frozenset[Fault]], Outcome]) -> Outcome:
    """Drop faults, one after the other, while the seed still fails; gives the last failure."""
    for fault in sorted(outcome.faults):
        fewer = run(outcome.faults - {fault})
        if fewer.failure is not None:
            outcome = fewer
    return outcome
