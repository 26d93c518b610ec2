"""The farm as one thing to ask: what is where, how it is there, at a time.

Pure functions of latitude, longitude [deg, WGS-84], time [s since 1970, UTC] and the seed. The
same seed is the same farm in every process. One read costs some tens of microseconds; what needs
whole pictures at once uses `plane`, `moisture_map` and `vigour_map`.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from sim.world import climate
from sim.world.climate import Ground, Hour
from sim.world.geometry import edge_distance_m, smooth_step
from sim.world.layout import FIELDS, Field
from sim.world.plane import Array, Place, Plane
from sim.world.smooth_map import Layer, SmoothMap
from sim.world.subjects import Subject, subjects_at
from sim.world.sun import Sun, illuminance_lx, solar_hour, sun

_EDGE_M: Final = 2.5  # Over which a field's soil changes into its neighbour's
WILD_VIGOUR: Final = 0.26
"""NDVI of the dry grass between the fields."""
_WILD_MOISTURE: Final = 0.13
WATER_SHARE, SOIL_SHARE = 0.6, 0.8
"""What makes plants vigorous: their squares add to 1."""
VIGOUR_SPREAD: Final = 0.07
"""[-] Standard deviation of NDVI within a field."""
_DRYING: Final = 0.06  # Share of the water that a day takes and the night gives back
FLOOR_M: Final = 330.0
"""Where the valley's level floor ends [m from the origin]."""
_HILLS_M: Final = 900.0  # Where the slopes end
_HILL_HEIGHT_M: Final = 28.0

DEFAULT_ORIGIN: Final = Plane(40.44340, -3.73820, 650.0)
"""Home of the default world."""


class Farm:
    """One farm; `origin` is where its yard lies, `seed` chooses its maps."""

    def __init__(self, seed: int = 1, origin: Plane = DEFAULT_ORIGIN) -> None:
        self.seed = seed
        self.plane = origin
        self.moisture_map = SmoothMap(seed, Layer.MOISTURE)
        self.vigour_map = SmoothMap(seed, Layer.VIGOUR)
        self._air_map = SmoothMap(seed, Layer.AIR)
        self._relief_map = SmoothMap(seed, Layer.RELIEF)
        self._humidity_map = SmoothMap(seed, Layer.HUMIDITY)
        self._last_ground: tuple[tuple[float, float, float], Ground] | None = None

    @property
    def fields(self) -> Sequence[Field]:
        """The fields, in metres on `plane`; `sim/world/geojson.py` gives them in degrees."""
        return FIELDS

    def field_at(self, latitude_deg: float, longitude_deg: float) -> Field | None:
        """The field that a place lies in, None beside them all."""
        place = self.plane.place(latitude_deg, longitude_deg)
        inside = (field for field in FIELDS if edge_distance_m(field.boundary, place) >= 0.0)
        return next(inside, None)

    def subjects(self, time_utc_s: float) -> tuple[Subject, ...]:
        """What moves, and where it is at a time."""
        return subjects_at(self.seed, time_utc_s)

    def sun(self, time_utc_s: float) -> Sun:
        """Where the sun stands."""
        return sun(self.plane.latitude_deg, self.plane.longitude_deg, time_utc_s)

    def illuminance(self, latitude_deg: float, longitude_deg: float, time_utc_s: float) -> float:
        """Light on level ground [lx]; the sky is clear."""
        return illuminance_lx(sun(latitude_deg, longitude_deg, time_utc_s).elevation_deg)

    def elevation_amsl_m(self, latitude_deg: float, longitude_deg: float) -> float:
        """Altitude of the ground [m above mean sea level].

        The farm lies on the level floor of a valley, on which JSBSim's ground agrees with it;
        farther than 330 m from home the map rises to hills, which are seen and measured only.
        """
        east, north = self.plane.place(latitude_deg, longitude_deg)
        height = self.hill_heights_m(np.array([east]), np.array([north]))
        return self.plane.altitude_amsl_m + float(height[0])

    def hill_heights_m(self, east_m: Array, north_m: Array) -> Array:
        """Height of the land above the floor [m] at places of the map; 0 on the floor."""
        share = np.clip((np.hypot(east_m, north_m) - FLOOR_M) / (_HILLS_M - FLOOR_M), 0.0, 1.0)
        relief = 1.0 + 0.35 * self._relief_map.over(0.2 * east_m, 0.2 * north_m)
        height: Array = _HILL_HEIGHT_M * share**2 * (3.0 - 2.0 * share) * np.maximum(relief, 0.1)
        return height

    def soil_moisture(self, latitude_deg: float, longitude_deg: float, time_utc_s: float) -> float:
        """Water in the upper 10 cm of the soil [m^3/m^3]; wettest at dawn, after the irrigation."""
        place = self.plane.place(latitude_deg, longitude_deg)
        hour = solar_hour(longitude_deg, time_utc_s)
        daily = 1.0 + _DRYING * math.cos(2.0 * math.pi * (hour - 6.0) / 24.0)
        return self._standing_moisture(place) * daily

    def vegetation_index(
        self, latitude_deg: float, longitude_deg: float, time_utc_s: float
    ) -> float:
        """NDVI of the ground as a satellite sees it, leaves and soil together, -1 to 1.

        Within the time of a flight nothing grows: the time has no influence yet.
        """
        del time_utc_s
        return self._vegetation(self.plane.place(latitude_deg, longitude_deg))

    def air_temperature(
        self,
        latitude_deg: float,
        longitude_deg: float,
        time_utc_s: float,
        height_above_ground_m: float = 2.0,
    ) -> float:
        """Temperature of the air [deg C]."""
        ground = self._ground(latitude_deg, longitude_deg, time_utc_s)
        return climate.air_c(
            self._mean_c(time_utc_s),
            Hour(time_utc_s, solar_hour(longitude_deg, time_utc_s)),
            ground,
            height_above_ground_m,
        )

    def soil_temperature(
        self, latitude_deg: float, longitude_deg: float, time_utc_s: float
    ) -> float:
        """Temperature of the soil at a depth of 5 cm [deg C]."""
        return climate.soil_c(
            self._mean_c(time_utc_s),
            Hour(time_utc_s, solar_hour(longitude_deg, time_utc_s)),
            self._ground(latitude_deg, longitude_deg, time_utc_s),
        )

    def relative_humidity(
        self,
        latitude_deg: float,
        longitude_deg: float,
        time_utc_s: float,
        height_above_ground_m: float = 2.0,
    ) -> float:
        """Relative humidity of the air [%], 1 to 100."""
        ground = self._ground(latitude_deg, longitude_deg, time_utc_s)
        air = self.air_temperature(latitude_deg, longitude_deg, time_utc_s, height_above_ground_m)
        return climate.relative_humidity_percent(air, self._mean_c(time_utc_s), ground)

    def _mean_c(self, time_utc_s: float) -> float:
        return climate.mean_c(self.plane.latitude_deg, self.plane.altitude_amsl_m, time_utc_s)

    def _ground(self, latitude_deg: float, longitude_deg: float, time_utc_s: float) -> Ground:
        """The ground at a place; the last one is kept, since a sample asks four times for it."""
        asked = (latitude_deg, longitude_deg, time_utc_s)
        if self._last_ground is not None and self._last_ground[0] == asked:
            return self._last_ground[1]
        place = self.plane.place(latitude_deg, longitude_deg)
        ground = Ground(
            air=self._air_map.at(*place),
            humidity=self._humidity_map.at(*place),
            vegetation=self._vegetation(place),
            moisture=self.soil_moisture(latitude_deg, longitude_deg, time_utc_s),
        )
        self._last_ground = (asked, ground)
        return ground

    def _standing_moisture(self, place: Place) -> float:
        moisture = _WILD_MOISTURE
        for field in FIELDS:
            moisture += _share(field, place) * (field.moisture - _WILD_MOISTURE)
        return max(0.03, moisture * (1.0 + 0.22 * self.moisture_map.at(*place)))

    def _vegetation(self, place: Place) -> float:
        """Vigour follows the water and the soil's own quality."""
        vigour = WILD_VIGOUR
        for field in FIELDS:
            vigour += _share(field, place) * (field.vigour - WILD_VIGOUR)
        quality = WATER_SHARE * self.moisture_map.at(*place)
        quality += SOIL_SHARE * self.vigour_map.at(*place)
        return min(0.95, max(0.05, vigour + VIGOUR_SPREAD * quality))


def _share(field: Field, place: Place) -> float:
    """How much of a field there is at a place: 0 outside to 1 inside, smooth over its edge."""
    return smooth_step(0.5 + 0.5 * edge_distance_m(field.boundary, place) / _EDGE_M)
