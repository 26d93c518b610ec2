"""Height of the ground under the vehicle, by a range finder that looks down.

The ground is a down coordinate about the local origin, which the motion does not change. A landing
and a descent by stick go by it while it is measured.

A range finder that repeats a sample, that sees a leaf before its lens or that sends anything, shows
a ground that moves when the vehicle climbs or descends (`RangeCheck`): a landing would not slow
down. PX4 compares both in the same way (kinematic consistency of EKF2).
"""

import math
from collections import deque
from typing import Final

from uav_firmware.lib.rotation import tilt_of
from uav_firmware.msg.estimate import TerrainEstimate, VehicleLocalPosition
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.vectors import Quaternion, Vector3

_SAMPLES: Final = 5  # Their median rejects a bird, a stalk, or a sample without an echo
_TILT_MAX: Final = math.radians(30.0)  # [rad] Tilted more, it measures ground elsewhere
_TIMEOUT_US: Final = 500_000  # [us] Ground measured before that is not below any more
_JUDGED_M: Final = 1.0  # [m] Of vertical motion: many times the noise of either height
_SLOPE: Final = 0.3  # [-] Of ground over which the vehicle flies on meanwhile
_FAILED_SHARE: Final = 0.8  # Of the vertical motion in that of the ground: it is not measured
_FOLLOWS_SHARE: Final = 0.5  # It is
_AGREE_M: Final = 1.0  # [m] Between the middle three samples
_NAN: Final = math.nan
_NOT_MEASURED: Final = (_NAN, _NAN, _NAN)


class RangeCheck:
    """Whether the measured ground stays where it is in a vertical motion of the vehicle.

    Level flight proves nothing, nor does a flight along a slope: only a motion of more than 45
    degrees is judged, and the last verdict stays.
    """

    def __init__(self) -> None:
        self.has_failed = False
        """Whether the ground moved in the last vertical motion."""
        self._position_ned: Vector3 = _NOT_MEASURED  # Where the motion began
        self._ground_down = _NAN  # Measured there

    def restart(self) -> None:
        """Judge no motion that began before."""
        self._position_ned = _NOT_MEASURED

    def update(self, position_ned: Vector3, ground_down: float) -> None:
        """Follow position and down coordinate of the ground [m, NED about the local origin]."""
        north, east, down = self._position_ned
        climbed_m = abs(position_ned[2] - down)
        travelled_m = math.hypot(position_ned[0] - north, position_ned[1] - east)
        is_steep = travelled_m <= climbed_m
        if is_steep and climbed_m < _JUDGED_M:
            return
        if is_steep:
            moved_m = abs(ground_down - self._ground_down) - _SLOPE * travelled_m
            if moved_m >= _FAILED_SHARE * climbed_m:
                self.has_failed = True
            elif moved_m <= _FOLLOWS_SHARE * climbed_m:
                self.has_failed = False
        self._position_ned, self._ground_down = position_ned, ground_down


class TerrainFilter:
    """Median of the newest samples, if the middle three agree."""

    def __init__(self) -> None:
        self._downs: deque[float] = deque(maxlen=_SAMPLES)
        self._resets = 0
        self._check = RangeCheck()

    @property
    def has_failed(self) -> bool:
        """Whether what the range finder measures moves with the vehicle: it is no ground."""
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
        before a reset of the estimated height count no more, nor do those of a range finder that
        has failed.
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
        down = position.position_ned[2] + sample.distance_m * math.cos(tilt)
        if is_flying:
            self._check.update(position.position_ned, down)
        else:  # Its height drifts with the air pressure
            self._check.restart()
        self._downs.append(down)
        if self.has_failed or len(self._downs) < _SAMPLES:
            return _NAN
        _, lower, middle, upper, _ = sorted(self._downs)
        return middle if upper - lower <= _AGREE_M else _NAN

    def _clear(self) -> None:
        self._downs.clear()
        self._check.restart()


def ground_down(measured: TerrainEstimate | None, now_us: int) -> float:
    """Down coordinate [m] of the ground below; NaN where it is not measured now."""
    if measured is None or now_us - measured.time_us > _TIMEOUT_US:
        return _NAN
    return measured.ground_down
