"""No sensor is blamed in aggressive flight: a sample of what tests/bench flies a thousand times."""

from pathlib import Path

import pytest

from tests.bench.aggressive_flights import Flight

pytestmark = pytest.mark.scenario


@pytest.mark.parametrize(("seed", "imus"), [(1, 1), (2, 3), (656, 1), (717, 1)])
def test_flips_punches_and_a_hard_landing_raise_no_alarm(
    tmp_path: Path, seed: int, imus: int
) -> None:
    flight = Flight(seed, tmp_path, imus=imus)
    assert flight.fly() == []
    assert not flight.tester.simulation.wrecked
