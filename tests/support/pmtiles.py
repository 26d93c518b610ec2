"""A PMTiles archive of version 3 with one tile, as other programs write it."""

import io
import json
import math
import struct

from PIL import Image

ZOOM = 14


def archive_at(latitude_deg: float, longitude_deg: float, colour: tuple[int, int, int]) -> bytes:
    """An archive with one PNG of one colour at a place."""
    x, y = _tile(latitude_deg, longitude_deg)
    out = io.BytesIO()
    Image.new("RGB", (256, 256), colour).save(out, "PNG")
    tile, metadata = out.getvalue(), json.dumps({}).encode()
    root = b"".join(map(_varint, (1, _identifier(ZOOM, x, y), 1, len(tile), 1)))
    at_metadata = 127 + len(root)
    at_tiles = at_metadata + len(metadata)
    parts = (127, len(root), at_metadata, len(metadata), 0, 0, at_tiles, len(tile), 1, 1, 1)
    head = b"PMTiles\x03" + struct.pack("<11Q", *parts) + bytes([1, 1, 1, 2, ZOOM, ZOOM])
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
