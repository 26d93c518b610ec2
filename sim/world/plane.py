"""The farm's map: metres east and north of its origin, and back to WGS-84."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim.physics.earth import DegreesPerMetre, degrees_per_metre, wrapped_longitude_deg

Array: TypeAlias = NDArray[np.float64]
"""Numbers of any shape; functions of places work on whole pictures at once."""

_HALF_TURN_DEG: Final = 180.0


class Place(NamedTuple):
    """A point of the map."""

    east_m: float  # [m] East of the origin
    north_m: float  # [m] North of the origin


@dataclass(frozen=True)
class Plane:
    """A map whose scale is that of the ellipsoid at its origin, at the origin's altitude.

    The map defines where things are, so that it has no error. Seen from elsewhere its metres
    are a little longer or shorter: 0.07 per mille to the east, 500 m north of the origin.
    """

    latitude_deg: float  # [deg] WGS-84, of the origin
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m] Of the ground at the origin

    @cached_property
    def scale(self) -> DegreesPerMetre:
        """Degrees in a metre of the map."""
        return degrees_per_metre(self.latitude_deg, self.altitude_amsl_m)

    def place(self, latitude_deg: float, longitude_deg: float) -> Place:
        """Where a geographic point [deg] is on the map, the short way round the globe."""
        east_deg = (longitude_deg - self.longitude_deg + _HALF_TURN_DEG) % 360.0 - _HALF_TURN_DEG
        return Place(
            east_deg / self.scale.east, (latitude_deg - self.latitude_deg) / self.scale.north
        )

    def geodetic(self, place: tuple[float, float]) -> tuple[float, float]:
        """Latitude and longitude [deg] of a point of the map."""
        east_m, north_m = place
        return (
            self.latitude_deg + north_m * self.scale.north,
            wrapped_longitude_deg(self.longitude_deg + east_m * self.scale.east),
        )
