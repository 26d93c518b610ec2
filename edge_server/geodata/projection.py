"""The reference system of a `.prj` file: degrees of WGS-84, or a zone of UTM. Pure.

The file is WKT as ESRI and OGC write it (ISO 19125, section 9). ETRS89 is taken for WGS-84: they
differ by less than a metre in Europe. Any other datum is off by up to hundreds, so it is refused.
"""

import re
from collections.abc import Callable, Mapping
from typing import Final

from afarcloud.plan import Vertex
from edge_server.geodata.utm import FALSE_EASTING_M, FALSE_NORTHING_M, SCALE, Zone

ToGlobe = Callable[[float, float], Vertex]
"""First and second coordinate of a place to latitude and longitude; raises ValueError."""
_HEAD: Final = re.compile(r'\s*(\w+)\s*[\[(]\s*"([^"]*)"')
_DATUM: Final = re.compile(r'\bDATUM\s*[\[(]\s*"([^"]*)"', re.IGNORECASE)
_PROJECTION: Final = re.compile(r'\bPROJECTION\s*[\[(]\s*"([^"]*)"', re.IGNORECASE)
_PARAMETER: Final = re.compile(
    r'\bPARAMETER\s*[\[(]\s*"([^"]*)"\s*,\s*(-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)', re.IGNORECASE
)
_UNITS: Final = re.compile(
    r'\bUNIT\s*[\[(]\s*"[^"]*"\s*,\s*(-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)', re.IGNORECASE
)
_PRIME_MERIDIAN: Final = re.compile(
    r'\bPRIMEM\s*[\[(]\s*"[^"]*"\s*,\s*(-?\d+(?:\.\d*)?)', re.IGNORECASE
)
_DATUMS: Final = frozenset(
    {"wgs1984", "wgs84", "worldgeodeticsystem1984", "etrs1989", "etrs89"}
    | {"europeanterrestrialreferencesystem1989"}
)
_RADIANS_PER_DEGREE: Final = 0.0174532925199433
_LONGEST_NAME: Final = 80


def read(text: str) -> ToGlobe:
    """Read the file.

    Raises:
        ValueError: if it is no such file, or names a reference system that cannot be used.
    """
    head = _HEAD.match(text)
    if head is None:
        raise ValueError("is no description of a reference system (WKT)")
    kind, name = head[1].upper(), head[2][:_LONGEST_NAME]
    if kind not in {"GEOGCS", "PROJCS"} or not _has_known_datum(text):
        raise ValueError(_refusal(name))
    if kind == "GEOGCS":
        _check_unit(text, _RADIANS_PER_DEGREE, name)
        return _from_degrees
    zone = _zone(text)
    if zone is None:
        raise ValueError(_refusal(name))
    _check_unit(text, 1.0, name)
    return zone.to_globe


def _refusal(name: str) -> str:
    return (
        f'is in "{name}", which is not read; save the file in WGS 84 (EPSG:4326) or in a UTM zone '
        "of WGS 84 or ETRS89"
    )


def _has_known_datum(text: str) -> bool:
    found = _DATUM.search(text)
    meridian = _PRIME_MERIDIAN.search(text)
    if found is None or (meridian is not None and float(meridian[1]) != 0.0):
        return False
    plain = re.sub(r"[^a-z0-9]", "", found[1].lower()).removeprefix("d")
    return plain in _DATUMS


def _check_unit(text: str, wanted: float, name: str) -> None:
    """Check the unit of the coordinates: the last one of the file."""
    units = _UNITS.findall(text)
    if not units or abs(float(units[-1]) / wanted - 1.0) > 1e-6:
        raise ValueError(_refusal(name))


def _zone(text: str) -> Zone | None:
    projection = _PROJECTION.search(text)
    if projection is None or projection[1].lower() != "transverse_mercator":
        return None
    values = {name.lower(): float(number) for name, number in _PARAMETER.findall(text)}
    number = (values.get("central_meridian", 0.0) + 183.0) / 6.0
    is_zone = (
        number.is_integer()
        and 1 <= number <= 60
        and _is(values, "scale_factor", SCALE)
        and _is(values, "false_easting", FALSE_EASTING_M)
        and _is(values, "latitude_of_origin", 0.0)
    )
    northing = values.get("false_northing", 0.0)
    if not is_zone or northing not in {0.0, FALSE_NORTHING_M}:
        return None
    return Zone(int(number), is_south=northing == FALSE_NORTHING_M)


def _is(values: Mapping[str, float], name: str, wanted: float) -> bool:
    return abs(values.get(name, 0.0) - wanted) < 1e-9 * max(1.0, wanted)


def _from_degrees(longitude_deg: float, latitude_deg: float) -> Vertex:
    if not -180.0 <= longitude_deg <= 180.0:
        raise ValueError("must have a longitude, -180 to 180")
    if not -90.0 <= latitude_deg <= 90.0:
        raise ValueError("must have a latitude, -90 to 90")
    return latitude_deg, longitude_deg
