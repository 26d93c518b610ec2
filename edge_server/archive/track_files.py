"""A track as GeoJSON (RFC 7946), CSV (RFC 4180) or GPX 1.1, written a line at a time. Pure.

Altitudes are metres above home, in GPX too: the vehicle does not report its height above sea level.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple

from afarcloud.numbers import format_time
from edge_server.archive.reader import Point

CSV_HEADER: Final = (
    "time,latitude_deg,longitude_deg,altitude_m,speed_m_s,heading_deg,battery_fraction"
)
_GPX_HEAD: Final = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<gpx version="1.1" creator="farm-flight-bridge" xmlns="http://www.topografix.com/GPX/1/1">\n'
)


class Track(NamedTuple):
    """A track: members that name its flight, and its points, which may be read repeatedly."""

    properties: dict[str, Any]
    points: Callable[[], Iterable[Point]]


def geojson(track: Track) -> Iterator[str]:
    """Write a feature: the line, and times, speeds, headings and batteries by its positions."""
    count = sum(1 for _ in track.points())
    if count == 0:
        yield '{"type":"Feature","geometry":null,"properties":'
    else:
        kind = "LineString" if count > 1 else "Point"
        yield f'{{"type":"Feature","geometry":{{"type":"{kind}","coordinates":'
        yield from _list(track.points(), _position, brackets=count > 1)
        yield '},"properties":'
    yield json.dumps(track.properties)[:-1]
    members: dict[str, Callable[[Point], Any]] = {
        "times": lambda point: time_text(point.at_ms),
        "speeds": lambda point: point.speed,
        "headings": lambda point: point.heading,
        "batteries": lambda point: point.battery,
    }
    separator = ',"coordinateProperties":{'
    for name, member in members.items():
        yield f'{separator}"{name}":'
        yield from _list(track.points(), member)
        separator = ","
    yield "}}}\n"


def _position(point: Point) -> list[float]:
    return [point.longitude, point.latitude, point.altitude]


def _list(
    points: Iterable[Point], member: Callable[[Point], Any], *, brackets: bool = True
) -> Iterator[str]:
    separator = "[" if brackets else ""
    for point in points:
        yield separator + json.dumps(member(point), allow_nan=False)
        separator = ","
    if brackets:
        yield "[]" if separator == "[" else "]"


def csv(track: Track) -> Iterator[str]:
    """Write a row per point; a battery that was not reported is empty."""
    yield CSV_HEADER + "\r\n"
    for point in track.points():
        battery = "" if point.battery is None else repr(point.battery)
        numbers = (
            point.latitude,
            point.longitude,
            point.altitude,
            point.speed,
            point.heading,
        )
        yield ",".join([time_text(point.at_ms), *map(repr, numbers), battery]) + "\r\n"


def gpx(track: Track) -> Iterator[str]:
    """Write a track of one segment."""
    yield _GPX_HEAD
    yield f"<trk><name>flight {track.properties['flight_id']}</name>"
    yield "<desc>ele is the height above home</desc><trkseg>\n"
    for point in track.points():
        # The schema's longitudes end before 180, and its numbers have no exponent
        longitude = point.longitude if point.longitude < 180.0 else -180.0
        yield (
            f'<trkpt lat="{point.latitude:.8f}" lon="{longitude:.8f}">'
            f"<ele>{point.altitude:.3f}</ele><time>{time_text(point.at_ms)}</time></trkpt>\n"
        )
    yield "</trkseg></trk></gpx>\n"


def time_text(at_ms: int) -> str:
    """Write a time [ms since 1970] as RFC 3339 in UTC."""
    return format_time(datetime.fromtimestamp(at_ms / 1000, UTC))


FORMATS: Final[dict[str, tuple[str, Callable[[Track], Iterator[str]]]]] = {
    "geojson": ("application/geo+json", geojson),
    "csv": ("text/csv; charset=utf-8", csv),
    "gpx": ("application/gpx+xml", gpx),
}
"""Media type and writer of each format."""
