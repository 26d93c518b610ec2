"""How much the accelerometer jumps from sample to sample: the figure of VIBRATION."""

from typing import Final

from uav_firmware.msg.sensors import SensorImu
from uav_firmware.msg.vectors import Vector3

SAMPLE_US: Final = 40_000
_MEMORY: Final = 0.96
"""Weight of the past at each sample: one second at 25 Hz."""


class VibrationMeter:
    """Exponential mean of the change of specific force between samples, per body axis.

    It looks at 25 samples a second, not at all of them, to cost next to nothing.
    """

    def __init__(self) -> None:
        self.level_frd: Vector3 = (0.0, 0.0, 0.0)
        self._last: Vector3 | None = None
        self._due_us = 0

    def update(self, imu: SensorImu | None, now_us: int) -> None:
        """Take the newest inertial sample."""
        if now_us < self._due_us or imu is None:
            return
        self._due_us = now_us + SAMPLE_US
        force, last = imu.specific_force_frd, self._last or imu.specific_force_frd
        x, y, z = (
            _MEMORY * level + (1.0 - _MEMORY) * abs(new - old)
            for level, new, old in zip(self.level_frd, force, last, strict=True)
        )
        self.level_frd = (x, y, z)
        self._last = force
