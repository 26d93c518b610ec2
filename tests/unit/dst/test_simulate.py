from collections.abc import Collection
from dataclasses import replace

import pytest

from dst.faults import Fault, draw
from dst.simulate import Outcome, shrink

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
