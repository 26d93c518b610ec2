"""What time it is on the simulated farm.

The farm lives by the vehicle's UTC, but a flight that begins in the dark or at dusk is lit as if
it began in the middle of the morning of the same day: a picture shows the field at whatever hour
somebody tries the simulation. Weather and sun are shifted alike; no time that a vehicle tells is.
The shift is of whole hours: vehicles that start one after the other see the tractor in one place.
"""

from typing import Final

from sim.world.sun import solar_hour, sun

ENOUGH_DEG: Final = 12.0
"""Elevation of the sun [deg] from which on nothing is shifted."""
_MORNING_H: Final = 10.0
_FLIGHT_S: Final = 1800.0  # So long it has to stay light


def day_shift_s(latitude_deg: float, longitude_deg: float, start_utc_s: float) -> float:
    """What to add [s] to UTC to have the farm's time, for a flight that begins at `start_utc_s`."""
    ends = (start_utc_s, start_utc_s + _FLIGHT_S)
    if all(sun(latitude_deg, longitude_deg, end).elevation_deg >= ENOUGH_DEG for end in ends):
        return 0.0
    hours = (_MORNING_H - solar_hour(longitude_deg, start_utc_s) + 12.0) % 24.0 - 12.0
    return 3600.0 * round(hours)
