"""Where JSBSim's feet, pounds, slugs and Rankine end: one factor or function for each.

Exact by definition: the international foot, pound and standard gravity (NIST SP 811,
appendix B.8).
"""

from typing import Final

METRES_PER_FOOT: Final = 0.3048
NEWTONS_PER_POUND: Final = 4.4482216152605
KILOGRAMS_PER_SLUG: Final = NEWTONS_PER_POUND / METRES_PER_FOOT
KILOGRAMS_M3_PER_SLUG_FT3: Final = KILOGRAMS_PER_SLUG / METRES_PER_FOOT**3
PASCALS_PER_PSF: Final = NEWTONS_PER_POUND / METRES_PER_FOOT**2
ZERO_CELSIUS_K: Final = 273.15

_KELVIN_PER_RANKINE: Final = 5.0 / 9.0


def celsius_from_rankine(temperature_r: float) -> float:
    """Temperature [deg C] of a temperature in degrees Rankine."""
    return temperature_r * _KELVIN_PER_RANKINE - ZERO_CELSIUS_K
