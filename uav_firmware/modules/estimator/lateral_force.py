"""Detects a lateral specific force that a multirotor cannot feel in flight.

Rotors push along the body's z axis. Along x and y the accelerometer measures nothing but drag,
some 0.3 m/s^2 for each m/s of airspeed. What the estimated motion over the ground makes of it is
taken off; what is left, the wind's share, changes as slowly as the wind does. A step of more than
that is the accelerometer's own, or a collision. A gyroscope whose bias jumps leaves the force as it
is, which is how the two are told apart (P. Martin and E. Salaun, "The true role of accelerometer
feedback in quadrotor control", ICRA 2010).
"""

import math
from typing import Final

from uav_firmware.lib.rotation import rotate_inverse
from uav_firmware.msg.vectors import Quaternion, Vector3

_FAST_S: Final = 0.15  # Averages the vibration to a tenth
_SLOW_S: Final = 1.5  # Drag of the wind and a standing bias
_STEP_M_S2: Final = 0.6  # A gust of 2 m/s, come within a second
_DRAG_PER_S: Final = 0.29  # [1/s] EKF2_MCOEF of small rotors; a tenth beside it is within the step
_HELD_S: Final = 3.0  # An accelerometer's step shows in the velocity within that


class LateralForce:
    """Fast against slow mean of the force along x and y."""

    __slots__ = ("_fast_x", "_fast_y", "_left_s", "_slow_x", "_slow_y")

    def __init__(self) -> None:
        self._fast_x = self._fast_y = self._slow_x = self._slow_y = 0.0
        self._left_s = 0.0

    def update(
        self, force_frd: Vector3, velocity_ned: Vector3, q_ned_frd: Quaternion, dt: float
    ) -> None:
        """Take a sample [m/s^2] that stands for dt [s], at the estimated motion [m/s]."""
        forward, right, _ = rotate_inverse(q_ned_frd, velocity_ned)
        x, y = force_frd[0] + _DRAG_PER_S * forward, force_frd[1] + _DRAG_PER_S * right
        fast, slow = min(dt / _FAST_S, 1.0), min(dt / _SLOW_S, 1.0)
        self._fast_x += fast * (x - self._fast_x)
        self._fast_y += fast * (y - self._fast_y)
        off_x, off_y = self._fast_x - self._slow_x, self._fast_y - self._slow_y
        self._slow_x += slow * off_x
        self._slow_y += slow * off_y
        if off_x * off_x + off_y * off_y > _STEP_M_S2 * _STEP_M_S2:
            self._left_s = _HELD_S
        elif self._left_s > 0.0:
            self._left_s -= dt

    @property
    def stepped(self) -> bool:
        """Whether the force has stepped within the last seconds."""
        return self._left_s > 0.0

    @property
    def step_m_s2(self) -> float:
        """By how much the force is off its slow mean now."""
        return math.hypot(self._fast_x - self._slow_x, self._fast_y - self._slow_y)
