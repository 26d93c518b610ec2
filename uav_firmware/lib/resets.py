"""Steps of the estimate at a reset, by which setpoints have to be moved.

A reset moves the estimate and not the vehicle. A setpoint that is moved by the same step asks
for the same motion as before (PX4 `FlightTask::_checkEkfResetCounters`).
"""

import math
from typing import NamedTuple

from uav_firmware.lib.vector import ZERO, subtract
from uav_firmware.msg.estimate import EstimateResets
from uav_firmware.msg.vectors import Vector3


class EstimateStep(NamedTuple):
    """By how much resets have moved the estimate."""

    position_ned: Vector3 = ZERO  # [m]
    velocity_ned: Vector3 = ZERO  # [m/s]
    heading: float = 0.0  # [rad]


class ResetFollower:
    """Compares the resets of the estimate with those of the last call."""

    __slots__ = ("_seen",)

    def __init__(self) -> None:
        self._seen: EstimateResets | None = None

    def update(self, resets: EstimateResets) -> EstimateStep | None:
        """The step since the last call; None when there was no reset. The first call has none."""
        seen, self._seen = self._seen, resets
        if seen is None or resets is seen or resets.number == seen.number:
            return None
        return EstimateStep(
            subtract(resets.position_total_ned, seen.position_total_ned),
            subtract(resets.velocity_total_ned, seen.velocity_total_ned),
            math.remainder(resets.heading_total - seen.heading_total, math.tau),
        )
