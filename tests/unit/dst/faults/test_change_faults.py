"""Kills near changes: of which programs, how soon, and until when."""

import re
from pathlib import Path

import pytest

from dst.faults.change_faults import WITHIN_S
from dst.faults.kinds import Fault
from dst.simulate import FAULTS_S, Outcome, simulate
from dst.world.edge_process import prepared_folder

ALONE = frozenset({Fault.KILLED_AT_CHANGES, Fault.ABORTS, Fault.PAUSES})
SEEDS = (2, 5)
_LINE = re.compile(r"^ *(\d+\.\d+)  faults > (.+): (?:is )?(struck soon|killed|reboot at a change)")


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> list[Outcome]:
    prepared = prepared_folder(tmp_path_factory.mktemp("prepared") / "state")
    return [simulate(seed, prepared, faults=ALONE, kept_lines=None) for seed in SEEDS]


def kills(outcome: Outcome) -> list[tuple[float, str, str]]:
    """When what happened to whom."""
    found = (_LINE.match(line) for line in outcome.lines)
    return [(float(one[1]), one[2], one[3]) for one in found if one is not None]


def test_every_law_holds(outcomes: list[Outcome]) -> None:
    assert [outcome.failure for outcome in outcomes] == [None, None]


def test_a_kill_follows_its_change_within_a_second(outcomes: list[Outcome]) -> None:
    count = 0
    for outcome in outcomes:
        announced_s = -WITHIN_S
        for time_s, _, what in kills(outcome):
            assert time_s <= FAULTS_S
            if what == "struck soon":
                announced_s = time_s
            else:
                assert announced_s <= time_s <= announced_s + WITHIN_S
                count += 1
    assert count > 0


def test_the_same_seed_kills_the_same(outcomes: list[Outcome], tmp_path: Path) -> None:
    again = simulate(SEEDS[0], prepared_folder(tmp_path / "prepared"), faults=ALONE)
    assert again.digest == outcomes[0].digest
