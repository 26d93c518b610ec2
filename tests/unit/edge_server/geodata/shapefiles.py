"""Shapefiles for tests, written by the format's own description."""

import struct
from collections.abc import Sequence

from tests.unit.edge_server.geodata.test_kml import zipped

Ring = Sequence[tuple[float, float]]
WGS84 = (
    'GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],'
    'PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]'
)


def utm(
    number: int,
    datum: str = "D_WGS_1984",
    *,
    scale: float = 0.9996,
    northing: float = 0.0,
    unit: str = 'UNIT["Meter",1.0]',
) -> str:
    """The description of a zone as desktop programs write it."""
    return (
        f'PROJCS["UTM_Zone_{number}",GEOGCS["GCS",DATUM["{datum}",SPHEROID["S",6378137.0,298.25]],'
        'PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],'
        'PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],'
        f'PARAMETER["False_Northing",{northing}],'
        f'PARAMETER["Central_Meridian",{6 * number - 183}.0],'
        f'PARAMETER["Scale_Factor",{scale}],PARAMETER["Latitude_Of_Origin",0.0],{unit}]'
    )


def record(*rings: Ring, kind: int = 5) -> bytes:
    """The content of a record, a polygon: rings are closed here."""
    closed = [[*ring, ring[0]] for ring in rings]
    starts = [sum(map(len, closed[:index])) for index in range(len(closed))]
    points = [number for ring in closed for point in ring for number in point]
    count = len(points) // 2
    head = struct.pack("<i4d2i", kind, 0, 0, 0, 0, len(rings), count)
    return head + struct.pack(f"<{len(starts)}i", *starts) + struct.pack(f"<{2 * count}d", *points)


def shp(*records: bytes, kind: int = 5) -> bytes:
    """The file of these records."""
    body = b"".join(
        struct.pack(">2i", number, len(record) // 2) + record
        for number, record in enumerate(records, start=1)
    )
    size = (100 + len(body)) // 2
    return struct.pack(">i20xi", 9994, size) + struct.pack("<2i64x", 1000, kind) + body


def dbf(names: Sequence[bytes], column: bytes = b"NAME", width: int = 20) -> bytes:
    """A table with a number, and the names in the second column."""
    columns = b"".join(
        title.ljust(11, b"\0") + b"C" + bytes(4) + bytes((size,)) + bytes(15)
        for title, size in ((b"AREA", 5), (column, width))
    )
    header = 32 + len(columns) + 1
    start = struct.pack("<4BIHH20x", 3, 126, 1, 1, len(names), header, 1 + 5 + width)
    rows = b"".join(b" 12.50" + name.ljust(width) for name in names)
    return start + columns + b"\r" + rows


def archive(
    shapes: bytes,
    reference: str | None = WGS84,
    table: bytes | None = None,
    cpg: bytes | None = None,
) -> bytes:
    """The zip archive that a person uploads."""
    parts = [("farm/north.shp", shapes)]
    if reference is not None:
        parts.append(("farm/north.prj", reference.encode()))
    if table is not None:
        parts.append(("farm/NORTH.DBF", table))
    if cpg is not None:
        parts.append(("farm/north.cpg", cpg))
    return zipped(*parts)
