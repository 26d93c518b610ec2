"""Places to fly at. Each is a home; the magnetic field, gravity and the air follow from it.

The field is that of `sim/physics/magnetic_field.py`, gravity that of JSBSim (WGS-84 with J2), the
air JSBSim's standard atmosphere of 1976. Altitudes are those of level ground at the place.
"""

from types import MappingProxyType
from typing import Final, NamedTuple


class World(NamedTuple):
    """Where home is."""

    latitude_deg: float  # [deg] WGS-84
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m] Of the ground
    title: str


DEFAULT: Final = "farm"

WORLDS: Final = MappingProxyType(
    {
        "farm": World(40.44340, -3.73820, 650.0, "Farm north-west of Madrid, Spain"),
        "balcarce": World(-37.76400, -58.29600, 110.0, "Pampas near Balcarce, Argentina"),
        "taveuni": World(-16.85500, 179.99990, 60.0, "On the date line, Taveuni, Fiji"),
        "altiplano": World(-16.50500, -68.17000, 4050.0, "High plain near La Paz, Bolivia"),
        "tromso": World(69.64900, 18.95500, 20.0, "Beyond the Arctic Circle, Tromso, Norway"),
        "kenya": World(0.00010, 37.07200, 1900.0, "On the equator, Nanyuki, Kenya"),
    }
)


class UnknownWorldError(ValueError):
    """There is no world of that name; the message lists those there are."""


def world(name: str) -> World:
    """Look a world up.

    Raises:
        UnknownWorldError: if there is none of that name.
    """
    try:
        return WORLDS[name]
    except KeyError:
        raise UnknownWorldError(
            f"there is no world {name!r}; there are {', '.join(WORLDS)}"
        ) from None
