"""A PMTiles archive of version 3 with one tile, as other programs write it."""

import io
import json
import math
import struct
from typing import Any

from PIL import Image

ZOOM = 14


_VECTOR, _PNG = 1, 2
_SIDE = 4096
"""Of a vector tile, in its own units."""


def archive_at(latitude_deg: float, longitude_deg: float, colour: tuple[int, int, int]) -> bytes:
    """An archive with one PNG of one colour at a place."""
    out = io.BytesIO()
    Image.new("RGB", (256, 256), colour).save(out, "PNG")
    return _archive(latitude_deg, longitude_deg, out.getvalue(), _PNG, {})


def vector_archive_at(latitude_deg: float, longitude_deg: float, layer: str) -> bytes:
    """An archive with one vector tile, which a polygon of this layer fills."""
    metadata = {"vector_layers": [{"id": layer, "fields": {}}]}
    return _archive(latitude_deg, longitude_deg, _filled_tile(layer), _VECTOR, metadata)


def _filled_tile(layer: str) -> bytes:
    """A Mapbox Vector Tile, version 2: one layer with one square of the tile's size."""
    move_to, line_to, close = 1 | 1 << 3, 2 | 3 << 3, 7 | 1 << 3
    there, back = 2 * _SIDE, 2 * _SIDE - 1  # Zigzag of a side forth and back
    geometry = (move_to, 0, 0, line_to, there, 0, 0, there, back, 0, close)
    feature = b"\x18\x03" + _member(4, b"".join(map(_varint, geometry)))
    body = b"\x78\x02" + _member(1, layer.encode()) + _member(2, feature)
    return _member(3, body + b"\x28" + _varint(_SIDE))


def _member(number: int, data: bytes) -> bytes:
    """A member of a protocol buffer that has a length."""
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _archive(
    latitude_deg: float, longitude_deg: float, tile: bytes, kind: int, about: dict[str, Any]
) -> bytes:
    x, y = _tile(latitude_deg, longitude_deg)
    metadata = json.dumps(about).encode()
    root = b"".join(map(_varint, (1, _identifier(ZOOM, x, y), 1, len(tile), 1)))
    at_metadata = 127 + len(root)
    at_tiles = at_metadata + len(metadata)
    parts = (127, len(root), at_metadata, len(metadata), 0, 0, at_tiles, len(tile), 1, 1, 1)
    head = b"PMTiles\x03" + struct.pack("<11Q", *parts) + bytes([1, 1, 1, kind, ZOOM, ZOOM])
    west, east = (each / 2**ZOOM * 360.0 - 180.0 for each in (x, x + 1))
    north, south = (_latitude(each) for each in (y, y + 1))
    corners = [round(each * 1e7) for each in (west, south, east, north)]
    centre = struct.pack("<B2i", ZOOM, corners[0], corners[1])
    return head + struct.pack("<4i", *corners) + centre + root + metadata + tile


def _tile(latitude_deg: float, longitude_deg: float) -> tuple[int, int]:
    """Column and row of the tile of a place (Web Mercator)."""
    latitude = math.radians(latitude_deg)
    x = (longitude_deg + 180.0) / 360.0
    y = (1.0 - math.asinh(math.tan(latitude)) / math.pi) / 2.0
    return int(x * 2**ZOOM), int(y * 2**ZOOM)


def _latitude(row: int) -> float:
    return math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / 2**ZOOM))))


def _identifier(zoom: int, x: int, y: int) -> int:
    """Number of a tile on the Hilbert curves of all zooms."""
    found = sum(1 << 2 * each for each in range(zoom))
    side = 2**zoom // 2
    while side:
        right, down = int(bool(x & side)), int(bool(y & side))
        found += side * side * ((3 * right) ^ down)
        if not down:
            if right:
                x, y = side - 1 - x, side - 1 - y
            x, y = y, x
        side //= 2
    return found


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(0x80 | value & 0x7F)
        value >>= 7
    return bytes([*out, value])
