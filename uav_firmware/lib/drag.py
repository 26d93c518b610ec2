"""Drag of a multirotor by its airspeed, and the airspeed by its drag: PX4's two-term model.

    drag = M v + rho v^2 / (2 B),    M = EKF2_MCOEF sqrt(rho / rho_0) sqrt(T / W)

drag is the deceleration [m/s^2] against the motion through the air, v the airspeed [m/s], rho the
air's density and rho_0 that of the standard atmosphere at sea level. M [1/s] is momentum drag,
what the rotors lose by moving across their axes; it goes with density times rotor speed, which
goes with the root of thrust T over density, hence the roots. W is the weight. B = m / (c_d A)
[kg/m^2], EKF2_BCOEF_X, is the body's ballistic coefficient. PX4: `drag_fusion.cpp`, parameters
EKF2_MCOEF and EKF2_BCOEF_X; PX4 leaves out the root of T / W, 6 % at 28 degrees of tilt.

The momentum term acts in the plane of the rotors, along body x and y: an accelerometer reads it
as -M v_x, -M v_y. Flying level and steadily, g tan(tilt) is the drag of the law above.
"""

import math
from typing import Final, NamedTuple

SEA_LEVEL_DENSITY_KG_M3: Final = 1.225
_LEAST_MOMENTUM_PER_S: Final = 0.001


class DragModel(NamedTuple):
    """Coefficients of one airframe; either may be switched off, not both."""

    ballistic_kg_m2: float  # [kg/m^2] EKF2_BCOEF_X, above 0
    momentum_per_s: float  # [1/s] EKF2_MCOEF, at sea level's density; 0: none

    @property
    def gives_airspeed(self) -> bool:
        """Whether the airspeed may be taken from it.

        Every rotor has momentum drag: without that coefficient, the tilt of a slight breeze would
        be a gale against the body alone. The threshold is PX4's.
        """
        return self.momentum_per_s > _LEAST_MOMENTUM_PER_S

    def drag_m_s2(
        self, airspeed_m_s: float, density_kg_m3: float, thrust_ratio: float = 1.0
    ) -> float:
        """Deceleration [m/s^2] at a true airspeed, with a thrust of so many times the weight."""
        linear, square = self._terms(density_kg_m3, thrust_ratio)
        return airspeed_m_s * (linear + square * airspeed_m_s)

    def airspeed_m_s(
        self, drag_m_s2: float, density_kg_m3: float, thrust_ratio: float = 1.0
    ) -> float:
        """True airspeed [m/s] at which the deceleration is `drag_m_s2`, which is not negative."""
        linear, square = self._terms(density_kg_m3, thrust_ratio)
        if drag_m_s2 == 0.0:
            return 0.0
        # The root of the quadratic in the form that loses no digits when the drag is small
        root = math.sqrt(linear * linear + 4.0 * square * drag_m_s2)
        return 2.0 * drag_m_s2 / (linear + root)

    def _terms(self, density_kg_m3: float, thrust_ratio: float) -> tuple[float, float]:
        """Factors of the airspeed [1/s] and of its square [1/m]."""
        share = max(thrust_ratio, 0.0) * density_kg_m3 / SEA_LEVEL_DENSITY_KG_M3
        linear = self.momentum_per_s * math.sqrt(share)
        return linear, 0.5 * density_kg_m3 / self.ballistic_kg_m2
