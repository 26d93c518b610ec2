"""International standard atmosphere below 11 km (ISO 2533:1975): pressure, altitude, density.

Altitudes are geopotential metres above the 1013.25 hPa level; over a flight's change of height
the geometric altitude differs by less than 0.03 %.
"""

import math
from typing import Final

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2

SEA_LEVEL_PRESSURE_PA: Final = 101325.0
SEA_LEVEL_TEMPERATURE_K: Final = 288.15
SEA_LEVEL_DENSITY_KG_M3: Final = 1.225
LAPSE_RATE_K_M: Final = 0.0065
GAS_CONSTANT_J_KG_K: Final = 287.05287
ZERO_CELSIUS_K: Final = 273.15

_EXPONENT: Final = STANDARD_GRAVITY_M_S2 / (GAS_CONSTANT_J_KG_K * LAPSE_RATE_K_M)
_MILD_AIR_C: Final = 15.0  # 20 degrees beside it are 7 % of the density
_SCALE_HEIGHT_M: Final = SEA_LEVEL_TEMPERATURE_K / LAPSE_RATE_K_M


def altitude_from_pressure(pressure_pa: float) -> float:
    """Pressure altitude [m] of a static pressure [Pa].

    Raises:
        ValueError: if the pressure is not positive and finite.
    """
    if not 0.0 < pressure_pa < math.inf:
        raise ValueError(f"pressure_pa: {pressure_pa} is no static pressure")
    ratio: float = (pressure_pa / SEA_LEVEL_PRESSURE_PA) ** (1.0 / _EXPONENT)
    return _SCALE_HEIGHT_M * (1.0 - ratio)


def pressure_from_altitude(altitude_m: float) -> float:
    """Static pressure [Pa] at a pressure altitude [m].

    Raises:
        ValueError: if the altitude is not finite or the formula has no value there (44 km).
    """
    if not -math.inf < altitude_m < _SCALE_HEIGHT_M:
        raise ValueError(f"altitude_m: {altitude_m} is outside the standard atmosphere")
    ratio: float = (1.0 - altitude_m / _SCALE_HEIGHT_M) ** _EXPONENT
    return SEA_LEVEL_PRESSURE_PA * ratio


def air_density(pressure_pa: float, temperature_c: float) -> float:
    """Density of dry air [kg/m^3] by the gas law.

    Raises:
        ValueError: if the temperature is not above absolute zero.
    """
    temperature_k = temperature_c + ZERO_CELSIUS_K
    if not temperature_k > 0.0:
        raise ValueError(f"temperature_c: {temperature_c} is below absolute zero")
    return pressure_pa / (GAS_CONSTANT_J_KG_K * temperature_k)


def density_at(altitude_amsl_m: float) -> float:
    """Density [kg/m^3] at an altitude of unknown temperature: standard pressure, air of 15 C.

    Raises:
        ValueError: as `pressure_from_altitude`.
    """
    return air_density(pressure_from_altitude(altitude_amsl_m), _MILD_AIR_C)
