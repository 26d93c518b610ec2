"""Which of two inertial sensors that disagree is wrong, by what the estimator has found since.

The estimator flies by the mean of the two. When the first is off by d, the mean is off by d/2, and
the bias that the estimator finds by GPS and barometer moves by d/2; when it is the second, by -d/2.
The bias before the dispute is the right one for the sensor that stays.
"""

from collections import deque
from typing import Final, NamedTuple

from uav_firmware.msg.vectors import Vector3

_MEMORY_US: Final = 1_500_000  # A dispute shows within that
_CLEAR: Final = 0.25  # [-] Of the disagreement: halfway to what a sensor that is wrong gives


class Verdict(NamedTuple):
    """The end of a dispute."""

    which: int  # 0 the first of the two is wrong, 1 the second
    shift_frd: Vector3  # By which the estimator's bias has to change


class Suspicion:
    """Remembers the bias before a dispute."""

    def __init__(self) -> None:
        self._past: deque[tuple[int, Vector3]] = deque()
        self._before: Vector3 | None = None

    def update(self, apart: Vector3 | None, bias_frd: Vector3, now_us: int) -> Verdict | None:
        """Take the first's reading minus the second's, None without a dispute, and the bias."""
        past = self._past
        if apart is None:
            self._before = None
            past.append((now_us, bias_frd))
            while now_us - past[0][0] > _MEMORY_US:
                past.popleft()
            return None
        if self._before is None:
            self._before = past[0][1] if past else bias_frd
            past.clear()
        moved = tuple(new - old for new, old in zip(bias_frd, self._before, strict=True))
        along = sum((m * d for m, d in zip(moved, apart, strict=True)), 0.0)
        share = along / sum((d * d for d in apart), 0.0)
        if abs(share) < _CLEAR:
            return None
        x, y, z = moved
        return Verdict(0 if share > 0.0 else 1, (-x, -y, -z))
