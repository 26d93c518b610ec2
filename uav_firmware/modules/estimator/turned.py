"""How far the vehicle has turned of late: what scale factor and misalignment feed on."""

import math
from typing import Final

from uav_firmware.msg.vectors import Vector3

_MEMORY_S: Final = 2.0


class Turned:
    """Leaky integral of the rate's size."""

    __slots__ = ("angle_rad",)

    def __init__(self) -> None:
        self.angle_rad = 0.0

    def update(self, rate_frd: Vector3, dt: float) -> None:
        """Take a sample [rad/s] that stands for dt [s]."""
        x, y, z = rate_frd
        leak = dt / _MEMORY_S
        self.angle_rad += math.sqrt(x * x + y * y + z * z) * dt - leak * self.angle_rad
