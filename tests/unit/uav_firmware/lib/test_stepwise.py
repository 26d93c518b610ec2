from collections.abc import Generator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.stepwise import Stepwise, finished


def counting(costs: list[int]) -> Generator[int, None, int]:
    yield from costs
    return len(costs)


@given(st.lists(st.integers(1, 9)), st.integers(1, 20))
def test_work_in_pieces_ends_as_work_at_once(costs: list[int], budget: int) -> None:
    work = Stepwise(counting(costs))
    while not work.advance(budget):
        pass
    assert work.result == finished(counting(costs)) == len(costs)


def test_a_budget_is_overdrawn_by_no_more_than_one_step() -> None:
    done: list[int] = []

    def noted() -> Generator[int, None, None]:
        for _ in range(10):
            done.append(3)
            yield 3

    work = Stepwise(noted())
    assert not work.advance(7)
    assert sum(done) == 9


def test_there_is_no_result_before_the_end() -> None:
    work = Stepwise(counting([1, 1]))
    assert not work.advance(1)
    with pytest.raises(RuntimeError, match="not done"):
        _ = work.result
