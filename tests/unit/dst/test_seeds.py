"""Every law holds in every seed; one that fails prints the command that replays it."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path
from random import SystemRandom

import pytest

from dst.faults.kinds import Fault, draw
from dst.simulate import FAULTS_S, Outcome, simulate
from dst.world.edge_process import prepared_folder

FLYING = 2
FIXED = (3, 7, 9)
MORE = tuple(seed for seed in (1, *range(4, 201)) if seed not in FIXED)
DAYS = range(1, 4)
DEEP = range(1, 4)
FRESH = 17
SHORT_S = 20.0
SHORT = [range(first, first + 20) for first in range(1, 201, 20)]
FRESH_SHORT, AT_ONCE = 5, 10
"""Fifty short seeds, ten in each case."""
FAILED_BEFORE = {
    10: frozenset(
        {
            *(Fault.BATTERY_UNKNOWN, Fault.GEOFENCES, Fault.LINK_CUT_AT_CHANGES),
            *(Fault.LONG_MISSIONS, Fault.PAUSES, Fault.PICTURES, Fault.POSITION_UNKNOWN),
            *(Fault.REBOOTED_IN_FLIGHT, Fault.REPEATED_POSTS, Fault.SWAPPED),
        }
    ),
    6098: frozenset(
        {
            *(Fault.EDGE_ANSWERS_STALLED, Fault.LINK_DOWN, Fault.PICTURES, Fault.POWER_LOST),
            *(Fault.REBOOTED_IN_FLIGHT, Fault.REORDERING, Fault.REPEATED_POSTS),
        }
    ),
    30087: frozenset(
        {
            *(Fault.BROKER_KILLED, Fault.BROKER_SUSPENDED, Fault.CLOCKS, Fault.DISK_FULL),
            *(Fault.DISK_READ_ONLY, Fault.PICTURES),
        }
    ),
    40134: frozenset({Fault.BROKER_SUSPENDED, Fault.PICTURES}),
    **{
        seed: draw(seed)
        for seed in (20272, 30030, 40272, 50606, 50830, 71108, 71380, 100444, 111023)
    },
}
"""Seeds that have failed; the first ones with faults that they do not draw themselves."""
FAILED_IN_LONG_SHIFTS = (
    120018,
    120360,
    300371,
    310248,
    310450,
    320133,
    320190,
    330064,
    360057,
    371040,
)
"""Seeds that have failed with faults for five minutes."""
LONG_SHIFT_S = 300.0
LONG = range(300_000, 300_060)
SUSPENDED = frozenset({Fault.ABORTS, Fault.BROKER_SUSPENDED, Fault.PILOT})
LARGEST_SEED = 10**6
IS_CI = bool(os.environ.get("CI"))
"""Whether a change decides over the result, not chance."""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return prepared_folder(tmp_path_factory.mktemp("prepared") / "state")


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    """Log nothing: faults are expected here, thousands of them."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def check(
    seed: int,
    prepared: Path,
    hours: float = 0.0,
    *,
    shift_s: float = FAULTS_S,
    is_deep: bool = False,
) -> Outcome:
    outcome = simulate(seed, prepared, hours=hours, shift_s=shift_s, is_deep=is_deep)
    assert outcome.failure is None, outcome.describe()
    return outcome


@pytest.mark.parametrize("seed", FIXED)
def test_every_law_holds(seed: int, prepared: Path) -> None:
    check(seed, prepared)


@pytest.mark.parametrize("seeds", SHORT)
def test_every_law_holds_in_short_seeds(seeds: range, prepared: Path) -> None:
    flown_s = sum(check(seed, prepared, shift_s=SHORT_S).flight_s for seed in seeds)
    assert flown_s > 0.0


@pytest.mark.skipif(IS_CI, reason="the same seeds at every run of CI")
@pytest.mark.parametrize("_number", range(FRESH_SHORT))
def test_every_law_holds_in_short_seeds_that_nobody_has_seen(_number: int, prepared: Path) -> None:
    for _ in range(AT_ONCE):
        check(SystemRandom().randrange(LARGEST_SEED), prepared, shift_s=SHORT_S)


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "faults"), FAILED_BEFORE.items())
def test_every_law_holds_in_a_seed_that_has_failed(
    seed: int, faults: frozenset[Fault], prepared: Path
) -> None:
    outcome = simulate(seed, prepared, faults=faults)
    assert outcome.failure is None, outcome.describe()


@pytest.mark.thorough
@pytest.mark.parametrize("seed", FAILED_IN_LONG_SHIFTS)
def test_every_law_holds_in_a_long_shift_that_has_failed(seed: int, prepared: Path) -> None:
    check(seed, prepared, shift_s=LONG_SHIFT_S)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", LONG)
def test_every_law_holds_in_long_shifts(seed: int, prepared: Path) -> None:
    """With many faults little is flown within the usual two minutes."""
    check(seed, prepared, shift_s=LONG_SHIFT_S)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(20, 26))
def test_every_law_holds_while_the_broker_is_suspended(seed: int, prepared: Path) -> None:
    outcome = simulate(seed, prepared, faults=SUSPENDED, kept_lines=None)
    assert outcome.failure is None, outcome.describe()
    assert any("suspended" in line for line in outcome.lines)


def test_a_seed_posts_plans_and_flies(prepared: Path) -> None:
    outcome = check(FLYING, prepared)
    assert outcome.plans > 1
    assert outcome.flight_s > 60.0


@pytest.mark.thorough
@pytest.mark.skipif(IS_CI, reason="the same seeds at every run of CI")
@pytest.mark.parametrize("shift_s", [FAULTS_S, LONG_SHIFT_S])
@pytest.mark.parametrize("_number", range(FRESH // 2))
def test_every_law_holds_in_a_seed_that_nobody_has_seen(
    _number: int, shift_s: float, prepared: Path
) -> None:
    check(SystemRandom().randrange(LARGEST_SEED), prepared, shift_s=shift_s)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", MORE)
def test_every_law_holds_in_more_seeds(seed: int, prepared: Path) -> None:
    check(seed, prepared)


@pytest.mark.thorough
@pytest.mark.timeout(1200)  # A day takes some minutes of a core that others use too
@pytest.mark.parametrize("seed", DAYS)
def test_every_law_holds_on_days_of_the_farm(seed: int, prepared: Path) -> None:
    check(seed, prepared, hours=12.0)


@pytest.mark.thorough
@pytest.mark.timeout(1200)  # As above
@pytest.mark.parametrize("seed", DEEP)
def test_every_law_holds_with_the_whole_flight_stack(seed: int, prepared: Path) -> None:
    assert check(seed, prepared, is_deep=True).flight_s > 0.0
