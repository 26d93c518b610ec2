"""Height of the ground under the vehicle, by a range finder that looks down.

The ground is a down coordinate about the local origin, which the motion does not change. A landing
and a descent by stick go by it while it is measured.
"""

import math
from collections import deque
from statistics import median
from typing import Final

from uav_firmware.lib.rotation import tilt_of
from uav_firmware.msg.estimate import TerrainEstimate, VehicleLocalPosition
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.vectors import Quaternion

_SAMPLES: Final = 5  # Their median rejects a bird, a stalk, or a sample without an echo
_TILT_MAX: Final = math.radians(30.0)  # [rad] Tilted more, it measures ground elsewhere
_TIMEOUT_US: Final = 500_000  # [us] Ground measured before that is not below any more
_NAN: Final = math.nan


class TerrainFilter:
    """Median of the newest samples."""

    def __init__(self) -> None:
        self._downs: deque[float] = deque(maxlen=_SAMPLES)
        self._resets = 0

    def update(self, sample: SensorRange, q: Quaternion, position: VehicleLocalPosition) -> float:
        """Down coordinate [m, NED about the local origin] of the ground; NaN while unknown.

        A sample without an echo proves nothing: water and dark soil give none either. The samples
        before a reset of the estimated height count no more.
        """
        tilt = tilt_of(q)
        resets = position.resets.z_count
        if resets != self._resets:
            self._resets = resets
            self._downs.clear()
        is_valid = sample.minimum_m <= sample.distance_m <= sample.maximum_m
        if not is_valid or tilt > _TILT_MAX or not position.altitude_valid:
            self._downs.clear()
            return _NAN
        self._downs.append(position.position_ned[2] + sample.distance_m * math.cos(tilt))
        return median(self._downs) if len(self._downs) == _SAMPLES else _NAN


def ground_down(measured: TerrainEstimate | None, now_us: int) -> float:
    """Down coordinate [m] of the ground below; NaN where it is not measured now."""
    if measured is None or now_us - measured.time_us > _TIMEOUT_US:
        return _NAN
    return measured.ground_down
