"""Universal Transverse Mercator: eastings and northings of a zone to degrees. Pure.

Series of Krueger (1912) to the fourth power of the third flattening, as in Karney, "Transverse
Mercator with an accuracy of a few nanometers", J. Geodesy 85 (2011): well below a millimetre
within a zone. WGS-84 and GRS-80 differ by 0.1 mm in the length of the axis' other end.
"""

import math
from typing import Final, NamedTuple

from afarcloud.plan import Vertex

SCALE: Final = 0.9996
FALSE_EASTING_M: Final = 500_000.0
FALSE_NORTHING_M: Final = 10_000_000.0
"""Of the southern half."""
WIDEST_M: Final = 1_000_000.0
"""From the central meridian: no zone is so wide, but a file may exceed its zone a little."""
_AXIS_M: Final = 6_378_137.0
_FLATTENING: Final = 1.0 / 298.257223563
_N: Final = _FLATTENING / (2.0 - _FLATTENING)
_RADIUS_M: Final = _AXIS_M / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_BETA: Final = (
    _N / 2.0 - 2.0 * _N**2 / 3.0 + 37.0 * _N**3 / 96.0 - _N**4 / 360.0,
    _N**2 / 48.0 + _N**3 / 15.0 - 437.0 * _N**4 / 1440.0,
    17.0 * _N**3 / 480.0 - 37.0 * _N**4 / 840.0,
    4397.0 * _N**4 / 161280.0,
)
_DELTA: Final = (
    2.0 * _N - 2.0 * _N**2 / 3.0 - 2.0 * _N**3 + 116.0 * _N**4 / 45.0,
    7.0 * _N**2 / 3.0 - 8.0 * _N**3 / 5.0 - 227.0 * _N**4 / 45.0,
    56.0 * _N**3 / 15.0 - 136.0 * _N**4 / 35.0,
    4279.0 * _N**4 / 630.0,
)


class Zone(NamedTuple):
    """One of the 60 zones, and its half."""

    number: int
    is_south: bool = False

    @property
    def central_meridian_deg(self) -> float:
        """Longitude of easting 500000."""
        return 6.0 * self.number - 183.0

    def to_globe(self, easting_m: float, northing_m: float) -> Vertex:
        """Latitude and longitude of a place; raises ValueError for one that no zone has."""
        offset_m = FALSE_NORTHING_M if self.is_south else 0.0
        if abs(easting_m - FALSE_EASTING_M) > WIDEST_M:
            raise ValueError("is not in the zone")
        if abs(northing_m - offset_m) > FALSE_NORTHING_M:
            raise ValueError("is farther than a pole")
        xi = (northing_m - offset_m) / (SCALE * _RADIUS_M)
        eta = (easting_m - FALSE_EASTING_M) / (SCALE * _RADIUS_M)
        xi_sphere, eta_sphere = xi, eta
        for order, beta in enumerate(_BETA, start=1):
            xi_sphere -= beta * math.sin(2 * order * xi) * math.cosh(2 * order * eta)
            eta_sphere -= beta * math.cos(2 * order * xi) * math.sinh(2 * order * eta)
        conformal = math.asin(math.sin(xi_sphere) / math.cosh(eta_sphere))
        latitude = conformal + sum(
            delta * math.sin(2 * order * conformal) for order, delta in enumerate(_DELTA, start=1)
        )
        longitude = math.atan2(math.sinh(eta_sphere), math.cos(xi_sphere))
        degrees = self.central_meridian_deg + math.degrees(longitude)
        return math.degrees(latitude), (degrees + 180.0) % 360.0 - 180.0
