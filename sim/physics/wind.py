"""Mean wind by height with the Dryden gusts of MIL-F-8785C (1980), section 3.7, low altitude.

With h the height above ground [ft] and W20 the mean wind at 20 ft, the mean wind at h is

    W = W20 ln(h / z0) / ln(20 / z0),   z0 = 0.15 ft

the standard's wind shear near the ground (3.7.3.4, category C: open country). It is used from
1 ft, a few times the roughness z0, to 1000 ft. The gusts, h from 10 to 1000 ft:

    scale lengths   L_w = h,  L_u = L_v = h / (0.177 + 0.000823 h)^1.2           [ft]
    intensities     s_w = 0.1 W20,  s_u = s_v = s_w / (0.177 + 0.000823 h)^0.4

and the shaping filters of white noise, tau = L / V,

    along the wind       H_u(s) = s_u sqrt(2 tau) / (1 + tau s)
    across it and down   H(s)   = s sqrt(tau) (1 + sqrt(3) tau s) / (1 + tau s)^2

each of variance s^2. V, the speed at which the vehicle meets the frozen gusts, is its
airspeed, in a hover the wind itself. Taken the same over the whole frame of the vehicle: its
arms are short against every scale length.
"""

import math
from typing import Final

import numpy as np

from sim.physics.noise import standard_normals
from sim.physics.truth import Vector3
from sim.physics.units import METRES_PER_FOOT

_REFERENCE_FT: Final = 20.0
_ROUGHNESS_FT: Final = 0.15
_LOWEST_MEAN_FT: Final = 1.0
_LOWEST_FT: Final = 10.0
_HIGHEST_FT: Final = 1000.0
_LOG_OF_REFERENCE: Final = math.log(_REFERENCE_FT / _ROUGHNESS_FT)
_SQRT_3: Final = math.sqrt(3.0)
_SLOWEST_M_S: Final = 0.5  # Below it the gusts would stand still


def scale_lengths_m(height_m: float) -> tuple[float, float]:
    """Scale lengths [m] of the horizontal and of the vertical gusts at a height [m]."""
    height_ft = _clamped_ft(height_m)
    horizontal_ft = height_ft / (0.177 + 0.000823 * height_ft) ** 1.2
    return horizontal_ft * METRES_PER_FOOT, height_ft * METRES_PER_FOOT


def intensities_m_s(height_m: float, wind_speed_m_s: float) -> tuple[float, float]:
    """Standard deviations [m/s] of the horizontal and of the vertical gusts."""
    vertical = 0.1 * wind_speed_m_s
    return vertical / (0.177 + 0.000823 * _clamped_ft(height_m)) ** 0.4, vertical


def _clamped_ft(height_m: float) -> float:
    return min(max(height_m / METRES_PER_FOOT, _LOWEST_FT), _HIGHEST_FT)


def mean_wind_factor(height_m: float) -> float:
    """Mean wind at a height above ground [m] over that at 6.1 m (20 ft)."""
    height_ft = min(max(height_m / METRES_PER_FOOT, _LOWEST_MEAN_FT), _HIGHEST_FT)
    return math.log(height_ft / _ROUGHNESS_FT) / _LOG_OF_REFERENCE


class FirstOrderGust:
    """Longitudinal component, as a multiple of its intensity."""

    __slots__ = ("value",)

    def __init__(self) -> None:
        self.value = 0.0

    def step(self, step_over_tau: float, normal: float) -> float:
        """Value one step later (Euler-Maruyama)."""
        self.value += -self.value * step_over_tau + math.sqrt(2.0 * step_over_tau) * normal
        return self.value


class SecondOrderGust:
    """Lateral or vertical component, as a multiple of its intensity."""

    __slots__ = ("_inner", "value")

    def __init__(self) -> None:
        self._inner = 0.0
        self.value = 0.0

    def step(self, step_over_tau: float, normal: float) -> float:
        """Value one step later: two lags in a row, the zero as a feed-through of the noise."""
        drive = math.sqrt(step_over_tau) * normal
        inner = self._inner
        self.value += step_over_tau * ((1.0 - _SQRT_3) * inner - self.value) + _SQRT_3 * drive
        self._inner += -step_over_tau * inner + drive
        return self.value


class Wind:
    """The air's velocity at the vehicle."""

    def __init__(
        self,
        generator: np.random.Generator,
        *,
        speed_m_s: float,
        from_deg: float,
        gusts: bool,
        step_s: float,
    ) -> None:
        self._normals = standard_normals(generator)
        self._speed_m_s = speed_m_s
        self._north = -math.cos(math.radians(from_deg))
        self._east = -math.sin(math.radians(from_deg))
        self._step_s = step_s
        self._along = FirstOrderGust()
        self._across = SecondOrderGust()
        self._down = SecondOrderGust()
        self.calm = speed_m_s == 0.0
        self._gusts = gusts

    def step(self, height_m: float, airspeed_m_s: float) -> Vector3:
        """Velocity [m/s, NED] of the air one step later, at a height above ground [m]."""
        mean = self._speed_m_s * mean_wind_factor(height_m)
        if self.calm or not self._gusts:
            return (mean * self._north, mean * self._east, 0.0)
        horizontal_m, vertical_m = scale_lengths_m(height_m)
        sigma_horizontal, sigma_vertical = intensities_m_s(height_m, self._speed_m_s)
        travelled_m = max(airspeed_m_s, _SLOWEST_M_S) * self._step_s
        normals = self._normals
        along = sigma_horizontal * self._along.step(travelled_m / horizontal_m, next(normals))
        across = sigma_horizontal * self._across.step(travelled_m / horizontal_m, next(normals))
        down = sigma_vertical * self._down.step(travelled_m / vertical_m, next(normals))
        speed = mean + along
        return (
            speed * self._north - across * self._east,
            speed * self._east + across * self._north,
            down,
        )
