"""KML and KMZ in, hostile files too."""

import contextlib
import io
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.faults import Fault, InvalidError
from edge_server.geodata import kml
from edge_server.geodata.field import Field
from tests.support.cases import failures

OUTER = "-3.74,40.44,0 -3.73,40.44,0 -3.73,40.45,0\n -3.74,40.45 -3.74,40.44"
HOLE = "-3.736,40.444 -3.734,40.444 -3.734,40.446 -3.736,40.444"


def ring(coordinates: str) -> str:
    return f"<LinearRing><coordinates>{coordinates}</coordinates></LinearRing>"


def polygon(outer: str = OUTER, *holes: str) -> str:
    inner = "".join(f"<innerBoundaryIs>{ring(hole)}</innerBoundaryIs>" for hole in holes)
    return f"<Polygon><outerBoundaryIs>{ring(outer)}</outerBoundaryIs>{inner}</Polygon>"


def placemark(geometry: str, name: str = "North &amp; hill") -> str:
    return f"<Placemark><name>{name}</name>{geometry}</Placemark>"


def file(content: str, head: str = '<?xml version="1.0" encoding="UTF-8"?>') -> bytes:
    space = 'xmlns="http://www.opengis.net/kml/2.2"'
    return f"{head}<kml {space}><Document><Folder>{content}</Folder></Document></kml>".encode()


def zipped(*members: tuple[str, bytes], packing: int = zipfile.ZIP_DEFLATED) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", packing) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return target.getvalue()


PIN = "<Point><coordinates>1,2</coordinates></Point>"
COORDINATES = "<coordinates>1,2 1,3</coordinates>"


def fields(raw: bytes) -> list[Field]:
    return [boundary.field for boundary in kml.read(raw).boundaries]


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (PIN, "(Gate) has a Point; only polygons are fields"),
        (
            f"<LineString>{COORDINATES}</LineString>",
            "(Gate) has a LineString; only polygons are fields",
        ),
        ("", "(Gate) has no polygon"),
    ],
)
def test_pins_and_paths_of_a_folder_are_left_out(other: str, message: str) -> None:
    found = kml.read(file(placemark(other, "Gate") + placemark(polygon())))
    assert [one.path for one in found.boundaries] == ["Placemark.1.Polygon.0"]
    assert found.left_out == (Fault("Placemark.0", message),)
    assert faults(file(placemark(other, "Gate"))) == {"Placemark.0": message}  # Alone it is refused


def test_the_pin_of_a_label_beside_a_polygon_is_left_out() -> None:
    found = kml.read(file(placemark(f"<MultiGeometry>{PIN}{polygon()}</MultiGeometry>")))
    assert len(found.boundaries) == 1
    assert [one.path for one in found.left_out] == ["Placemark.0"]


def faults(raw: bytes) -> dict[str, str]:
    with pytest.raises(InvalidError) as refused:
        kml.read(raw)
    return {fault.path: fault.message for fault in refused.value.faults}


def test_a_polygon_is_a_field_with_the_placemarks_name() -> None:
    (field,) = fields(file(placemark(polygon(OUTER, HOLE))))
    assert field.name == "North & hill"
    assert field.boundary == ((40.44, -3.74), (40.44, -3.73), (40.45, -3.73), (40.45, -3.74))
    assert field.holes == (((40.444, -3.736), (40.444, -3.734), (40.446, -3.734)),)


def test_polygons_together_are_numbered_fields() -> None:
    both = f"<MultiGeometry>{polygon()}{polygon()}</MultiGeometry>"
    raw = file(placemark(both) + placemark(polygon(), name="South"))
    assert [field.name for field in fields(raw)] == ["North & hill 1", "North & hill 2", "South"]


def test_a_kmz_is_its_document() -> None:
    other = ("a.kml", file(placemark(polygon(), name="other")))
    document = ("doc.kml", file(placemark(polygon(), name="this")))
    picture = ("files/icon.png", b"\x89PNG")
    assert fields(zipped(other, document, picture))[0].name == "this"
    assert fields(zipped(picture, other))[0].name == "other"


BOMB = (
    '<!DOCTYPE kml [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">'
    '<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>'
)
THIEF = '<!DOCTYPE kml [<!ENTITY a SYSTEM "file:///etc/hostname">]>'


INVALID: list[tuple[bytes, str]] = [
    (b"", ""),
    (b"not xml", ""),
    (b"<kml><Placemark>", ""),
    (b"<gpx/>", ""),
    (b"\xff\xfe\x00", ""),
    (b'<?xml version="1.0" encoding="EBCDIC-17"?><kml/>', ""),
    (file(placemark(polygon(), "&c;"), BOMB), ""),
    (file(placemark(polygon(), "&a;"), THIEF), ""),
    (file(placemark(polygon()), '<!DOCTYPE kml SYSTEM "http://127.0.0.1/x.dtd">'), ""),
    (file("<a>" * 60 + "</a>" * 60), ""),
    (file(""), "Placemark"),
    (file(placemark(polygon()) + "<NetworkLink/>"), "NetworkLink"),
    (file(placemark("<Point><coordinates>1,2</coordinates></Point>")), "Placemark.0"),
    (file(placemark("<Polygon/>")), "Placemark.0.Polygon.0.outerBoundaryIs"),
    (
        file(placemark(polygon("-3.74,40.44 -3.73,40.44 -3.74,40.44"))),
        "Placemark.0.Polygon.0.outerBoundaryIs.coordinates",
    ),
    (
        file(placemark(polygon("-3.74,40.44 -3.73,40.44 -3.73,40.45 -3.74,40.45"))),
        "Placemark.0.Polygon.0.outerBoundaryIs.coordinates",
    ),
    (
        file(placemark(polygon("1,2 x,2 3,3 1,2"))),
        "Placemark.0.Polygon.0.outerBoundaryIs.coordinates.1",
    ),
    (
        file(placemark(polygon("1,2 nan,2 3,3 1,2"))),
        "Placemark.0.Polygon.0.outerBoundaryIs.coordinates.1",
    ),
    (
        file(placemark(polygon("1,2 1,93.0 3,3 1,2"))),
        "Placemark.0.Polygon.0.outerBoundaryIs.coordinates.1",
    ),
    (
        file(placemark(polygon(OUTER, "0,0 1,0 1,1 0,0"))),
        "Placemark.0.Polygon.0.innerBoundaryIs.0",
    ),
    (
        file(placemark(polygon("0,0 0.01,0.01 0.01,0 0,0.01 0,0"))),
        "Placemark.0.Polygon.0.outerBoundaryIs",
    ),
    (file(placemark(polygon()) * 101), "Placemark"),
    (zipped(("readme.txt", b"")), ""),
    (zipped(("doc.kml", file(placemark(polygon()))))[:-30], ""),
    (zipped(*[(f"{number}.kml", b"") for number in range(201)]), ""),
    (zipped(("doc.kml", b" " * (kml.LARGEST_BYTES + 1))), ""),
    (zipped(("doc.kml", file(placemark(polygon()))), packing=zipfile.ZIP_LZMA), ""),
]


def check_invalid(raw: bytes, path: str) -> None:
    assert path in faults(raw)


def test_an_invalid_boundary_is_refused_with_its_path() -> None:
    assert failures(check_invalid, INVALID) == []


def test_a_file_cannot_name_what_it_does_not_hold() -> None:
    found = faults(file(placemark(polygon(), "&a;"), THIEF))
    assert found == {"": "must not define a document type or entities"}


def test_the_reason_names_the_placemark() -> None:
    found = faults(file(placemark("<Point><coordinates>1,2</coordinates></Point>", "Gate")))
    assert found == {"Placemark.0": "(Gate) has a Point; only polygons are fields"}


@given(
    st.binary(max_size=60)
    | st.tuples(st.integers(0, 400), st.binary(min_size=1, max_size=4)).map(
        lambda change: spoiled(file(placemark(polygon(OUTER, HOLE))), *change)
    )
    | st.tuples(st.integers(0, 400), st.binary(min_size=1, max_size=4)).map(
        lambda change: spoiled(zipped(("doc.kml", file(placemark(polygon())))), *change)
    )
)
def test_anything_is_read_or_refused(raw: bytes) -> None:
    with contextlib.suppress(InvalidError):
        assert fields(raw)


def spoiled(raw: bytes, place: int, by: bytes) -> bytes:
    """The same bytes with some of them written over."""
    place %= len(raw)
    return raw[:place] + by + raw[place + len(by) :]
