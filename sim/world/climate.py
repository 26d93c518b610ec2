"""Air and soil through the day and the year: smooth functions of time, place and ground.

The daily wave of the air is a cosine that peaks three hours after noon; that of the soil, 5 cm
deep, is damped and one and a half hours later (Campbell and Norman 1998, "An Introduction to
Environmental Biophysics", sections 2.5 and 2.6). Humidity follows from air temperature and a dew
point that stays through the day, by Magnus' formula with the coefficients of Alduchov and
Eskridge (Journal of Applied Meteorology 35, 1996).
"""

import math
from typing import Final, NamedTuple

_YEAR_S: Final = 365.2425 * 86_400.0
_WARMEST_S: Final = 200.0 * 86_400.0  # After New Year, on the northern hemisphere
_SEA_LEVEL_MEAN_C: Final = (27.0, 17.5)  # At the equator; less by the latitude's sine squared
_SEASON_C: Final = 13.5  # Half range between seasons at 90 degrees, times the sine of latitude
_DAILY_C: Final = 6.0
_AIR_PEAK_H, _SOIL_PEAK_H = 15.0, 16.5
_LAPSE_C_PER_M: Final = 0.0065
_DEW_POINT_BELOW_MEAN_C: Final = 10.0
_MAGNUS: Final = (17.625, 243.04)


class Ground(NamedTuple):
    """What the place adds: numbers without unit, from the farm's maps."""

    air: float  # [-] Map about 0, warm where positive
    humidity: float  # [-] Map about 0, damp where positive
    vegetation: float  # [-] NDVI
    moisture: float  # [m^3/m^3] Of the soil


class Hour(NamedTuple):
    """When, as the climate sees it."""

    time_utc_s: float  # [s since 1970]
    solar_hour: float  # [h] 0 to 24


def mean_c(latitude_deg: float, altitude_amsl_m: float, time_utc_s: float) -> float:
    """Air temperature [deg C] of the day's mean, at a height above mean sea level."""
    sine = math.sin(math.radians(latitude_deg))
    season = math.cos(2.0 * math.pi * ((time_utc_s - _WARMEST_S) % _YEAR_S) / _YEAR_S)
    sea_level = _SEA_LEVEL_MEAN_C[0] - _SEA_LEVEL_MEAN_C[1] * sine * sine
    return sea_level + _SEASON_C * sine * season - _LAPSE_C_PER_M * altitude_amsl_m


def air_c(daily_mean_c: float, hour: Hour, ground: Ground, height_m: float) -> float:
    """Air temperature [deg C] `height_m` above the ground; leaves cool the air above them."""
    wave = math.cos(2.0 * math.pi * (hour.solar_hour - _AIR_PEAK_H) / 24.0)
    cooling = 1.2 * ground.vegetation * max(0.0, wave)
    return (
        daily_mean_c
        + _DAILY_C * wave
        + 0.35 * ground.air
        - cooling
        - _LAPSE_C_PER_M * max(0.0, height_m)
    )


def soil_c(daily_mean_c: float, hour: Hour, ground: Ground) -> float:
    """Soil temperature [deg C] at a depth of 5 cm; shade and water flatten the wave."""
    wave = math.cos(2.0 * math.pi * (hour.solar_hour - _SOIL_PEAK_H) / 24.0)
    damping = 1.0 - 0.4 * ground.vegetation - 0.8 * ground.moisture
    return daily_mean_c + 0.8 + 0.25 * ground.air + 0.9 * _DAILY_C * max(0.2, damping) * wave


def relative_humidity_percent(
    air_temperature_c: float, daily_mean_c: float, ground: Ground
) -> float:
    """Relative humidity [%] of air that has the day's dew point, 1 to 100."""
    dew_point_c = (
        daily_mean_c
        - _DEW_POINT_BELOW_MEAN_C
        + 0.4 * ground.humidity
        + 2.0 * ground.vegetation
        + 4.0 * ground.moisture
    )
    share = math.exp(_magnus(dew_point_c) - _magnus(air_temperature_c))
    return min(100.0, max(1.0, 100.0 * share))


def _magnus(temperature_c: float) -> float:
    slope, offset_c = _MAGNUS
    return slope * temperature_c / (offset_c + temperature_c)
