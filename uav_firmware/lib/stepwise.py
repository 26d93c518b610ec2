"""Long computations in pieces, so that no control step waits for the whole of one.

The work is a generator that yields how much it has done since the last time; the sum, and no
clock, decides when to pause, so that a flight stays the same on every machine.
"""

import math
from collections.abc import Generator
from typing import Generic, TypeVar

T = TypeVar("T")


class Stepwise(Generic[T]):
    """A computation in progress."""

    def __init__(self, steps: Generator[int, None, T]) -> None:
        """Prepare the work; nothing is done yet."""
        self._steps = steps
        self._results: list[T] = []

    @property
    def done(self) -> bool:
        """Whether there is a result."""
        return bool(self._results)

    @property
    def result(self) -> T:
        """Result of the computation.

        Raises:
            RuntimeError: if it is not done.
        """
        if not self._results:
            raise RuntimeError("the work is not done")
        return self._results[0]

    def advance(self, budget: float = math.inf) -> bool:
        """Work until it is done or the budget is spent; return whether it is done."""
        try:
            while budget > 0 and not self._results:
                budget -= next(self._steps)
        except StopIteration as end:
            self._results.append(end.value)
        return self.done


def finished(steps: Generator[int, None, T]) -> T:
    """Result of all the work at once."""
    work = Stepwise(steps)
    work.advance()
    return work.result
