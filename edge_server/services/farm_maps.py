"""Maps of the farm that a person has put into the maps folder: PMTiles archives and GeoTIFFs.

A file that cannot be shown is listed with the reason, so that whoever put it there finds it.
"""

import hashlib
import os
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from edge_server.geodata import geotiff
from edge_server.pictures.orthophotos import LARGEST_MEGAPIXELS
from edge_server.pictures.program import BusyError, UnreadableError
from edge_server.services.context import Context
from edge_server.services.errors import NotFoundError, TooMuchError

MOST_MAPS: Final = 50
"""Of the folder, by name; what comes after them is not listed."""
PMTILES: Final = ".pmtiles"
GEOTIFF: Final = (".tif", ".tiff")
_MOST_BANDS: Final = 4
_HEADER: Final = struct.Struct("<7sB8Q24xBBBBBBiiii")
"""Of a PMTiles archive: magic, version, where each part begins and its length (root directory,
metadata, leaf directories, tiles), compressions, kind of tiles, zooms, bounds [1e-7 deg].
"""
_PARTS: Final = 8
_VECTOR_TILES: Final = 1
_RASTER_TILES: Final = frozenset({2, 3, 4, 5})
"""PNG, JPEG, WebP, AVIF."""
_PER_DEG: Final = 1e7
_PIECE_BYTES: Final = 65_536


class MapFile(NamedTuple):
    """The file of a map, its size and a tag that changes with its content."""

    path: Path
    size_bytes: int
    tag: str

    def read(self, start: int, stop: int) -> Iterator[bytes]:
        """Read the bytes from `start` to before `stop`, a piece at a time."""
        with self.path.open("rb") as file:
            file.seek(start)
            while start < stop and (piece := file.read(min(_PIECE_BYTES, stop - start))):
                yield piece
                start += len(piece)


class _UnusableError(Exception):
    """A file that cannot be shown; the text says why."""


def listing(context: Context) -> list[dict[str, Any]]:
    """List the maps of the folder by name; an absent folder has none."""
    return [_show(path) for path in _paths(context.config.maps_dir)]


def tiles(context: Context, name: str) -> MapFile:
    """Find a PMTiles archive; raises NotFoundError if the folder has none of this name."""
    return _find(context, name, (PMTILES,))


def orthophoto(context: Context, name: str) -> MapFile:
    """Find a GeoTIFF; raises NotFoundError if the folder has none of this name."""
    return _find(context, name, GEOTIFF)


def orthophoto_picture(context: Context, found: MapFile) -> bytes:
    """Return the picture of a GeoTIFF as a WebP, its north up.

    Raises:
        NotFoundError: if it cannot be shown.
        TooMuchError: if another one is being prepared.
    """
    try:
        _orthophoto(found.path)
        key = hashlib.sha256(f"{found.path.name} {found.tag}".encode()).hexdigest()
        return context.orthophotos.of(key, found.path)
    except (_UnusableError, UnreadableError) as error:
        raise NotFoundError(f"the map cannot be shown: {error}") from None
    except OSError:
        raise NotFoundError(f"the map cannot be shown: {_UNREADABLE}") from None
    except BusyError as error:
        raise TooMuchError(str(error)) from None


def _find(context: Context, name: str, suffixes: Sequence[str]) -> MapFile:
    for path in _paths(context.config.maps_dir):
        if path.name == name and path.suffix.lower() in suffixes:
            status = path.stat()
            return MapFile(path, status.st_size, f"{status.st_size:x}-{status.st_mtime_ns:x}")
    raise NotFoundError(f"the maps folder has no {suffixes[0]} file of this name")


def _paths(folder: Path) -> Iterator[Path]:
    try:
        found = sorted(path for path in folder.iterdir() if path.suffix.lower() in _READERS)
        base = folder.resolve()
    except OSError:
        return
    # A link must not lead out of the folder
    inside = (path for path in found if path.is_file() and path.resolve().is_relative_to(base))
    for _, path in zip(range(MOST_MAPS), inside, strict=False):
        yield path


def _show(path: Path) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "name": path.name,
        "kind": None,
        "url": None,
        "bounds": None,
        "corners": None,
        "minimum_zoom": None,
        "maximum_zoom": None,
        "fault": None,
    }
    try:
        return shown | _READERS[path.suffix.lower()](path)
    except (_UnusableError, OSError) as error:
        return shown | {"fault": str(error) if isinstance(error, _UnusableError) else _UNREADABLE}


_UNREADABLE: Final = "the file cannot be read; check its permissions"


def _tiles(path: Path) -> dict[str, Any]:
    """Read the header of a PMTiles archive."""
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
        size_bytes = os.fstat(file.fileno()).st_size
    if len(head) < _HEADER.size or not head.startswith(b"PMTiles"):
        raise _UnusableError("it is not a PMTiles archive")
    _, version, *parts = _HEADER.unpack(head)
    _, _, _, kind, lowest, highest, west, south, east, north = parts[_PARTS:]
    if version != 3:
        raise _UnusableError(f"PMTiles version {version} is not supported, only version 3")
    if kind != _VECTOR_TILES and kind not in _RASTER_TILES:
        raise _UnusableError(f"tiles of kind {kind} are not supported: only MVT, PNG, JPEG, WebP")
    begins_and_lengths = zip(parts[:_PARTS:2], parts[1:_PARTS:2], strict=True)
    whole_bytes = max(begins + length for begins, length in begins_and_lengths)
    if size_bytes < whole_bytes:
        raise _UnusableError(
            f"it is cut off: it has {size_bytes} of {whole_bytes} bytes; copy it again"
        )
    return {
        "kind": "vector_tiles" if kind == _VECTOR_TILES else "raster_tiles",
        "url": f"/maps/{path.name}",
        "bounds": [west / _PER_DEG, south / _PER_DEG, east / _PER_DEG, north / _PER_DEG],
        "minimum_zoom": lowest,
        "maximum_zoom": highest,
    }


def _orthophoto(path: Path) -> dict[str, Any]:
    """Read the tags of a GeoTIFF."""
    with path.open("rb") as file:
        try:
            found = geotiff.read(file)
        except ValueError as error:
            raise _UnusableError(str(error)) from None
    if found.width_px * found.height_px > LARGEST_MEGAPIXELS * 1_000_000:
        raise _UnusableError(
            f"it has {found.width_px} x {found.height_px} pixels, more than {LARGEST_MEGAPIXELS} "
            "megapixels: reduce it, or make a PMTiles archive of it"
        )
    is_index = found.bands == 1 and found.is_float
    if not is_index and (found.bits != 8 or found.bands > _MOST_BANDS):
        raise _UnusableError(
            f"{found.bands} bands of {found.bits} bits are not supported: only colours of 8 bits, "
            "or one band with a vegetation index"
        )
    latitudes, longitudes = zip(*found.corners, strict=True)
    return {
        "kind": "vegetation_index" if is_index else "picture",
        "url": f"/maps/{path.name}/picture",
        "bounds": [min(longitudes), min(latitudes), max(longitudes), max(latitudes)],
        "corners": [list(corner) for corner in found.corners],
    }


_READERS: Final = {PMTILES: _tiles} | dict.fromkeys(GEOTIFF, _orthophoto)
