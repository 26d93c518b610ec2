"""WGS-84 for the judges: neither the firmware's formulas nor the simulator's.

A position becomes earth-centred coordinates and is projected on the plane that touches the
ellipsoid below the reference (NIMA TR8350.2, section 4): within a kilometre the distance over
ground is right to a tenth of a millimetre. Going back is Newton's method on the way there, so
that the two cannot disagree.
"""

import math
from typing import Final

_SEMI_MAJOR_AXIS_M: Final = 6_378_137.0
_ECCENTRICITY_SQUARED: Final = 6.69437999014e-3  # TR8350.2, table 3.3
_NEWTON_STEPS: Final = 3
_SMALL_DEG: Final = 1e-5  # About a metre, for a slope by difference


class LocalGround:
    """Metres north and east of a reference place, at its altitude."""

    def __init__(self, latitude_deg: float, longitude_deg: float, altitude_m: float = 0.0) -> None:
        self._latitude_deg, self._longitude_deg = latitude_deg, longitude_deg
        self._altitude_m = altitude_m
        phi, lam = math.radians(latitude_deg), math.radians(longitude_deg)
        self._north = (
            -math.sin(phi) * math.cos(lam),
            -math.sin(phi) * math.sin(lam),
            math.cos(phi),
        )
        self._east = (-math.sin(lam), math.cos(lam), 0.0)
        self._centre = _earth_centred(latitude_deg, longitude_deg, altitude_m)
        self._metres_per_degree = (
            self.north_east_m(latitude_deg + _SMALL_DEG, longitude_deg)[0] / _SMALL_DEG,
            self.north_east_m(latitude_deg, longitude_deg + _SMALL_DEG)[1] / _SMALL_DEG,
        )

    def north_east_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Metres north and east of the reference."""
        there = _earth_centred(latitude_deg, longitude_deg, self._altitude_m)
        x, y, z = (a - b for a, b in zip(there, self._centre, strict=True))
        north, east = self._north, self._east
        return north[0] * x + north[1] * y + north[2] * z, east[0] * x + east[1] * y

    def place(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude [deg] so many metres north and east of the reference."""
        latitude, longitude = self._latitude_deg, self._longitude_deg
        for _ in range(_NEWTON_STEPS):
            north, east = self.north_east_m(latitude, longitude)
            latitude += (north_m - north) / self._metres_per_degree[0]
            longitude += (east_m - east) / self._metres_per_degree[1]
        return latitude, longitude


def _earth_centred(
    latitude_deg: float, longitude_deg: float, height_m: float
) -> tuple[float, float, float]:
    phi, lam = math.radians(latitude_deg), math.radians(longitude_deg)
    sine = math.sin(phi)
    transverse_m = _SEMI_MAJOR_AXIS_M / math.sqrt(1.0 - _ECCENTRICITY_SQUARED * sine * sine)
    from_axis_m = (transverse_m + height_m) * math.cos(phi)
    return (
        from_axis_m * math.cos(lam),
        from_axis_m * math.sin(lam),
        (transverse_m * (1.0 - _ECCENTRICITY_SQUARED) + height_m) * sine,
    )
