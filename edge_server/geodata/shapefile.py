"""Field boundaries as a zipped ESRI Shapefile: `.shp`, `.prj`, and names in `.dbf`. Pure.

Format: "ESRI Shapefile Technical Description" (1998); dBASE III for the names. Every polygon of
a record is a field. A ring that runs anticlockwise inside another one is a hole in it.
"""

import itertools
import math
import struct
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from afarcloud import geometry
from afarcloud.faults import Fault, InvalidError
from edge_server.geodata import projection
from edge_server.geodata.projection import ToGlobe
from edge_server.geodata.rings import (
    MOST_FIELDS,
    MOST_RINGS,
    Boundary,
    FieldFile,
    Ring,
    field_file,
    fields_of,
    refusal,
)
from edge_server.geodata.zipped import Archive, is_zip

MEDIA_TYPES: Final = frozenset({"application/zip", "application/x-zip-compressed"})
LARGEST_BYTES: Final = 4 * 1024 * 1024
"""Size that a part of the archive unpacks to, whatever size the archive states."""
_LARGEST_TEXT_BYTES: Final = 64 * 1024
_KIND: Final = "zip archive"
_HEADER_BYTES: Final = 100
_FILE_CODE: Final = 9994
_VERSION: Final = 1000
_NULL: Final = 0
_POLYGONS: Final = frozenset({5, 15, 25})
_SHAPES: Final = {
    1: "points",
    3: "lines",
    8: "multipoints",
    11: "points",
    13: "lines",
    18: "multipoints",
    21: "points",
    23: "lines",
    28: "multipoints",
    31: "surfaces",
}
_SHAPE_BYTES: Final = 44
"""Of a polygon, before the indices of its parts."""
_NAMES: Final = ("name", "nombre", "title", "label", "id")
_Points = list[tuple[float, float]]


def is_shapefile(raw: bytes) -> bool:
    """Whether bytes are a zip archive without KML; raises InvalidError for a broken one."""
    return is_zip(raw) and not Archive(raw, _KIND).names(".kml")


class _Parts(NamedTuple):
    """The files of the archive that are read, and the name of the one with the shapes."""

    name: str
    shapes: bytes
    to_globe: ToGlobe
    titles: list[str | None]


def read(raw: bytes) -> FieldFile:
    """Read the boundaries of fields out of a zip archive with one Shapefile.

    Raises:
        InvalidError: naming each file of the archive, and its record, that is wrong, and why.
    """
    parts = _parts(Archive(raw, _KIND))
    found: list[Boundary] = []
    faults: list[Fault] = []
    for index, shape in enumerate(_records(parts)):
        path = f"{parts.name}.record.{index + 1}"
        title = parts.titles[index] if index < len(parts.titles) else None
        try:
            if shape is not None:
                found += fields_of(title, _polygons(shape, path, parts.to_globe), [])
        except InvalidError as error:
            faults += error.faults
        if len(found) > MOST_FIELDS:
            raise refusal(parts.name, f"makes more than {MOST_FIELDS} fields")
    if not (found or faults):
        raise refusal(parts.name, "holds no polygon")
    return field_file(found, (), faults)


def _parts(archive: Archive) -> _Parts:
    shapes = archive.names(".shp")
    if not shapes:
        raise refusal("", "is a zip archive without Shapefile (.shp) and without KML")
    if len(shapes) > 1:
        names = ", ".join(sorted(shapes)[:5])
        raise refusal("", f"holds {len(shapes)} Shapefiles ({names}); give each its own archive")
    name = shapes[0]
    reference = _beside(archive, name, ".prj")
    if reference is None:
        text = "is missing: without it the coordinate reference system is unknown"
        raise refusal(f"{name[:-4]}.prj", text)
    system = archive.read(reference, _LARGEST_TEXT_BYTES, reference)
    try:
        to_globe = projection.read(system.decode("utf-8-sig", errors="replace"))
    except ValueError as error:
        raise refusal(reference, str(error)) from None
    return _Parts(name, archive.read(name, LARGEST_BYTES, name), to_globe, _titles(archive, name))


def _beside(archive: Archive, name: str, suffix: str) -> str | None:
    """The file of the same name with another suffix."""
    wanted = f"{name[:-4]}{suffix}".lower()
    return next((one for one in archive.names(suffix) if one.lower() == wanted), None)


def _records(parts: _Parts) -> Iterator[bytes | None]:
    """The polygon of each record, None for an empty one."""
    raw, name = parts.shapes, parts.name
    if len(raw) < _HEADER_BYTES:
        raise refusal(name, f"is cut off: it has {len(raw)} bytes, its header alone 100")
    code, words = struct.unpack_from(">i20xi", raw)
    version, kind = struct.unpack_from("<ii", raw, 28)
    if code != _FILE_CODE or version != _VERSION:
        raise refusal(name, "is no Shapefile: its first bytes are others")
    if kind not in _POLYGONS:
        what = _SHAPES.get(kind, f"shapes of type {kind}")
        raise refusal(name, f"holds {what}; only polygons are fields")
    end = 2 * words
    if end != len(raw):
        raise refusal(name, f"is cut off or changed: it has {len(raw)} bytes, and states {end}")
    place, number = _HEADER_BYTES, 0
    while place < end:
        number += 1
        path = f"{name}.record.{number}"
        size = 2 * struct.unpack_from(">4xi", raw, place)[0] if place + 8 <= end else -1
        if size < 4 or place + 8 + size > end:
            raise refusal(path, "is cut off")
        shape = raw[place + 8 : place + 8 + size]
        (kind,) = struct.unpack_from("<i", shape)
        if kind not in {_NULL, *_POLYGONS}:
            raise refusal(path, f"is of type {kind}; only polygons are fields")
        yield None if kind == _NULL else shape
        place += 8 + size


def _polygons(shape: bytes, path: str, to_globe: ToGlobe) -> list[tuple[str, list[Ring]]]:
    """Each polygon of a record: its outer ring, then its holes."""
    found: list[tuple[str, list[Ring]]] = []
    inner: list[Ring] = []
    for place, points in _rings(shape, path):
        ring = (place, _corners(points, place, to_globe))
        if _is_clockwise(points):
            found.append((place, [ring]))
        else:
            inner.append(ring)
    for place, corners in inner:
        around = [rings for _, rings in found if geometry.contains(rings[0][1], corners[0])]
        if around:
            smallest = min(around, key=lambda rings: geometry.area_m2(rings[0][1]))
            smallest.append((place, corners))
        else:  # Some programs write their rings in the opposite direction
            found.append((place, [(place, corners)]))
    return found


def _rings(shape: bytes, path: str) -> Iterator[tuple[str, _Points]]:
    """The points of each ring without the repeated first one, and its path."""
    if len(shape) < _SHAPE_BYTES:
        raise refusal(path, "is cut off")
    count, points = struct.unpack_from("<ii", shape, 36)
    if not 1 <= count <= MOST_RINGS:
        raise refusal(path, f"has {count} rings; 1 to {MOST_RINGS} are read")
    first = _SHAPE_BYTES + 4 * count
    if points < 0 or first + 16 * points > len(shape):
        raise refusal(path, f"is cut off: it states {points} points")
    starts = [*struct.unpack_from(f"<{count}i", shape, _SHAPE_BYTES), points]
    if starts[0] != 0 or any(a >= b for a, b in itertools.pairwise(starts)):
        raise refusal(path, "has rings that begin outside of its points")
    numbers = struct.unpack_from(f"<{2 * points}d", shape, first)
    if not all(map(math.isfinite, numbers)):
        raise refusal(path, "has a place that is no number")
    for index in range(count):
        low, high = 2 * starts[index], 2 * starts[index + 1]
        ring = list(zip(numbers[low:high:2], numbers[low + 1 : high : 2], strict=True))
        place = f"{path}.ring.{index + 1}"
        if len(ring) < 4:
            raise refusal(place, "must have four or more places")
        if ring[0] != ring[-1]:
            raise refusal(place, "must end where it begins")
        yield place, ring[:-1]


def _is_clockwise(points: Sequence[tuple[float, float]]) -> bool:
    following = [*points[1:], points[0]]
    turns = zip(points, following, strict=True)
    x, y = points[0]
    return sum((a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y) for a, b in turns) < 0.0


def _corners(points: _Points, path: str, to_globe: ToGlobe) -> list[tuple[float, float]]:
    try:
        return [to_globe(*point) for point in points]
    except ValueError as error:
        raise refusal(path, f"{error}, as its reference system says") from None


def _titles(archive: Archive, shapes: str) -> list[str | None]:
    """The names of the records in their order, empty without a table or a column of names."""
    name = _beside(archive, shapes, ".dbf")
    if name is None:
        return []
    raw = archive.read(name, LARGEST_BYTES, name)
    if len(raw) < 32:
        raise refusal(name, f"is cut off: it has {len(raw)} bytes, its header alone 32")
    rows, header, width = struct.unpack_from("<IHH", raw, 4)
    if header < 33 or width < 1 or len(raw) < header + rows * width:
        raise refusal(name, f"is cut off: it states {rows} rows of {width} bytes")
    column = _column(raw[32:header])
    if column is None:
        return []
    low, high = column
    encoding = _encoding(archive, shapes)
    found: list[str | None] = []
    for start in range(header, header + rows * width, width):
        text = raw[start + low : start + min(high, width)]
        found.append(_decoded(text, encoding) or None)
    return found


def _column(descriptions: bytes) -> tuple[int, int] | None:
    """Where in a row the name stands: the first column of the usual ones."""
    columns: dict[str, tuple[int, int]] = {}
    place = 1  # After the mark of a deleted row
    for start in range(0, len(descriptions) - 31, 32):
        title = descriptions[start : start + 11].split(b"\0")[0].decode("ascii", "replace")
        width = descriptions[start + 16]
        columns.setdefault(title.strip().lower(), (place, place + width))
        place += width
    return next((columns[name] for name in _NAMES if name in columns), None)


def _encoding(archive: Archive, shapes: str) -> str:
    """The encoding that a `.cpg` names; without one, UTF-8 is tried first."""
    name = _beside(archive, shapes, ".cpg")
    if name is None:
        return "utf-8"
    text = archive.read(name, _LARGEST_TEXT_BYTES, name).decode("ascii", "replace").strip().lower()
    return "utf-8" if text in {"utf-8", "utf8", "65001"} else "cp1252"


def _decoded(text: bytes, encoding: str) -> str:
    try:
        return text.decode(encoding).strip("\0 ")
    except UnicodeDecodeError:
        return text.decode("cp1252", "replace").strip("\0 ")
