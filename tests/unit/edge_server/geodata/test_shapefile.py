"""Zipped Shapefiles in, hostile ones too."""

import contextlib
import io
import struct
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.faults import InvalidError
from edge_server.geodata import shapefile
from edge_server.geodata.field import Field
from edge_server.geodata.utm import Zone
from tests.unit.edge_server.geodata.shapefiles import WGS84, archive, dbf, record, shp, utm
from tests.unit.edge_server.geodata.test_kml import zipped

# Clockwise, as the format demands of outer rings: longitude, latitude
OUTER = [(-3.74, 40.44), (-3.74, 40.45), (-3.73, 40.45), (-3.73, 40.44)]
HOLE = [(-3.736, 40.444), (-3.734, 40.444), (-3.734, 40.446)]
EAST = [(longitude + 0.02, latitude) for longitude, latitude in OUTER]
FILE = "farm/north.shp"


def fields(raw: bytes) -> list[Field]:
    assert shapefile.is_shapefile(raw)
    return [boundary.field for boundary in shapefile.read(raw).boundaries]


def faults(raw: bytes) -> dict[str, str]:
    with pytest.raises(InvalidError) as refused:
        shapefile.read(raw)
    return {fault.path: fault.message for fault in refused.value.faults}


def test_each_record_is_a_field_with_its_name() -> None:
    table = dbf([b"North", "Cañada".encode("cp1252")])
    first, second = fields(archive(shp(record(OUTER, HOLE), record(EAST)), WGS84, table))
    assert (first.name, second.name) == ("North", "Cañada")
    assert first.boundary == tuple((latitude, longitude) for longitude, latitude in OUTER)
    assert first.holes == (tuple((latitude, longitude) for longitude, latitude in HOLE),)
    assert second.holes == ()


def test_an_encoding_that_is_named_is_used() -> None:
    table = dbf(["Cañada".encode()])
    (field,) = fields(archive(shp(record(OUTER)), WGS84, table, b"UTF-8\n"))
    assert field.name == "Cañada"


def test_names_are_not_needed() -> None:
    assert fields(archive(shp(record(OUTER))))[0].name is None
    table = dbf([b"clay"], column=b"SOIL")
    assert fields(archive(shp(record(OUTER)), WGS84, table))[0].name is None


def test_several_polygons_of_a_record_are_several_fields() -> None:
    inside_east = [(longitude + 0.02, latitude) for longitude, latitude in HOLE]
    shapes = shp(record(OUTER, EAST, inside_east))
    first, second = fields(archive(shapes, WGS84, dbf([b"Both"])))
    assert (first.name, second.name) == ("Both 1", "Both 2")
    assert (len(first.holes), len(second.holes)) == (0, 1)


def test_a_ring_that_runs_the_other_way_is_a_field_too() -> None:
    (field,) = fields(archive(shp(record(OUTER[::-1]))))
    assert len(field.boundary) == 4


@pytest.mark.parametrize("kind", [15, 25])
def test_heights_and_measures_are_passed_over(kind: int) -> None:
    shape = record(OUTER, kind=kind) + struct.pack("<7d", *range(7))
    assert len(fields(archive(shp(shape, kind=kind)))) == 1


def test_an_empty_record_is_no_field() -> None:
    empty = struct.pack("<i", 0)
    (field,) = fields(archive(shp(empty, record(OUTER)), WGS84, dbf([b"none", b"North"])))
    assert field.name == "North"
    assert "holds no polygon" in faults(archive(shp(empty)))[FILE]


@pytest.mark.parametrize("datum", ["D_WGS_1984", "D_ETRS_1989", "WGS_1984"])
def test_a_zone_of_utm_becomes_degrees(datum: str) -> None:
    # The CN Tower: 17N, 630084 m east, 4833438 m north
    square = [(630084.0, 4833438.0), (630084.0, 4833538.0), (630184.0, 4833538.0)]
    (field,) = fields(archive(shp(record(square)), utm(17, datum)))
    assert field.boundary[0] == pytest.approx((43.642567, -79.387139), abs=1e-5)


@pytest.mark.parametrize(("is_south", "sign"), [(False, 1.0), (True, -1.0)])
def test_the_central_meridian_has_its_length(is_south: bool, sign: float) -> None:
    arc_m = 0.9996 * 4_984_944.378  # From the equator to 45 degrees on the ellipsoid
    northing = arc_m if not is_south else 10_000_000.0 - arc_m
    assert Zone(30, is_south=is_south).to_globe(500_000.0, northing) == pytest.approx(
        (sign * 45.0, -3.0), abs=1e-8
    )


@pytest.mark.parametrize(
    "reference",
    [
        'PROJCS["OSGB36 / British National Grid",GEOGCS["x",DATUM["OSGB_1936"]]]',
        utm(30, "D_European_1950"),
        utm(30, scale=1.0),
        utm(30, unit='UNIT["Foot_US",0.3048006096]'),
        utm(30, northing=5.0),
        utm(75),
        'GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984"],PRIMEM["Paris",2.33],UNIT["Degree",0.01745]]',
        'GEOGCS["In gon",DATUM["D_WGS_1984"],UNIT["Grad",0.0157079632679489]]',
    ],
)
def test_another_reference_system_is_refused_by_its_name(reference: str) -> None:
    found = faults(archive(shp(record(OUTER)), reference))
    assert list(found) == ["farm/north.prj"]
    assert reference.split('"')[1] in found["farm/north.prj"]
    assert "EPSG:4326" in found["farm/north.prj"]


def test_without_a_reference_system_nothing_is_read() -> None:
    assert "is missing" in faults(archive(shp(record(OUTER)), None))["farm/north.prj"]
    assert "WKT" in faults(archive(shp(record(OUTER)), "EPSG:4326"))["farm/north.prj"]


def test_metres_under_a_reference_in_degrees_are_refused_at_their_ring() -> None:
    found = faults(archive(shp(record([(4e5, 4e6), (4e5, 5e6), (5e5, 5e6)]))))
    assert list(found) == [f"{FILE}.record.1.ring.1"]
    assert "longitude" in found[f"{FILE}.record.1.ring.1"]


@pytest.mark.parametrize(("kind", "name"), [(1, "points"), (3, "lines"), (8, "multipoints")])
def test_only_polygons_are_fields(kind: int, name: str) -> None:
    assert f"holds {name}; only polygons" in faults(archive(shp(kind=kind)))[FILE]


def test_what_is_cut_off_is_named() -> None:
    whole = shp(record(OUTER))
    assert "is cut off" in faults(archive(whole[:60]))[FILE]
    assert "is cut off" in faults(archive(whole[:-20]))[FILE]
    stated = whole[:24] + struct.pack(">i", (len(whole) - 20) // 2) + whole[28:-20]
    assert faults(archive(stated))[f"{FILE}.record.1"] == "is cut off"
    table = dbf([b"North"])[:-3]
    assert "is cut off" in faults(archive(whole, WGS84, table))["farm/NORTH.DBF"]
    assert "is no Shapefile" in faults(archive(bytes(200)))[FILE]


def test_what_macos_adds_to_an_archive_is_passed_over() -> None:
    whole = archive(shp(record(OUTER)))
    with zipfile.ZipFile(io.BytesIO(whole)) as opened:
        members = [(name, opened.read(name)) for name in opened.namelist()]
    added = [(f"__MACOSX/farm/._{name.split('/')[1]}", b"\0\5\x16\7") for name, _ in members]
    assert fields(zipped(*added, *members)) == fields(whole)


def test_an_archive_has_one_shapefile() -> None:
    assert "without Shapefile" in faults(zipped(("a.txt", b"")))[""]
    two = zipped(("a.shp", b""), ("b.shp", b""))
    assert "holds 2 Shapefiles (a.shp, b.shp)" in faults(two)[""]
    assert "is no whole zip archive" in faults(archive(shp(record(OUTER)))[:-30])[""]


@pytest.mark.parametrize("suffix", ["shp", "prj", "dbf"])
def test_what_unpacks_to_too_much_is_refused_by_its_name(suffix: str) -> None:
    parts = {"shp": shp(record(OUTER)), "prj": WGS84.encode(), "dbf": dbf([b"North"])}
    parts[suffix] = bytes(shapefile.LARGEST_BYTES + 1)
    raw = zipped(*((f"north.{name}", content) for name, content in parts.items()))
    assert len(raw) < 10_000
    assert "unpacks to more than" in faults(raw)[f"north.{suffix}"]


@given(st.integers(0, 400), st.binary(min_size=1, max_size=8))
def test_damage_is_refused_or_harmless(place: int, damage: bytes) -> None:
    whole = shp(record(OUTER, HOLE))
    with contextlib.suppress(InvalidError):
        shapefile.read(archive(whole[:place] + damage + whole[place + len(damage) :]))
