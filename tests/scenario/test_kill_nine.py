"""Killed four times under load; `make soak` does it two hundred times."""

from pathlib import Path

import pytest

from tests.soak import kill_nine

CYCLES = 4
SEED = 53  # Each of the four dies once


@pytest.mark.promise
def test_every_acknowledged_record_arrives_once_and_in_order(tmp_path: Path) -> None:
    outcome = kill_nine.run(CYCLES, tmp_path / "state", SEED)
    assert set(outcome.kills) == {"relay", "worker", "server", "supervisor"}
    assert all(number > 0 for number in outcome.acknowledged.values())
