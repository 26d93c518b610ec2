"""Initial alignment on the ground: tilt from gravity, gyro bias from rest, origin from GPS."""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import from_euler
from uav_firmware.msg.sensors import SensorGps, SensorImu
from uav_firmware.msg.vectors import Quaternion, Vector3

_WINDOW_S: Final = 1.0
_LARGEST_RATE: Final = 0.15  # [rad/s] Mean, more is a turning vehicle and no bias
_LARGEST_RATE_SPREAD: Final = 0.05  # [rad/s] One sigma per axis
_LARGEST_FORCE_SPREAD: Final = 0.6  # [m/s^2]
_LARGEST_GRAVITY_ERROR: Final = 1.0  # [m/s^2]


class TiltAlignment(NamedTuple):
    """Result of a second at rest."""

    q_ned_frd: Quaternion  # [-] Level as gravity says, heading 0
    gyro_bias_frd: Vector3  # [rad/s]
    gyro_bias_sigma: float  # [rad/s]


class _Mean:
    """Mean and spread of a vector (Welford 1962)."""

    def __init__(self) -> None:
        self.count = 0
        self.mean = [0.0, 0.0, 0.0]
        self._squares = [0.0, 0.0, 0.0]

    def add(self, vector: Vector3) -> None:
        self.count += 1
        for axis, value in enumerate(vector):
            delta = value - self.mean[axis]
            self.mean[axis] += delta / self.count
            self._squares[axis] += delta * (value - self.mean[axis])

    @property
    def vector(self) -> Vector3:
        return (self.mean[0], self.mean[1], self.mean[2])

    @property
    def spread(self) -> float:
        return math.sqrt(max(self._squares) / self.count)


class RestAverage:
    """Averages the inertial sensor until a whole window was at rest."""

    def __init__(self) -> None:
        self._restart(0)

    def _restart(self, time_us: int) -> None:
        self._start_us = time_us
        self._rate, self._force = _Mean(), _Mean()

    def add(self, imu: SensorImu) -> TiltAlignment | None:
        """Use a sample; the alignment once the window is full and was at rest."""
        if self._rate.count == 0:
            self._start_us = imu.time_us
        self._rate.add(imu.rate_frd)
        self._force.add(imu.specific_force_frd)
        if (imu.time_us - self._start_us) * 1e-6 < _WINDOW_S:
            return None
        rate, force = self._rate, self._force
        self._restart(imu.time_us)
        return _judge(rate, force)


def _judge(rate: _Mean, force: _Mean) -> TiltAlignment | None:
    """Alignment of a window, None if the vehicle moved."""
    length = math.hypot(*force.mean)
    if (
        math.hypot(*rate.mean) > _LARGEST_RATE
        or rate.spread > _LARGEST_RATE_SPREAD
        or force.spread > _LARGEST_FORCE_SPREAD
        or abs(length - STANDARD_GRAVITY_M_S2) > _LARGEST_GRAVITY_ERROR
    ):
        return None
    # At rest the specific force is what holds the vehicle up: it points along -down.
    fx, fy, fz = force.vector
    tilt = from_euler(math.atan2(-fy, -fz), math.atan2(fx, math.hypot(fy, fz)), 0.0)
    sigma = max(rate.spread / math.sqrt(rate.count), 1e-4)
    return TiltAlignment(tilt, rate.vector, sigma)


class OriginAverage:
    """Averages the good fixes of a vehicle at rest: its first position is the origin."""

    def __init__(self, window_s: float) -> None:
        self._window_us = round(window_s * 1e6)
        self._start_us: int | None = None
        self._place = _Mean()

    def restart(self) -> None:
        """Forget: the vehicle has moved or a fix was bad."""
        self._start_us = None
        self._place = _Mean()

    def add(self, gps: SensorGps) -> Vector3 | None:
        """Use a good fix; latitude, longitude [deg] and altitude [m] when there are enough."""
        if self._start_us is None:
            self._start_us = gps.time_us
        self._place.add((gps.latitude_deg, gps.longitude_deg, gps.altitude_amsl_m))
        return self._place.vector if gps.time_us - self._start_us >= self._window_us else None

    @property
    def count(self) -> int:
        """Number of fixes averaged."""
        return self._place.count
