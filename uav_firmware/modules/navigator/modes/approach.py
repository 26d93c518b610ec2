"""Whether a vehicle still comes nearer to a place, or the wind keeps it away."""

import math
from typing import Final

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.vectors import Vector3

NEAR_M: Final = 1.0  # [m] A vehicle nearer to its setpoint follows it
_PROGRESS_M: Final = 0.5  # [m] More than the estimate's noise
_WAITING_SHARE: Final = 0.5  # Of MPC_XY_ERR_MAX, from which on the setpoint waits


class Approach:
    """Watches one approach; a vehicle that follows its setpoint is never given up."""

    def __init__(self, patience_s: float) -> None:
        self._patience_us = round(patience_s * 1e6)
        self._place: Vector3 | None = None
        self._nearest_m = math.inf
        self._since_us = 0  # Of the last progress

    def has_stalled(self, flight: Flight, place: Vector3) -> bool:
        """Whether the vehicle, behind its setpoint, has long come no nearer to a place [m]."""
        distance, _ = flight.error_to(place)
        follows = flight.behind_m <= min(NEAR_M, _WAITING_SHARE * flight.params.tracking_error_max)
        if follows or place != self._place or distance < self._nearest_m - _PROGRESS_M:
            self._place, self._nearest_m, self._since_us = place, distance, flight.now_us
        return flight.now_us - self._since_us >= self._patience_us
