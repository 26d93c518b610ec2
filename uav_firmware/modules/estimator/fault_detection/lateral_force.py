"""Detects a lateral specific force that a multirotor cannot feel in flight.

Rotors push along the body's z axis. Along x and y the accelerometer measures nothing but drag,

    f = -d u,        d = M sqrt(T / W),        |f| some 0.3 m/s^2 for each m/s of airspeed u

(`uav_firmware/lib/drag.py`). What the estimated motion through the air makes of it is subtracted;
what is left changes as slowly as the wind does. A step of more than that is the accelerometer's
own, or a collision. A gyroscope whose bias jumps does not change the force, which distinguishes the
two (P. Martin and E. Salaun, "The true role of accelerometer feedback in quadrotor
control", ICRA 2010).

No vehicle's coefficient is known exactly, and of some airframes none is known at all. So the force
has stepped only if no coefficient of the range that is possible explains the change: the residual
is linear in the coefficient, and its least size over the range is what counts. A bias that jumps
is not explained by drag: the velocity that it feigns grows to the side of the bias, drag opposes
the velocity.
"""

import math
from typing import Final

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import rotate_inverse
from uav_firmware.msg.vectors import Quaternion, Vector3

_FAST_S: Final = 0.15  # Averages the vibration to a tenth
_SLOW_S: Final = 1.5  # Drag of the wind and a standing bias
_STEP_M_S2: Final = 0.6  # A gust of 2 m/s, come within a second
_HELD_S: Final = 3.0  # An accelerometer's step shows in the velocity within that
_KNOWN: Final = (0.6, 1.4)  # [-] Of a coefficient that is stated: air at 5 km, body at 12 m/s
_UNKNOWN_PER_S: Final = (0.0, 0.5)  # [1/s] Of any small multirotor


class LateralForce:
    """Fast against slow mean of the force along x and y, and of the motion that drags."""

    __slots__ = ("_fast", "_left_s", "_range_per_s", "_slow")

    def __init__(self) -> None:
        # Means of the force along x and y [m/s^2], and of the airspeed [m/s] with its share of M
        self._fast = self._slow = (0.0, 0.0, 0.0, 0.0)
        self._range_per_s = _UNKNOWN_PER_S
        self._left_s = 0.0

    def set_drag(self, drag: DragModel | None) -> None:
        """Reckon with the drag of an airframe; None, or no momentum drag: it is not known."""
        if drag is None or drag.momentum_per_s <= 0.0:
            self._range_per_s = _UNKNOWN_PER_S
            return
        least, most = _KNOWN
        self._range_per_s = (least * drag.momentum_per_s, most * drag.momentum_per_s)

    def update(
        self, force_frd: Vector3, airspeed_ned: Vector3, q_ned_frd: Quaternion, dt: float
    ) -> None:
        """Use a sample [m/s^2] that stands for dt [s], at the estimated motion in air [m/s]."""
        forward, right, _ = rotate_inverse(q_ned_frd, airspeed_ned)
        share = math.sqrt(max(-force_frd[2], 0.0) / STANDARD_GRAVITY_M_S2)
        fast, slow = dt / _FAST_S, dt / _SLOW_S
        if fast > 1.0:
            fast, slow = 1.0, min(slow, 1.0)
        force_x, force_y, _ = force_frd
        x, y, u, v = self._fast
        self._fast = x, y, u, v = (
            x + fast * (force_x - x),
            y + fast * (force_y - y),
            u + fast * (share * forward - u),
            v + fast * (share * right - v),
        )
        slow_x, slow_y, slow_u, slow_v = self._slow
        off_x, off_y, off_u, off_v = x - slow_x, y - slow_y, u - slow_u, v - slow_v
        self._slow = (
            slow_x + slow * off_x,
            slow_y + slow * off_y,
            slow_u + slow * off_u,
            slow_v + slow * off_v,
        )
        # Mostly so little has changed that no coefficient of the range could make it a step
        largest = abs(off_x) + abs(off_y) + self._range_per_s[1] * (abs(off_u) + abs(off_v))
        if largest > _STEP_M_S2 and self.step_m_s2 > _STEP_M_S2:
            self._left_s = _HELD_S
        elif self._left_s > 0.0:
            self._left_s -= dt

    @property
    def stepped(self) -> bool:
        """Whether the force has stepped within the last seconds."""
        return self._left_s > 0.0

    @property
    def step_m_s2(self) -> float:
        """By how much the force is off its slow mean now, whatever the drag may be."""
        x, y, u, v = self._fast
        slow_x, slow_y, slow_u, slow_v = self._slow
        return math.hypot(*self.beside_drag((x - slow_x, y - slow_y), (u - slow_u, v - slow_v)))

    @property
    def mean_m_s2(self) -> tuple[float, float]:
        """The force along x and y, without the vibration."""
        return self._fast[0], self._fast[1]

    def beside_drag(
        self, force_m_s2: tuple[float, float], motion_m_s: tuple[float, float]
    ) -> tuple[float, float]:
        """What no drag explains of a change of force, motion through the air having changed too."""
        x, y = force_m_s2
        forward, right = motion_m_s
        least, most = self._range_per_s
        square = forward * forward + right * right
        best = -(x * forward + y * right) / square if square > 0.0 else least
        drag = min(max(best, least), most)
        return x + drag * forward, y + drag * right
