"""Position and illuminance of the sun by time and place, and the farm's time of day.

The sun's place follows the Astronomical Almanac's low-precision formulas (section C, "Low
precision formulas for the Sun"), good to 0.01 degrees between 1950 and 2050; refraction is left
out. Daylight follows the clear-sky model of the IES (Gillette, Pierpoint and Treado, Journal of
the IES 13, 1984): 127.5 klx outside the air, extinction 0.21, and 0.8 + 15.5 sqrt(sin a) klx
from the sky.

The farm's time is the vehicle's UTC. A flight that begins in the dark or at dusk is lit as if it
began in the middle of the morning of the same day, so that its pictures show the field. Weather
and sun are shifted alike; times reported by a vehicle are not. The shift is of whole hours, so
that vehicles that start one after the other see the tractor in one place.
"""

import math
from typing import Final, NamedTuple

_J2000_UTC_S: Final = 946_728_000.0  # 2000-01-01 12:00 UTC
_DAY_S: Final = 86_400.0
_DIRECT_LX: Final = 127_500.0
_EXTINCTION: Final = 0.21
_SKY_LX: Final = (800.0, 15_500.0)
_LOWEST_SINE: Final = 1e-6  # No direct light comes through so much air
_TWILIGHT_DEG: Final = -6.0
_MOONLIGHT_LX: Final = 0.1
ENOUGH_DEG: Final = 12.0
"""Elevation of the sun [deg] from which on nothing is shifted."""
_MORNING_H: Final = 10.0
_FLIGHT_S: Final = 1800.0  # Assumed duration


class Sun(NamedTuple):
    """Direction of the sun."""

    elevation_deg: float  # [deg] Above the horizon
    azimuth_deg: float  # [deg] Clockwise from true north, 0 to 360

    @property
    def towards_enu(self) -> tuple[float, float, float]:
        """Unit vector to the sun: east, north, up."""
        elevation, azimuth = math.radians(self.elevation_deg), math.radians(self.azimuth_deg)
        level = math.cos(elevation)
        return level * math.sin(azimuth), level * math.cos(azimuth), math.sin(elevation)


def sun(latitude_deg: float, longitude_deg: float, time_utc_s: float) -> Sun:
    """The sun at a place [deg] and a time [s since 1970]."""
    days = (time_utc_s - _J2000_UTC_S) / _DAY_S
    mean_longitude_deg = 280.460 + 0.9856474 * days
    anomaly = math.radians(357.528 + 0.9856003 * days)
    ecliptic = math.radians(
        mean_longitude_deg + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly)
    )
    obliquity = math.radians(23.439 - 4e-7 * days)
    ascension = math.atan2(math.cos(obliquity) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(obliquity) * math.sin(ecliptic))
    sidereal_deg = 15.0 * ((18.697374558 + 24.06570982441908 * days) % 24.0)
    hour_angle = math.radians(sidereal_deg + longitude_deg) - ascension
    return _seen(math.radians(latitude_deg), declination, hour_angle)


def _seen(latitude: float, declination: float, hour_angle: float) -> Sun:
    """Equatorial to horizontal coordinates [rad]."""
    east = -math.cos(declination) * math.sin(hour_angle)
    north = math.cos(latitude) * math.sin(declination) - math.sin(latitude) * math.cos(
        declination
    ) * math.cos(hour_angle)
    up = math.sin(latitude) * math.sin(declination) + math.cos(latitude) * math.cos(
        declination
    ) * math.cos(hour_angle)
    return Sun(
        math.degrees(math.asin(max(-1.0, min(1.0, up)))),
        math.degrees(math.atan2(east, north)) % 360.0,
    )


def solar_hour(longitude_deg: float, time_utc_s: float) -> float:
    """Mean solar time [h], 0 to 24: the sun is highest at about 12."""
    return (time_utc_s / 3600.0 + longitude_deg / 15.0) % 24.0


def illuminance_lx(elevation_deg: float) -> float:
    """Light on level ground under a clear sky [lx]; twilight fades to moonlight by -6 degrees."""
    if elevation_deg <= 0.0:
        share = max(0.0, 1.0 - elevation_deg / _TWILIGHT_DEG)
        return _MOONLIGHT_LX + (_SKY_LX[0] - _MOONLIGHT_LX) * share**3
    sine = math.sin(math.radians(elevation_deg))
    direct = _DIRECT_LX * math.exp(-_EXTINCTION / max(sine, _LOWEST_SINE)) * sine
    return direct + _SKY_LX[0] + _SKY_LX[1] * math.sqrt(sine)


def day_shift_s(latitude_deg: float, longitude_deg: float, start_utc_s: float) -> float:
    """What to add [s] to UTC to have the farm's time, for a flight that begins at `start_utc_s`."""
    ends = (start_utc_s, start_utc_s + _FLIGHT_S)
    if all(sun(latitude_deg, longitude_deg, end).elevation_deg >= ENOUGH_DEG for end in ends):
        return 0.0
    hours = (_MORNING_H - solar_hour(longitude_deg, start_utc_s) + 12.0) % 24.0 - 12.0
    return 3600.0 * round(hours)
