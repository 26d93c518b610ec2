"""Places and distances over ground, on WGS 84's radii of curvature: centimetres over a farm."""

import math
from typing import Final, NamedTuple

_EQUATORIAL_RADIUS_M: Final = 6_378_137.0
_ECCENTRICITY_SQUARED: Final = 6.694_379_990_14e-3


class Metres(NamedTuple):
    """A displacement over ground."""

    north_m: float
    east_m: float


class LocalPlane(NamedTuple):
    """The plane that touches the globe at a place, in metres north and east of it."""

    latitude_deg: float
    longitude_deg: float
    per_degree: Metres

    @classmethod
    def at(cls, latitude_deg: float, longitude_deg: float) -> "LocalPlane":
        """The plane at a place."""
        return cls(latitude_deg, longitude_deg, metres_per_degree(latitude_deg))

    def to_plane(self, latitude_deg: float, longitude_deg: float) -> Metres:
        """Where a place lies, by the shorter direction round the globe."""
        east_deg = (longitude_deg - self.longitude_deg + 180.0) % 360.0 - 180.0
        north_deg = latitude_deg - self.latitude_deg
        return Metres(north_deg * self.per_degree.north_m, east_deg * self.per_degree.east_m)

    def to_globe(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude [deg] of a point of the plane."""
        east_deg = east_m / max(self.per_degree.east_m, 1.0)
        longitude_deg = (self.longitude_deg + east_deg + 180.0) % 360.0 - 180.0
        return self.latitude_deg + north_m / self.per_degree.north_m, longitude_deg


def offset(
    latitude_deg: float, longitude_deg: float, to_latitude_deg: float, to_longitude_deg: float
) -> Metres:
    """The displacement from one place to another, also across the date line."""
    per_north, per_east = metres_per_degree((latitude_deg + to_latitude_deg) / 2.0)
    east_deg = (to_longitude_deg - longitude_deg + 180.0) % 360.0 - 180.0
    return Metres((to_latitude_deg - latitude_deg) * per_north, east_deg * per_east)


def distance_m(
    latitude_deg: float, longitude_deg: float, to_latitude_deg: float, to_longitude_deg: float
) -> float:
    """Horizontal distance."""
    return math.hypot(*offset(latitude_deg, longitude_deg, to_latitude_deg, to_longitude_deg))


def shifted(
    latitude_deg: float, longitude_deg: float, bearing_deg: float, distance: float
) -> tuple[float, float]:
    """Latitude and longitude [deg] some metres away, bearing clockwise from north."""
    bearing = math.radians(bearing_deg)
    per_north, _ = metres_per_degree(latitude_deg)
    north_deg = math.cos(bearing) * distance / per_north
    _, per_east = metres_per_degree(latitude_deg + north_deg / 2.0)
    east_deg = math.sin(bearing) * distance / max(per_east, 1.0)
    latitude = max(-90.0, min(90.0, latitude_deg + north_deg))
    return latitude, (longitude_deg + east_deg + 180.0) % 360.0 - 180.0


def metres_per_degree(latitude_deg: float) -> Metres:
    """Radii of curvature along the meridian and along the parallel, per degree."""
    latitude = math.radians(latitude_deg)
    squared = 1.0 - _ECCENTRICITY_SQUARED * math.sin(latitude) ** 2
    meridian = _EQUATORIAL_RADIUS_M * (1.0 - _ECCENTRICITY_SQUARED) / squared**1.5
    parallel = _EQUATORIAL_RADIUS_M / math.sqrt(squared) * math.cos(latitude)
    return Metres(math.radians(meridian), math.radians(parallel))
