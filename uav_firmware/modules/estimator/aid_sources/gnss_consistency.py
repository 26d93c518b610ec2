"""Whether position and velocity of a receiver contradict each other.

The position must change by the integral of the velocity. Over a second and a half

    b = (change of position - integral of velocity) / time

is the error of the velocity, or the drift of the position. Over two such intervals on end it must
be beyond a limit, and have its share in each of them: then it is no jump and no noise. Which of
the two is wrong the receiver cannot say: the one that has already disagreed with the inertial
sensors is not used again while it lasts (`gate.Aid.fuse`). Without that the gate lets it in as soon
as the uncertainty has grown enough, and the vehicle follows it.
"""

import math
from collections import deque
from typing import Final

from uav_firmware.modules.estimator.kalman_filter.gate import RECEIVER_GAP_US

_HALF_US: Final = 1_500_000
_LIMIT_M_S: Final = 0.4  # Noise of 0.3 m makes 0.14 m/s of it in three seconds
_SHARE: Final = 0.5  # [-] Of the whole, in each half


class GpsConsistency:
    """Compares both over the last three seconds."""

    def __init__(self) -> None:
        # Time [us], and position less the integral of the velocity, north and east [m]
        self._kept: deque[tuple[int, float, float]] = deque()
        self._north = self._east = 0.0
        self._velocity = (0.0, 0.0)
        self.contradicts = False
        self.apart_m_s = math.inf  # By which the position runs away; infinite while not known

    def update(
        self, time_us: int, position_ne: tuple[float, float], velocity_ne: tuple[float, float]
    ) -> None:
        """Add a fix [m, m/s]."""
        kept = self._kept
        if kept and not 0 < time_us - kept[-1][0] <= RECEIVER_GAP_US:
            kept.clear()
        if kept:
            half = 0.5e-6 * (time_us - kept[-1][0])
            self._north += half * (velocity_ne[0] + self._velocity[0])
            self._east += half * (velocity_ne[1] + self._velocity[1])
        self._velocity = velocity_ne
        kept.append((time_us, position_ne[0] - self._north, position_ne[1] - self._east))
        while len(kept) > 1 and time_us - kept[1][0] >= 2 * _HALF_US:
            kept.popleft()
        self.contradicts = self._is_off(time_us)

    def _is_off(self, time_us: int) -> bool:
        kept = self._kept
        if time_us - kept[0][0] < 2 * _HALF_US:
            self.apart_m_s = math.inf
            return False
        middle = kept[0]
        for entry in kept:
            if time_us - entry[0] < _HALF_US:
                break
            middle = entry
        north, east = _rate(kept[0], kept[-1])
        self.apart_m_s = size = math.hypot(north, east)
        if size <= _LIMIT_M_S:
            return False
        halves = (_rate(kept[0], middle), _rate(middle, kept[-1]))
        return all(half[0] * north + half[1] * east > _SHARE * size * size for half in halves)


def _rate(first: tuple[int, float, float], last: tuple[int, float, float]) -> tuple[float, float]:
    """How fast the position runs away from the velocity, north and east [m/s]."""
    elapsed_s = (last[0] - first[0]) * 1e-6
    return (last[1] - first[1]) / elapsed_s, (last[2] - first[2]) / elapsed_s
