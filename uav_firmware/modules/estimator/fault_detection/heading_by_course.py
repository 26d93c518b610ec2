"""The error of the heading, by the course on which GPS sees the vehicle accelerate.

A heading that is wrong turns what the inertial sensors make of a horizontal acceleration; what GPS
makes of it is not turned. Over the last seconds, with w the velocity by the inertial sensors alone
and g that by GPS, both about their mean, the angle that turns w best onto g is

    angle = atan2(sum of w x g, sum of w . g)

(least squares of a rotation in the plane: G. Wahba, "A least squares estimate of satellite
attitude", SIAM Review 7, 1965). PX4 estimates the same by a bank of filters (`EKFGSF_yaw`), and
resets the heading to it when a wrong one makes the vehicle fly away.

The angle counts when the vehicle has moved enough, when the turned w is close to g, and when it is
so for several fixes on end. A receiver that is late, biased or jumps does not turn the course as a
whole, nor does a wrong tilt: then the turned w is not close to g, or the angle is small. A
gyroscope whose bias jumps may, so only several that agree are believed (`EkfCore.gyros_agree`). The
accelerometer's bias is left in w: the filter changes it to explain a wrong heading.
"""

import math
from collections import deque
from typing import Final, NamedTuple

from uav_firmware.lib.rotation import rotate
from uav_firmware.modules.estimator.kalman_filter.gate import RECEIVER_GAP_US
from uav_firmware.msg.vectors import Quaternion, Vector3

_EVERY: Final = 5  # [samples] Of the velocity that is kept: 20 ms
_KEPT: Final = 50  # A second, as the history of the filter
_WINDOW_US: Final = 2_500_000
_LEAST_FIXES: Final = 8
_LEAST_SPREAD_M_S: Final = 0.25  # Root mean square of w about its mean
_LARGEST_REST: Final = 0.15  # [-] Of the squares of g, what the turned w leaves
_LEAST_GAIN: Final = 10.0  # [-] By which the turn makes the squares of the difference smaller
_LEAST_ANGLE_RAD: Final = 0.7  # A smaller error is flown with, and GPS corrects it
_ON_END: Final = 4  # [fixes]


class Pair(NamedTuple):
    """Both velocities at the time of a fix [m/s]; that by the inertial sensors from any start."""

    time_us: int  # [us]
    inertial_north: float
    inertial_east: float
    gps_north: float
    gps_east: float


class Turn(NamedTuple):
    """How the course by GPS is turned against that by the inertial sensors."""

    angle: float  # [rad] To be added to the heading
    rest: float  # [-] Share of the squares of g that the turned w leaves
    spread_m_s: float  # Root mean square of w about its mean


class InertialCourse:
    """The horizontal velocity by the inertial sensors alone, of the last second."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, float, float]] = deque(maxlen=_KEPT)
        self._north = self._east = 0.0
        self._elapsed = 0.0
        self._steps = 0

    def add(
        self, time_us: int, change_ned: Vector3, q: Quaternion, bias_frd: Vector3, dt: float
    ) -> None:
        """Add the change of velocity [m/s] over dt [s], from which `bias_frd` [m/s^2] was taken."""
        self._north += change_ned[0]
        self._east += change_ned[1]
        self._elapsed += dt
        self._steps += 1
        if self._steps < _EVERY:
            return
        north, east, _ = rotate(q, bias_frd)
        self._north += north * self._elapsed
        self._east += east * self._elapsed
        self._steps, self._elapsed = 0, 0.0
        self._kept.append((time_us, self._north, self._east))

    def at(self, time_us: int) -> tuple[float, float] | None:
        """North and east at a time [m/s], from any start; None if that is not kept."""
        after: tuple[int, float, float] | None = None
        for kept in reversed(self._kept):
            if kept[0] <= time_us:
                if after is None:
                    return kept[1], kept[2]
                share = (time_us - kept[0]) / (after[0] - kept[0])
                return (
                    kept[1] + share * (after[1] - kept[1]),
                    kept[2] + share * (after[2] - kept[2]),
                )
            after = kept
        return None


class HeadingByCourse:
    """Compares the last seconds of both velocities."""

    def __init__(self) -> None:
        self._pairs: deque[Pair] = deque()
        self._on_end = 0

    def restart(self) -> None:
        """Forget: the heading has been changed, or the vehicle has landed."""
        self._pairs.clear()
        self._on_end = 0

    def update(self, pair: Pair) -> float | None:
        """Add a fix; the angle [rad] to be added to the heading, if that is proved to be wrong."""
        pairs = self._pairs
        if pairs and not 0 < pair.time_us - pairs[-1].time_us <= RECEIVER_GAP_US:
            self.restart()
        pairs.append(pair)
        while pair.time_us - pairs[0].time_us > _WINDOW_US:
            pairs.popleft()
        turn = turn_of(list(pairs)) if len(pairs) >= _LEAST_FIXES else None
        if turn is None or not is_wrong(turn):
            self._on_end = 0
            return None
        self._on_end += 1
        return turn.angle if self._on_end >= _ON_END else None


def turn_of(pairs: list[Pair]) -> Turn | None:
    """The angle of least squares; None where one of the velocities does not change."""
    share = 1.0 / len(pairs)
    mean_wn = share * sum([pair.inertial_north for pair in pairs])
    mean_we = share * sum([pair.inertial_east for pair in pairs])
    mean_gn = share * sum([pair.gps_north for pair in pairs])
    mean_ge = share * sum([pair.gps_east for pair in pairs])
    along = across = square_w = square_g = 0.0
    for pair in pairs:
        wn, we = pair.inertial_north - mean_wn, pair.inertial_east - mean_we
        gn, ge = pair.gps_north - mean_gn, pair.gps_east - mean_ge
        along += wn * gn + we * ge
        across += wn * ge - we * gn
        square_w += wn * wn + we * we
        square_g += gn * gn + ge * ge
    if min(square_w, square_g) < 1e-9:
        return None
    rest = (square_w + square_g - 2.0 * math.hypot(along, across)) / square_g
    return Turn(math.atan2(across, along), rest, math.sqrt(share * square_w))


def is_wrong(turn: Turn) -> bool:
    """Whether the heading is wrong, and the angle good enough to set it by.

    Two courses of one shape and size that are apart by the angle differ by 2 (1 - cos angle).
    """
    explained = 2.0 * (1.0 - math.cos(turn.angle))
    return (
        abs(turn.angle) > _LEAST_ANGLE_RAD
        and turn.spread_m_s > _LEAST_SPREAD_M_S
        and turn.rest < min(_LARGEST_REST, explained / _LEAST_GAIN)
    )
