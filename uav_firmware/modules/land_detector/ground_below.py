"""Where the ground under the vehicle is, by a range finder that looks down."""

import math
from collections import deque
from statistics import median
from typing import Final

from uav_firmware.lib.rotation import tilt_of
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.vectors import Quaternion

_SAMPLES: Final = 5  # Their median rejects a bird, a stalk, or a sample without an echo
_TILT_MAX: Final = math.radians(30.0)  # [rad] Tilted more, it measures ground elsewhere
_NAN: Final = math.nan


class GroundBelow:
    """Median of the newest samples as a down coordinate, which the motion does not change."""

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
