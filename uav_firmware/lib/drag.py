"""Drag of a multirotor by its airspeed, and the airspeed by its drag: PX4's two-term model.

    drag_i = (M + rho |v| / (2 B_i)) v_i,    M = EKF2_MCOEF sqrt(rho / rho_0) sqrt(T / W)

drag is the deceleration [m/s^2] against the motion through the air, v the airspeed [m/s], i the
body axis x or y, rho the air's density and rho_0 that of the standard atmosphere at sea level. M
[1/s] is momentum drag, what the rotors lose by moving across their axes; it goes with density times
rotor speed, which goes with the root of thrust T over density, hence the roots. W is the weight.
B = m / (c_d A) [kg/m^2] is the body's ballistic coefficient along an axis, EKF2_BCOEF_X and
EKF2_BCOEF_Y. PX4: `drag_fusion.cpp`, parameters of the same names; PX4 leaves out the root of
T / W, 6 % at 28 degrees of tilt.

The momentum term acts in the plane of the rotors, along body x and y: an accelerometer reads it
as -M v_x, -M v_y. Flying level and steadily along one of these axes, g tan(tilt) is the drag of the
law above.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.atmosphere import SEA_LEVEL_DENSITY_KG_M3

_LEAST_MOMENTUM_PER_S: Final = 0.001
_BISECTIONS: Final = 50  # To the last digit of an airspeed


class DragModel(NamedTuple):
    """Coefficients of one airframe."""

    ballistic_x_kg_m2: float  # [kg/m^2] EKF2_BCOEF_X, above 0
    ballistic_y_kg_m2: float  # [kg/m^2] EKF2_BCOEF_Y, above 0
    momentum_per_s: float  # [1/s] EKF2_MCOEF, at sea level's density; 0: none

    @property
    def gives_airspeed(self) -> bool:
        """Whether the airspeed may be taken from it.

        Every rotor has momentum drag: without that coefficient, the tilt of a slight breeze would
        be a gale against the body alone. The threshold is PX4's.
        """
        return self.momentum_per_s > _LEAST_MOMENTUM_PER_S

    def factors_per_s(
        self, airspeed_m_s: float, density_kg_m3: float, thrust_ratio: float = 1.0
    ) -> tuple[float, float]:
        """Deceleration along body x and y per airspeed along that axis [1/s].

        `airspeed_m_s` is that of all axes together; the thrust is so many times the weight.
        """
        linear, square_x, square_y = self._terms(density_kg_m3, thrust_ratio)
        return linear + square_x * airspeed_m_s, linear + square_y * airspeed_m_s

    def airspeed_xy(
        self, drag_xy: tuple[float, float], density_kg_m3: float, thrust_ratio: float = 1.0
    ) -> tuple[float, float]:
        """True airspeed [m/s] along body x and y at which the deceleration is `drag_xy` [m/s^2]."""
        size = math.hypot(*drag_xy)
        if size == 0.0:
            return 0.0, 0.0
        linear, square_x, square_y = self._terms(density_kg_m3, thrust_ratio)
        x, y = drag_xy
        if square_x == square_y:
            speed = _root(linear, square_x, size)
            return x / size * speed, y / size * speed
        # The speed lies between those of the two axes; what it makes of the drag falls with it
        low, high = sorted((_root(linear, square_x, size), _root(linear, square_y, size)))
        for _ in range(_BISECTIONS):
            speed = 0.5 * (low + high)
            airspeed = x / (linear + square_x * speed), y / (linear + square_y * speed)
            if math.hypot(*airspeed) > speed:
                low = speed
            else:
                high = speed
        return airspeed

    def _terms(self, density_kg_m3: float, thrust_ratio: float) -> tuple[float, float, float]:
        """Factors of the airspeed [1/s], and of its square [1/m] along x and y."""
        share = max(thrust_ratio, 0.0) * density_kg_m3 / SEA_LEVEL_DENSITY_KG_M3
        linear = self.momentum_per_s * math.sqrt(share)
        return (
            linear,
            0.5 * density_kg_m3 / self.ballistic_x_kg_m2,
            0.5 * density_kg_m3 / self.ballistic_y_kg_m2,
        )


def _root(linear: float, square: float, drag_m_s2: float) -> float:
    """Airspeed [m/s] of a drag above 0 by one pair of factors.

    The root of the quadratic in the form that loses no digits when the drag is small.
    """
    root = math.sqrt(linear * linear + 4.0 * square * drag_m_s2)
    return 2.0 * drag_m_s2 / (linear + root)
