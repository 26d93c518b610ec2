"""Where a GeoTIFF lies and what its pixels are, from its tags alone (OGC 19-008r4). Pure.

Supported: classic TIFF, north up, degrees of WGS-84 or ETRS89, or metres of their UTM zones.
"""

import os
import struct
from typing import BinaryIO, Final, NamedTuple

from afarcloud.plan import Vertex
from edge_server.geodata.utm import Zone

_BYTE_ORDERS: Final = {b"II": "<", b"MM": ">"}
_CLASSIC, _BIG = 42, 43
_TYPES: Final = {3: "H", 4: "I", 12: "d"}
"""Of the values that are read, by their number in TIFF."""
_WHOLE: Final = frozenset({3, 4})
_WIDTH, _HEIGHT, _BITS, _BANDS, _SAMPLE_FORMAT = 256, 257, 258, 277, 339
_PIXEL_SCALE, _TIEPOINT, _TRANSFORMATION, _KEYS = 33550, 33922, 34264, 34735
_PIXELS: Final = ((273, 279), (324, 325))
"""Where strips or tiles of pixels begin, and their lengths in bytes."""
_WANTED: Final = frozenset(
    {_WIDTH, _HEIGHT, _BITS, _BANDS, _SAMPLE_FORMAT}
    | {_PIXEL_SCALE, _TIEPOINT, _TRANSFORMATION, _KEYS}
)
_RASTER_TYPE, _GEOGRAPHIC, _PROJECTED = 1025, 2048, 3072
_PIXEL_IS_POINT: Final = 2
_FLOAT: Final = 3
_USER_DEFINED: Final = 32767
_MOST_VALUES: Final = 4096
_MOST_TAGS: Final = 512
_DEGREES: Final = frozenset({4326, 4258})
_ZONES: Final = (
    (32601, 32660, False, 32600),
    (32701, 32760, True, 32700),
    (25828, 25838, False, 25800),
)
"""First and last code of UTM zones, whether they are southern, and the code before zone 1."""


class GeoTiff(NamedTuple):
    """Size in pixels, kind of the pixels, and the corners from the north-west on clockwise."""

    width_px: int
    height_px: int
    bands: int
    bits: int
    is_float: bool
    corners: tuple[Vertex, ...]


def read(file: BinaryIO) -> GeoTiff:
    """Read the tags of a file.

    Raises:
        ValueError: if it is not a GeoTIFF, or one that is not supported; the text says why.
    """
    try:
        tags = _tags(file)
        width, height = int(tags[_WIDTH][0]), int(tags[_HEIGHT][0])
    except (struct.error, KeyError, IndexError):
        raise ValueError("it is not a TIFF") from None
    if width < 1 or height < 1:
        raise ValueError("it has no pixels")
    return GeoTiff(
        width,
        height,
        int(tags.get(_BANDS, (1,))[0]),
        int(tags.get(_BITS, (1,))[0]),
        is_float=tags.get(_SAMPLE_FORMAT, (1,))[0] == _FLOAT,
        corners=_corners(tags, width, height),
    )


def _tags(file: BinaryIO) -> dict[int, tuple[float, ...]]:
    """Read the wanted tags of the first picture of the file."""
    head = file.read(8)
    order = _BYTE_ORDERS.get(head[:2])
    if order is None:
        raise ValueError("it is not a TIFF")
    version, offset = struct.unpack(f"{order}HI", head[2:])
    if version == _BIG:
        raise ValueError("BigTIFF is not supported, only classic TIFF of at most 4 GB")
    if version != _CLASSIC:
        raise ValueError("it is not a TIFF")
    file.seek(offset)
    (count,) = struct.unpack(f"{order}H", file.read(2))
    entries = file.read(12 * min(count, _MOST_TAGS))
    found = {
        tag: (kind, values, place)
        for tag, kind, values, place in struct.iter_unpack(f"{order}HHI4s", entries)
        if kind in _TYPES
    }
    for pair in _PIXELS:
        if all(tag in found and found[tag][0] in _WHOLE and found[tag][1] > 0 for tag in pair):
            _check_end(file, order, *(found[tag] for tag in pair))
    return {
        tag: _values(file, order, *entry)
        for tag, entry in found.items()
        if tag in _WANTED and entry[1] <= _MOST_VALUES
    }


def _check_end(
    file: BinaryIO, order: str, begins: tuple[int, int, bytes], lengths: tuple[int, int, bytes]
) -> None:
    """Refuse a file that ends before its last strip or tile does; writers put that one last."""
    whole_bytes = int(_last(file, order, *begins) + _last(file, order, *lengths))
    size_bytes = file.seek(0, os.SEEK_END)
    if size_bytes < whole_bytes:
        raise ValueError(
            f"it is cut off: it has {size_bytes} of {whole_bytes} bytes; copy it again"
        )


def _last(file: BinaryIO, order: str, kind: int, count: int, place: bytes) -> float:
    """Read the last value of a tag, of which there may be very many."""
    layout = struct.Struct(f"{order}{_TYPES[kind]}")
    before_bytes = layout.size * (count - 1)
    if layout.size * count > len(place):
        file.seek(struct.unpack(f"{order}I", place)[0] + before_bytes)
        place, before_bytes = file.read(layout.size), 0
    (value,) = layout.unpack_from(place, before_bytes)
    return float(value)


def _values(file: BinaryIO, order: str, kind: int, count: int, place: bytes) -> tuple[float, ...]:
    """Read the values of a tag: in its entry where they fit, else where it points to."""
    layout = struct.Struct(f"{order}{count}{_TYPES[kind]}")
    if layout.size <= len(place):
        return layout.unpack(place[: layout.size])
    file.seek(struct.unpack(f"{order}I", place)[0])
    return layout.unpack(file.read(layout.size))


def _corners(
    tags: dict[int, tuple[float, ...]], width_px: int, height_px: int
) -> tuple[Vertex, ...]:
    scale, tie = tags.get(_PIXEL_SCALE, ()), tags.get(_TIEPOINT, ())
    if _TRANSFORMATION in tags and not scale:
        raise ValueError("a turned grid (ModelTransformation) is not supported, only north up")
    if len(scale) < 2 or len(tie) < 6:
        raise ValueError("it has no place: ModelPixelScale or ModelTiepoint is missing")
    if len(tie) > 6:
        raise ValueError("several tie points are not supported, only one with ModelPixelScale")
    keys = _keys(tags.get(_KEYS, ()))
    half = 0.5 if keys.get(_RASTER_TYPE) == _PIXEL_IS_POINT else 0.0
    west = tie[3] - (tie[0] + half) * scale[0]
    north = tie[4] + (tie[1] + half) * scale[1]
    east, south = west + width_px * scale[0], north - height_px * scale[1]
    places = ((west, north), (east, north), (east, south), (west, south))
    if keys.get(_PROJECTED) is None and keys.get(_GEOGRAPHIC) in _DEGREES:
        corners = tuple((latitude, longitude) for longitude, latitude in places)
    else:
        zone = _zone(keys)
        corners = tuple(zone.to_globe(*place) for place in places)
    if not all(-90.0 <= latitude <= 90.0 and -180.0 <= lon <= 180.0 for latitude, lon in corners):
        raise ValueError("its corners are not on the earth")
    return corners


def _keys(directory: tuple[float, ...]) -> dict[int, int]:
    """Read the keys whose value is in the directory itself."""
    rows = [directory[at : at + 4] for at in range(4, len(directory) - 3, 4)]
    return {int(key): int(value) for key, place, _, value in rows if place == 0}


def _zone(keys: dict[int, int]) -> Zone:
    code = keys.get(_PROJECTED) or keys.get(_GEOGRAPHIC) or 0
    for first, last, is_south, before in _ZONES:
        if first <= code <= last:
            return Zone(code - before, is_south)
    name = f"EPSG:{code}" if code not in {0, _USER_DEFINED} else "a system without an EPSG code"
    raise ValueError(
        f"its coordinates are in {name}, which is not supported: save it in EPSG:4326 or UTM "
        "(EPSG:326xx, 327xx, 258xx)"
    )
