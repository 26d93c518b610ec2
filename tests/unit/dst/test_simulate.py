import logging
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dst.__main__
from dst.faults.kinds import Fault, draw
from dst.simulate import FAULTS_S, Outcome, shrink, simulate
from dst.world.edge_process import prepared_folder

FAILED = Outcome(7, frozenset(), "broken", "", (), 600.0, 1.0, 3)


def test_a_seed_enables_a_subset_of_the_faults() -> None:
    drawn = [draw(seed) for seed in range(40)]
    assert drawn == [draw(seed) for seed in range(40)]
    assert set().union(*drawn) == set(Fault)
    assert all(faults != frozenset(Fault) for faults in drawn)


@pytest.mark.parametrize("cause", [{Fault.PILOT}, {Fault.LOSS, Fault.ABORTS}])
def test_faults_that_are_not_needed_are_dropped(cause: Collection[Fault]) -> None:
    def run(faults: frozenset[Fault]) -> Outcome:
        failure = "broken" if faults >= frozenset(cause) else None
        return replace(FAILED, faults=faults, failure=failure)

    found = shrink(run(frozenset(Fault)), run)
    assert found.faults == frozenset(cause)
    assert found.failure == "broken"


@pytest.mark.parametrize(
    ("outcome", "command"),
    [
        (FAILED, "make dst SEED=7 FAULTS=none"),
        (replace(FAILED, faults=frozenset({Fault.PILOT, Fault.LOSS})), "FAULTS=loss,pilot"),
        (replace(FAILED, hours=12.0), "FAULTS=none HOURS=12"),
        (replace(FAILED, shift_s=20.0), "FAULTS=none SHIFT_S=20"),
        (replace(FAILED, hours=0.5, is_deep=True), "FAULTS=none HOURS=0.5 DEPTH=1"),
    ],
)
def test_a_failure_is_described_with_the_command_that_replays_it(
    outcome: Outcome, command: str
) -> None:
    assert outcome.describe().startswith("seed 7: broken\n")
    assert outcome.describe().endswith(command)


def test_a_replay_that_fails_prints_its_own_command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulated(seed: int, prepared: Path, *, kept_lines: None, **options: Any) -> Outcome:
        assert prepared.is_dir()
        assert kept_lines is None
        return replace(FAILED, seed=seed, **options)

    monkeypatch.setattr(dst.__main__, "simulate", simulated)
    try:
        status = dst.__main__.main(["--seed=9", "--hours=0.5", "--depth", "--faults=pilot,loss"])
    finally:
        logging.disable(logging.NOTSET)
    assert status == 1
    command = "make dst SEED=9 FAULTS=loss,pilot HOURS=0.5 DEPTH=1\n"
    assert capsys.readouterr().out.endswith(command)


@pytest.mark.thorough
def test_the_farm_works_in_shifts_with_breaks(tmp_path: Path) -> None:
    prepared = prepared_folder(tmp_path / "prepared")
    outcomes = [simulate(8, prepared, hours=2.0, kept_lines=None) for _ in range(2)]
    assert outcomes[0].digest == outcomes[1].digest
    [outcome, _] = outcomes
    assert outcome.failure is None
    assert outcome.describe().endswith(" HOURS=2")
    assert outcome.simulated_s >= 2.0 * 3600.0 + FAULTS_S
    assert 0.0 < outcome.flight_s < 2.0 * FAULTS_S * 2.0
    text = "\n".join(outcome.lines)
    assert text.count("every vehicle is switched off") == 1
    assert text.count("every vehicle is switched on") == 1
