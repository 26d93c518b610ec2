"""Whether the time of day may be used to delete what is old.

A clock that was just set may be wrong by years, and a deletion cannot be undone. A record whose
receipt was deleted by such a clock is stored a second time when it is repeated.
"""

from typing import Final

STEADY_S: Final = 3600.0
"""The clock must have run steadily for so long before anything counts as too old."""
JUMP_S: Final = 60.0


class SteadyClock:
    """Since when the wall clock has run like the monotonic one. Times are seconds."""

    def __init__(self) -> None:
        self._began: tuple[float, float] | None = None

    def watch(self, wall_s: float, monotonic_s: float) -> float | None:
        """Note the time; returns the time that it would be without a jump, None if there is none.

        Call it often: a jump is seen at the next call.
        """
        began = self._began
        expected_s = None if began is None else began[0] + monotonic_s - began[1]
        if expected_s is not None and abs(wall_s - expected_s) <= JUMP_S:
            return None
        self._began = wall_s, monotonic_s
        return expected_s

    def is_steady(self, monotonic_s: float) -> bool:
        """Whether it has run steadily for `STEADY_S`, as far as it was watched."""
        return self._began is not None and monotonic_s - self._began[1] >= STEADY_S
