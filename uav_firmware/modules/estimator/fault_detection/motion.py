"""What the inertial samples show of the motion: rest, an impact, how far it has turned, its spin.

An impact lasts a few milliseconds, less than a sample, and may exceed the accelerometer's range:
the velocity afterwards is wrong by metres per second, and no sensor is broken for that. Only the
beginning counts, so that an accelerometer which reads a large force for long hides nothing.

Where the range was exceeded, the change of velocity is not known: for the first fix after the
impact that uncertainty counts, else the fix would be rejected for seconds.
"""

import math
from typing import Final

from uav_firmware.msg.vectors import Vector3

_IMPACT_M_S2: Final = 45.0  # Beyond what the rotors give, twice over
_DISTURBED_US: Final = 2_000_000
_CLIPS_M_S2: Final = 150.0  # Of an axis: that of the usual 16 g sensor saturates
_LONGEST_US: Final = 1_000_000  # A fix later than that finds an estimate that others have corrected

UNSEEN_M_S: Final = 3.0
"""[m/s] Of velocity that an impact beyond the range changes unseen, one sigma of each axis."""

_MEMORY_S: Final = 2.0
_SPIN_STEP_RAD_S: Final = 5.0  # 286 deg/s: no flight on all rotors turns so fast about its yaw axis
_SCALE_ERROR: Final = 0.005  # [-] Of a gyroscope, from the data sheets of MEMS sensors


class RecentRotation:
    """Leaky integral of the rate's size."""

    __slots__ = ("angle_rad",)

    def __init__(self) -> None:
        self.angle_rad = 0.0

    def update(self, rate_frd: Vector3, dt: float) -> None:
        """Use a sample [rad/s] that stands for dt [s]."""
        x, y, z = rate_frd
        leak = dt / _MEMORY_S
        self.angle_rad += math.sqrt(x * x + y * y + z * z) * dt - leak * self.angle_rad


class SpinScale:
    """What a spin about the yaw axis adds to the bias there: the scale error of the gyroscope.

    A vehicle on three rotors spins at 1000 deg/s, where 0.2 % are 2 deg/s. The filter knows the
    bias to thousandths of that and would follow the compass far too late.
    """

    __slots__ = ("_known_rad_s",)

    def __init__(self) -> None:
        self._known_rad_s = 0.0  # Yaw rate that the bias belongs to

    def update(self, yaw_rate: float) -> float:
        """Doubt of the bias [rad/s, one sigma] that comes with a yaw rate [rad/s]; mostly 0."""
        change = abs(yaw_rate - self._known_rad_s)
        if change < _SPIN_STEP_RAD_S:
            return 0.0
        self._known_rad_s = yaw_rate
        return _SCALE_ERROR * change


class RestDetector:
    """Whether the vehicle moves, by the mean square of its rate and acceleration."""

    __slots__ = ("_acceleration", "_rate")

    _SMOOTHING: Final = 0.02  # [-] Share of one sample; 0.2 s at 250 Hz
    _LARGEST_RATE: Final = 0.1  # [rad/s] Root mean square
    _LARGEST_ACCELERATION: Final = 1.0  # [m/s^2]

    def __init__(self) -> None:
        self._rate = 0.0
        self._acceleration = 0.0

    def update(self, rate_frd: Vector3, acceleration: Vector3) -> None:
        """Use the rate [rad/s] and the acceleration without gravity [m/s^2] of a sample."""
        x, y, z = rate_frd
        self._rate += self._SMOOTHING * (x * x + y * y + z * z - self._rate)
        x, y, z = acceleration
        self._acceleration += self._SMOOTHING * (x * x + y * y + z * z - self._acceleration)

    @property
    def at_rest(self) -> bool:
        """True while both stay small; a steady hover is small as well."""
        return (
            self._rate < self._LARGEST_RATE**2
            and self._acceleration < self._LARGEST_ACCELERATION**2
        )


class Impact:
    """When the force last rose beyond what flight gives."""

    __slots__ = ("_beyond", "_clipped_us", "_struck_us")

    def __init__(self) -> None:
        self._beyond = False
        self._struck_us: int | None = None
        self._clipped_us: int | None = None  # Until a fix of after it has come

    def update(self, force_frd: Vector3, time_us: int) -> None:
        """Use a sample [m/s^2]."""
        x, y, z = force_frd
        beyond = x * x + y * y + z * z > _IMPACT_M_S2 * _IMPACT_M_S2
        if beyond and not self._beyond:
            self._struck_us = time_us
        self._beyond = beyond
        if beyond and max(abs(x), abs(y), abs(z)) > _CLIPS_M_S2:
            self._clipped_us = time_us

    def is_recent(self, now_us: int) -> bool:
        """Whether innovations may still come from an impact."""
        return self._struck_us is not None and now_us - self._struck_us < _DISTURBED_US

    def unseen_s(self, fix_us: int, now_us: int) -> float | None:
        """Age of an impact beyond the range [s], once: for the first fix that is of after it."""
        clipped_us = self._clipped_us
        if clipped_us is None or fix_us <= clipped_us:
            return None
        self._clipped_us = None
        ago_us = now_us - clipped_us
        return ago_us * 1e-6 if ago_us < _LONGEST_US else None
