"""Height of the ground under the vehicle, by a range finder that looks down.

The ground is a down coordinate about the local origin, which the motion does not change. A landing
and a descent by stick go by it while it is measured.

A range finder that repeats a sample, or that sees a leaf before its lens, shows a distance that the
height does not change (`RangeCheck`): the ground would seem to come down with the vehicle, and the
landing would not slow down. PX4 compares both in the same way (kinematic consistency of EKF2).
"""

import math
from collections import deque
from statistics import median
from typing import Final

from uav_firmware.lib.rotation import tilt_of
from uav_firmware.msg.estimate import TerrainEstimate, VehicleLocalPosition
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.vectors import Quaternion, Vector3

_SAMPLES: Final = 5  # Their median rejects a bird, a stalk, or a sample without an echo
_TILT_MAX: Final = math.radians(30.0)  # [rad] Tilted more, it measures ground elsewhere
_TIMEOUT_US: Final = 500_000  # [us] Ground measured before that is not below any more
_JUDGED_M: Final = 1.0  # [m] Of vertical motion: many times the noise of either height
_STUCK_SHARE: Final = 0.2  # Of the vertical motion in the distance: the range finder is stuck
_FOLLOWS_SHARE: Final = 0.5  # It is not
_NAN: Final = math.nan
_NOT_MEASURED: Final = (_NAN, _NAN, _NAN)


class RangeCheck:
    """Whether the measured distance follows a vertical motion of the vehicle.

    Level flight proves nothing, nor does a flight along a slope: only a motion of more than 45
    degrees is judged, and the last verdict stays.
    """

    def __init__(self) -> None:
        self.has_failed = False
        """Whether the distance stayed as it was in the last vertical motion."""
        self._position_ned: Vector3 = _NOT_MEASURED  # Where the motion began
        self._distance_m = _NAN  # Measured there

    def restart(self) -> None:
        """Judge no motion that began before."""
        self._position_ned = _NOT_MEASURED

    def update(self, position_ned: Vector3, distance_m: float) -> None:
        """Follow position [m, NED about the local origin] and measured vertical distance [m]."""
        north, east, down = self._position_ned
        climbed_m = abs(position_ned[2] - down)
        travelled_m = math.hypot(position_ned[0] - north, position_ned[1] - east)
        is_steep = travelled_m <= climbed_m
        if is_steep and climbed_m < _JUDGED_M:
            return
        if is_steep:
            share = abs(distance_m - self._distance_m) / climbed_m
            if share <= _STUCK_SHARE:
                self.has_failed = True
            elif share >= _FOLLOWS_SHARE:
                self.has_failed = False
        self._position_ned, self._distance_m = position_ned, distance_m


class TerrainFilter:
    """Median of the newest samples."""

    def __init__(self) -> None:
        self._downs: deque[float] = deque(maxlen=_SAMPLES)
        self._resets = 0
        self._check = RangeCheck()

    @property
    def has_failed(self) -> bool:
        """Whether the range finder is stuck: it measures no ground."""
        return self._check.has_failed

    def update(
        self,
        sample: SensorRange,
        q: Quaternion,
        position: VehicleLocalPosition,
        *,
        is_flying: bool = True,
    ) -> float:
        """Down coordinate [m, NED about the local origin] of the ground; NaN while unknown.

        A sample without an echo proves nothing: water and dark soil give none either. The samples
        before a reset of the estimated height count no more, nor do those of a stuck range finder.
        """
        tilt = tilt_of(q)
        resets = position.resets.z_count
        if resets != self._resets:
            self._resets = resets
            self._clear()
        is_valid = sample.minimum_m <= sample.distance_m <= sample.maximum_m
        if not is_valid or tilt > _TILT_MAX or not position.altitude_valid:
            self._clear()
            return _NAN
        distance_m = sample.distance_m * math.cos(tilt)
        if is_flying:
            self._check.update(position.position_ned, distance_m)
        else:  # Its height drifts with the air pressure
            self._check.restart()
        self._downs.append(position.position_ned[2] + distance_m)
        if self.has_failed or len(self._downs) < _SAMPLES:
            return _NAN
        return median(self._downs)

    def _clear(self) -> None:
        self._downs.clear()
        self._check.restart()


def ground_down(measured: TerrainEstimate | None, now_us: int) -> float:
    """Down coordinate [m] of the ground below; NaN where it is not measured now."""
    if measured is None or now_us - measured.time_us > _TIMEOUT_US:
        return _NAN
    return measured.ground_down
