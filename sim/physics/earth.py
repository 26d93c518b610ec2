"""The simulator's model of the Earth: WGS-84's ellipsoid and its curvature.

Shared with no other program on purpose: were the autopilot's geodesy used here, a sign
error would cancel.
"""

import math
from typing import Final, NamedTuple

SEMI_MAJOR_AXIS_M: Final = 6_378_137.0  # NIMA TR8350.2, table 3.1, as the flattening
_FLATTENING: Final = 1.0 / 298.257223563
ECCENTRICITY_SQUARED: Final = _FLATTENING * (2.0 - _FLATTENING)


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
    root = math.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    meridional_m = SEMI_MAJOR_AXIS_M * (1.0 - ECCENTRICITY_SQUARED) / root**3
    transverse_m = SEMI_MAJOR_AXIS_M / root
    parallel_m = (transverse_m + altitude_amsl_m) * math.cos(math.radians(latitude_deg))
    return DegreesPerMetre(
        math.degrees(1.0 / (meridional_m + altitude_amsl_m)), math.degrees(1.0 / parallel_m)
    )


def wrapped_longitude_deg(longitude_deg: float) -> float:
    """The same longitude, -180 to 180: a step over the date line ends on its other side."""
    if -180.0 <= longitude_deg <= 180.0:
        return longitude_deg
    return (longitude_deg + 180.0) % 360.0 - 180.0
