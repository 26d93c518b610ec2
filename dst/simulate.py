"""One seed from beginning to end, and the search for fewer faults with which it still fails."""

import shutil
import tempfile
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Final

from dst.actors.operator_person import Operator
from dst.actors.technician import Technician
from dst.coverage import Coverage
from dst.faults.injection import BREAK_FACTOR, Faults
from dst.faults.kinds import KINEMATIC_ONLY, Fault, draw
from dst.laws.facts import LawError
from dst.laws.system_laws import BREAK_CHECK_PERIOD_S, CHECK_PERIOD_S, Laws
from dst.scheduler import KEPT_LINES
from dst.world.disk import StillOpenError
from dst.world.memory import MOST_OF_BROKER, MOST_OF_EDGE, held_bytes
from dst.world.world import World
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post

FAULTS_S: Final = 120.0
"""Virtual time with faults, or of each shift of a longer simulation."""
SHIFTS_PER_DAY: Final = 3
SHIFT_END_S: Final = 1200.0
"""Within this time after a shift every vehicle has landed."""
QUIET_S: Final = 1200.0
"""Virtual time after which everything has come to its end without faults."""
STUCK_QUIET_S: Final = 3600.0
"""The same with reports that always fail: each of them is tried for a minute, of every plan."""
LOOK_S: Final = 5.0
VEHICLES: Final = (1, 2)
"""Of which a seed draws how many there are."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of one seed."""

    seed: int
    faults: frozenset[Fault]
    failure: str | None
    digest: str
    lines: tuple[str, ...]
    simulated_s: float
    cpu_s: float
    plans: int
    flight_s: float = 0.0
    """Sum over the vehicles."""
    reached: Mapping[str, int] = field(default_factory=dict)
    """As `Coverage.counts`."""
    hours: float = 0.0
    shift_s: float = FAULTS_S
    is_deep: bool = False

    def describe(self) -> str:
        """Give the failure, and the command that replays the seed."""
        faults = ",".join(sorted(self.faults)) or "none"
        options = f" HOURS={self.hours:g}" if self.hours else ""
        options += f" SHIFT_S={self.shift_s:g}" if self.shift_s != FAULTS_S else ""
        options += " DEPTH=1" if self.is_deep else ""
        return (
            f"seed {self.seed}: {self.failure or 'every law holds'}\n"
            f"  trace {self.digest[:16]}, {self.simulated_s:.0f} s\n"
            f"  make dst SEED={self.seed} FAULTS={faults}{options}"
        )


def simulate(
    seed: int,
    prepared: Path,
    *,
    faults: Collection[Fault] | None = None,
    kept_lines: int | None = KEPT_LINES,
    vehicles: int | None = None,
    hours: float = 0.0,
    shift_s: float = FAULTS_S,
    is_deep: bool = False,
) -> Outcome:
    """Run one seed, by default with the faults that it draws, for the virtual time of a shift.

    With `hours`, the farm works in shifts, between which every vehicle is switched off. In depth,
    one vehicle flies with the whole flight stack on JSBSim.
    """
    enabled = draw(seed) if faults is None else frozenset(faults)
    if is_deep:
        enabled, vehicles = enabled - KINEMATIC_ONLY, 1
    elif vehicles is None:
        vehicles = Random(f"{seed}/vehicles").choice(VEHICLES)
    folder = Path(tempfile.mkdtemp(prefix="dst-", dir=prepared.parent))
    began_s = time.process_time()
    world = World(
        seed,
        prepared,
        folder,
        vehicles=vehicles,
        is_deep=is_deep,
        has_cameras=Fault.PICTURES in enabled,
        kept_lines=kept_lines,
    )
    operator = Operator(world, enabled)
    failure = None
    coverage = Coverage()
    technician = Technician(world, enabled)

    def answered(post: Post, answer: Answer) -> None:
        coverage.note_answer(post, answer)
        technician.note(post, answer)

    world.http.on_answered = answered
    try:
        with coverage.counting():
            _run(world, operator, enabled, hours, shift_s)
    except LawError as error:
        failure = str(error)
    except Exception as error:  # noqa: BLE001  # an exception of the product is a failure too
        failure = f"{type(error).__name__}: {error}"
    finally:
        try:
            world.close()
        except StillOpenError as error:
            failure = failure or str(error)
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
        flight_s=sum(vehicle.truth.flight_s for vehicle in world.vehicles.values()),
        reached=dict(coverage.counts),
        hours=hours,
        shift_s=shift_s,
        is_deep=is_deep,
    )


def _run(
    world: World, operator: Operator, enabled: frozenset[Fault], hours: float, shift_s: float
) -> None:
    laws = Laws(world, operator)
    faults = Faults(world, enabled)
    world.run(shift_s)
    for start_s in _shift_starts(world, hours):
        _take_break(world, operator, laws, faults, start_s)
        world.run(shift_s)
    operator.stop()
    faults.stop()
    quiet_s = STUCK_QUIET_S if Fault.REPORT_ALWAYS_FAILS in enabled else QUIET_S
    end_s = world.scheduler.now_s + quiet_s
    while world.scheduler.now_s < end_s:
        world.run(LOOK_S)
        if not laws.open_matters():
            break
    laws.check_end()
    _judge_memory(world)


def _shift_starts(world: World, hours: float) -> list[float]:
    """Draw when the later shifts begin [s]; the last one ends the simulation."""
    if not hours:
        return []
    random, end_s = world.scheduler.random("shifts"), hours * 3600.0
    count = max(0, round(hours / 24.0 * SHIFTS_PER_DAY) - 2)
    return [*sorted(random.uniform(0.0, end_s) for _ in range(count)), end_s]


def _take_break(
    world: World, operator: Operator, laws: Laws, faults: Faults, until_s: float
) -> None:
    """Have every vehicle land, then be switched off until the next shift [s].

    Raises:
        LawError: if a vehicle is still in the air long after the shift.
    """
    operator.stop()
    latest_s = world.scheduler.now_s + SHIFT_END_S
    while any(vehicle.armed for vehicle in world.vehicles.values()):
        if world.scheduler.now_s >= latest_s:
            raise LawError("a vehicle is armed long after the shift")
        world.run(LOOK_S)
    _judge_memory(world)
    operator.go_home()
    world.switch_off()
    faults.factor, laws.period_s = BREAK_FACTOR, BREAK_CHECK_PERIOD_S
    world.scheduler.note("farm", "-", "every vehicle is switched off")
    world.run(until_s - world.scheduler.now_s)
    world.scheduler.note("farm", "-", "every vehicle is switched on")
    faults.factor, laws.period_s = 1.0, CHECK_PERIOD_S
    world.switch_on()
    operator.start()


def _judge_memory(world: World) -> None:
    """Both programs hold so much at most when every vehicle has landed, however long they have run.

    Raises:
        LawError: if it holds more.
    """
    app = world.broker.app
    held = 0 if app is None else held_bytes(app)
    if held > MOST_OF_BROKER * len(world.vehicles):
        raise LawError(f"the broker holds {held} bytes for {len(world.vehicles)} vehicles")
    held = world.edge.held_bytes
    if held > MOST_OF_EDGE:
        raise LawError(f"the edge server holds {held} bytes")


def shrink(outcome: Outcome, run: Callable[[frozenset[Fault]], Outcome]) -> Outcome:
    """Drop faults, one after the other, while the seed still fails; gives the last failure."""
    for fault in sorted(outcome.faults):
        fewer = run(outcome.faults - {fault})
        if fewer.failure is not None:
            outcome = fewer
    return outcome
