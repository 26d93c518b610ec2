"""The Earth that the simulator believes in: WGS-84's curvature and its magnetic field.

Shared with no other program on purpose: were the autopilot's geodesy used here, a sign
error would cancel.
"""

import math
from typing import Final, NamedTuple

_SEMI_MAJOR_AXIS_M: Final = 6_378_137.0
_FLATTENING: Final = 1.0 / 298.257223563
_ECCENTRICITY_SQUARED: Final = _FLATTENING * (2.0 - _FLATTENING)


class DegreesPerMetre(NamedTuple):
    """How many degrees one metre is at a place."""

    north: float  # [deg/m] Of latitude
    east: float  # [deg/m] Of longitude


def degrees_per_metre(latitude_deg: float, altitude_amsl_m: float) -> DegreesPerMetre:
    """Degrees of latitude and longitude in a metre north and east.

    From the meridional and transverse radii of curvature of the WGS-84 ellipsoid (NIMA
    TR8350.2, section 4). Good to a millimetre over the few metres of a sensor's error.
    """
    sine = math.sin(math.radians(latitude_deg))
    root = math.sqrt(1.0 - _ECCENTRICITY_SQUARED * sine * sine)
    meridional_m = _SEMI_MAJOR_AXIS_M * (1.0 - _ECCENTRICITY_SQUARED) / root**3
    transverse_m = _SEMI_MAJOR_AXIS_M / root
    parallel_m = (transverse_m + altitude_amsl_m) * math.cos(math.radians(latitude_deg))
    return DegreesPerMetre(
        math.degrees(1.0 / (meridional_m + altitude_amsl_m)), math.degrees(1.0 / parallel_m)
    )


MAGNETIC_FIELD_NED_GAUSS: Final = (0.257578, 0.002731, 0.370230)
"""Earth's field at the default home: the World Magnetic Model 2025 (NOAA NCEI and BGS) at
40.4434 N, 3.7382 W, 650 m, 2026.5 gives 25757.8, 273.1 and 37023.0 nT north, east and down,
that is 45102.6 nT in all, declination +0.61 degrees, inclination 55.17 degrees.

Taken as the same over the farm: a kilometre changes the model by 0.003 degrees of declination
and 0.011 degrees of inclination.
"""
