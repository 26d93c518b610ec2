"""The door for inertial samples: nothing else may reach the integration."""

import math
from typing import Final

from uav_firmware.msg.sensors import SensorImu
from uav_firmware.msg.vectors import Vector3

_LARGEST_RATE: Final = 40.0  # [rad/s] 2300 deg/s, just beyond a 2000 deg/s gyroscope
_LARGEST_FORCE: Final = 320.0  # [m/s^2] Just beyond a 32 g accelerometer
_LONGEST_STEP_S: Final = 0.1
_BAD_FOR_S: Final = 0.1


class ImuGuard:
    """Replaces absurd samples by the last good one and watches over the order of time."""

    __slots__ = ("_bad_since_us", "_force", "_rate", "_time_us", "rejected")

    def __init__(self) -> None:
        self.rejected = 0  # [-] Samples not used
        self._time_us: int | None = None
        self._rate: Vector3 = (0.0, 0.0, 0.0)
        self._force: Vector3 = (0.0, 0.0, 0.0)
        self._bad_since_us: int | None = None

    def admit(self, imu: SensorImu) -> tuple[Vector3, Vector3, float] | None:
        """Rate, specific force and dt [s] to integrate; None for a sample out of order.

        A gap longer than 0.1 s counts as 0.1 s: what happened in it is not known, and a long
        step with one sample would be worse than none.
        """
        before_us, now_us = self._time_us, imu.time_us
        if before_us is not None and now_us <= before_us:
            self.rejected += 1
            return None
        if is_sane(imu):
            self._rate, self._force = imu.rate_frd, imu.specific_force_frd
            self._bad_since_us = None
        else:
            self.rejected += 1
            if self._bad_since_us is None:
                self._bad_since_us = now_us
            if before_us is None:
                return None
        self._time_us = now_us
        dt = 0.0 if before_us is None else (now_us - before_us) * 1e-6
        if dt <= _LONGEST_STEP_S:
            return self._rate, self._force, dt
        return self._rate, self._force, _LONGEST_STEP_S

    @property
    def healthy(self) -> bool:
        """False once nothing but absurd samples has come for a tenth of a second."""
        since, now_us = self._bad_since_us, self._time_us
        return since is None or now_us is None or (now_us - since) * 1e-6 < _BAD_FOR_S


def is_sane(imu: SensorImu) -> bool:
    """Whether the sample is finite and within the range of its sensors."""
    x, y, z = imu.rate_frd
    rate = x * x + y * y + z * z
    x, y, z = imu.specific_force_frd
    force = x * x + y * y + z * z
    # A NaN compares false with everything.
    return rate < _LARGEST_RATE**2 and force < _LARGEST_FORCE**2 and math.isfinite(rate + force)
